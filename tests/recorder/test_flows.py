"""Energy flows balance at every node, and a Sankey diagram of them is as wide as its joules."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_msgs_py.modes import Mode
from ir_recorder import Analysis, analyse
from ir_recorder.analysis.flows import EnergyFlows, energy_flows
from ir_recorder.analysis.production import levers
from ir_recorder.report.sankey import TALL, rows, sankey, sankey_section

OF_READINGS = 1.0  # J: the program's ends lie between two readings of the meter
# of the axes' energy: joint states and readings of the meter are not at the same instants
OF_SAMPLING = 0.02
JOULES = st.floats(1.0, 1e6)


def test_the_mains_are_those_of_the_program(analysis: Analysis) -> None:
    flows = energy_flows(analysis)
    program = analysis.program
    assert flows is not None
    assert program is not None
    assert flows.mains == pytest.approx(program.whole.energy, rel=0.01)
    assert flows.mains == pytest.approx(
        flows.controller + flows.tool + flows.rectifier + flows.from_mains
    )


def test_friction_and_losses_are_those_of_the_data(analysis: Analysis) -> None:
    """By the friction and the copper losses of the robot's data, which `energy_flows` doesn't
    read.
    """
    flows = energy_flows(analysis)
    joints = analysis.recording.joints
    cell = analysis.cell
    assert flows is not None
    assert joints is not None
    assert cell is not None
    moving = np.zeros(len(joints.time), bool)
    for result in analysis.movements:
        moving |= (joints.time >= result.step.start) & (joints.time <= result.step.end)
    speed = np.abs(joints.velocity[moving])
    robot = cell.robot
    friction = speed**2 @ robot.friction_viscous + speed @ robot.friction_coulomb
    assert flows.friction == pytest.approx(friction.sum() * 0.002, abs=OF_SAMPLING * flows.taken)
    heat = (joints.effort[moving] / robot.gear_ratio) ** 2 @ robot.copper_loss
    assert flows.motors >= heat.sum() * 0.002 - OF_SAMPLING * flows.taken


def test_what_is_lifted_comes_down_again_on_the_path_home(analysis: Analysis) -> None:
    flows = energy_flows(analysis)
    assert flows is not None
    assert flows.lifted > 0.0
    assert flows.lowered > 0.0


def test_without_a_meter_there_are_no_flows_and_no_levers(analysis: Analysis) -> None:
    bare = analyse(replace(analysis.recording, power=None))
    assert energy_flows(bare) is None
    assert sankey_section(bare) == ""
    assert levers(bare) == ()


def test_a_meter_of_the_mains_alone_shows_no_flows(analysis: Analysis) -> None:
    power = analysis.recording.power
    assert power is not None
    alone = replace(power, joint_power=np.full_like(power.joint_power, np.nan))
    bare = analyse(replace(analysis.recording, power=alone))
    assert sankey_section(bare) == ""
    assert levers(bare) == ()


def test_levers_are_at_most_the_joules_of_the_run(analysis: Analysis) -> None:
    found = levers(analysis)
    program = analysis.program
    assert program is not None
    assert 1 <= len(found) <= 5
    assert all(0.0 < lever.joules <= program.whole.energy for lever in found)
    assert [lever.joules for lever in found] == sorted((x.joules for x in found), reverse=True)


@given(JOULES, JOULES, JOULES, JOULES, JOULES, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_every_node_gives_what_it_takes(
    base: float,
    tool: float,
    taken: float,
    lifted: float,
    resistor: float,
    back: float,
    lowered: float,
) -> None:
    returned = back * taken
    mains = base + tool + taken + resistor - returned
    flows = EnergyFlows(
        mains,
        base,
        tool,
        0.0,
        taken,
        returned,
        resistor,
        0.0,
        lifted * 0.01,
        lifted * 0.01 * lowered,
    )
    for node in ("DC link", "axes"):
        into = sum(value for _, to, value in rows(flows) if to in (node, f"back to the {node}"))
        out = sum(value for source, _, value in rows(flows) if source == node)
        assert into == pytest.approx(out, rel=1e-9, abs=1e-6 * mains)
    drawn = sankey(flows)
    assert drawn.startswith("<svg")
    assert "nan" not in drawn
    heights = [float(high) for high in re.findall(r'<rect[^>]* height="([\d.]+)"', drawn)]
    assert max(heights) <= TALL + 0.1


def test_what_bleed_resistors_take_is_not_counted_as_stored(analysis: Analysis) -> None:
    """A bus that falls while it is off, and is charged again from the mains at the end."""
    power = analysis.recording.power
    assert power is not None
    n = len(power.time)
    volts = np.full(n, 560.0)
    k = np.arange(n)
    fall = (k > n // 4) & (k < n // 2)
    volts[fall] *= np.exp(-np.linspace(0.0, 2.0, fall.sum()))
    mode = np.where(fall, int(Mode.BUS_POWER_OFF), power.mode)
    step = np.diff(power.time, prepend=power.time[:1])
    joules = 0.5 * 1.33e-3 * 560.0**2 * (1.0 - np.exp(-4.0))
    charged = power.power.copy()
    charged[n // 2] += joules / step[n // 2]
    recharged = replace(power, bus_voltage=volts, mode=mode, power=charged)
    kept = replace(power, bus_voltage=np.full(n, 560.0))
    whole = replace(analysis, steps=())
    flows = [
        energy_flows(replace(whole, recording=replace(analysis.recording, power=each)))
        for each in (recharged, kept)
    ]
    assert flows[0] is not None
    assert flows[1] is not None
    assert flows[0].bled == pytest.approx(joules, rel=1e-9)
    assert flows[1].bled == 0.0
    assert flows[0].stored == pytest.approx(flows[1].stored, abs=1e-6 * flows[1].mains)
