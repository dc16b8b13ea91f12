"""Law: with current and voltage as bounds, eq. (8), no planned torque needs more current than the
drive gives, nor more voltage than the DC link has.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ir_description import load_cell
from ir_msgs_py.options import PlanOptions
from ir_planner import Goal, Planner
from ir_planner.errors import RequestError
from ir_planner.scene.actuators import LinkVoltage, within_current_and_voltage
from ir_planner.settings import PlannerSettings
from ir_values.arrays import FloatArray

CELLS = ("open", "kr6_bench", "ur10e_bench")
ROBOTS = {name: load_cell(name).robot for name in CELLS}
START = np.array([0.0, -1.6, 1.6, 0.0, 0.3, 0.0])
GOAL = np.array([1.3, -1.0, 1.0, 0.5, -0.3, 1.0])


def available(cell: str, voltage: float, speed: FloatArray) -> FloatArray:
    """Torque (n,) of the envelope at joint speeds (n,), as it is defined."""
    robot = ROBOTS[cell]
    nominal = robot.controller.dc_link.voltage
    bounded = within_current_and_voltage(robot, LinkVoltage(nominal, voltage))
    found = []
    for v, speeds, torque in zip(
        speed, bounded.envelope_speed, bounded.envelope_torque, strict=True
    ):
        found.append(torque[0] if v < speeds[0] else np.interp(v, speeds, torque[1:]))
    return np.array(found)


def phase_voltage(cell: str, torque: FloatArray, speed: FloatArray) -> FloatArray:
    """Of motors (n,) that drive, by the phasors of a synchronous motor; the judge."""
    robot = ROBOTS[cell]
    nominal = robot.controller.dc_link.voltage
    ratio = np.abs(robot.gear_ratio)
    motor = ratio * speed
    full = ratio * robot.velocity_max
    emf = 0.9 * nominal / np.sqrt(6.0) / full  # V s/rad: 0.9 of the nominal voltage at full speed
    torque_constant = 3.0 * emf
    ampere = torque / ratio / torque_constant
    ohm = robot.copper_loss * torque_constant**2 / 3.0
    end = ratio * robot.envelope_speed[:, -1]
    last = robot.envelope_torque[:, -1] / ratio / torque_constant
    reactance = np.sqrt(nominal**2 / 6.0 - (emf * end + ohm * last) ** 2) / last / end
    return np.abs(emf * motor + (ohm + 1j * reactance * motor) * ampere)


@settings(max_examples=60, deadline=None)
@given(
    cell=st.sampled_from(CELLS),
    high=st.floats(0.94, 1.3),
    shares=st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6),
)
@example(cell="kr6_bench", high=1.01171875, shares=[0.0, 0.0, 0.0, 0.0, 0.0, 0.83984375])
def test_the_torque_that_is_left_needs_no_more_current_and_voltage(
    cell: str, high: float, shares: list[float]
) -> None:
    robot = ROBOTS[cell]
    voltage = high * robot.controller.dc_link.voltage
    speed = np.array(shares) * robot.envelope_speed[:, -1]
    torque = available(cell, voltage, speed)
    assert (torque <= robot.envelope_torque[:, 0] * (1.0 + 1e-9)).all()
    needed = phase_voltage(cell, torque, speed)
    assert (needed <= voltage / np.sqrt(6.0) * (1.0 + 1e-9)).all()
    more = phase_voltage(cell, 1.03 * torque, speed)
    at_the_peak = 1.03 * torque >= robot.envelope_torque[:, 0]
    assert ((more >= voltage / np.sqrt(6.0)) | at_the_peak).all()  # nor is torque given away
    assert (available(cell, 1.02 * voltage, speed) >= torque * (1.0 - 0.02)).all()


@pytest.mark.parametrize("cell", CELLS)
def test_at_the_nominal_voltage_it_ends_where_the_data_end(cell: str) -> None:
    robot = ROBOTS[cell]
    nominal = robot.controller.dc_link.voltage
    torque = available(cell, nominal, robot.envelope_speed[:, -1])
    assert torque == pytest.approx(robot.envelope_torque[:, -1], rel=0.03)


def test_a_plan_keeps_the_bound_that_is_asked_for() -> None:
    answers = {}
    for limits, voltage in (
        ("envelope", 0.0),
        ("current_voltage", 0.0),
        ("current_voltage", 530.0),
    ):
        chosen = PlannerSettings(torque_limits=limits, dc_voltage=voltage)
        planner = Planner("open", settings=chosen)
        options = PlanOptions(objective="time", seed=1)
        found = planner.plan_regional(start=START, goal=Goal(configuration=GOAL), options=options)
        assert found.status.ok, found.status.message
        assert found.report.certified
        trajectory = found.trajectory
        assert trajectory is not None
        answers[limits, voltage] = found.report.duration
        if limits == "envelope":
            continue
        motion = trajectory.sample(np.linspace(0.0, trajectory.duration, 400))
        torque = planner.scene().dynamics.inverse_dynamics(motion.q, motion.qd, motion.qdd)
        peak = (1.0 - chosen.torque_reserve) * ROBOTS["open"].envelope_torque[:, 0]
        assert (np.abs(torque) <= peak + 1e-6).all()
        driving = torque * motion.qd > 0.0
        for one, speed, drives in zip(torque, motion.qd, driving, strict=True):
            needed = phase_voltage("open", np.abs(one), np.abs(speed))
            assert (needed[drives] <= (voltage or 560.0) / np.sqrt(6.0) + 1e-6).all()
    assert answers["current_voltage", 530.0] >= answers["current_voltage", 0.0] - 1e-3


def test_a_voltage_that_does_not_reach_full_speed_is_refused() -> None:
    planner = Planner(
        "open", settings=PlannerSettings(torque_limits="current_voltage", dc_voltage=400.0)
    )
    with pytest.raises(RequestError, match=r"400 V does not turn \w+ at its full speed.*at least"):
        planner.scene().dynamics  # noqa: B018
