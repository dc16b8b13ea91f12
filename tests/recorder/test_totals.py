"""Totals of the program, and the cycle with its pauses at full length."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from ir_description import load_cell, load_power_data
from ir_msgs_py.modes import TransitionTimes, drive_bus_up
from ir_planner import Planner
from ir_planner.program.rests import rests_at
from ir_recorder import Analysis, analyse
from ir_recorder.analysis.analyse import unshortened_cycle
from ir_recorder.analysis.predicted_power import BrakeTimer, pause_joules

# W with the 155 kg gripper, Table II at machine home
MOTORS = 735.0
BUS_OFF = 205.0
BRAKES = 325.0  # W
# s until the controller closes the brakes; closing and opening
TIMER = 20.0
CLOSING = 0.3
BRAKING = 1.0
CHANGE = 23.0  # s into Bus Power Off and back, by the data


def test_movements_pauses_and_waiting_are_the_whole_program(analysis: Analysis) -> None:
    program = analysis.program
    assert program is not None
    parts = (program.movements, program.pauses, program.waiting)
    assert sum(part.energy for part in parts) == pytest.approx(program.whole.energy)
    assert sum(part.seconds for part in parts) == pytest.approx(program.whole.seconds)
    assert program.planned_pauses.energy == pytest.approx(program.pauses.energy, rel=0.01)


def test_the_full_cycle_costs_what_its_pauses_are_longer(analysis: Analysis) -> None:
    """Both pauses of the run at 600 s: the posture is not home, so motors on cost a little more or
    less.
    """
    facts = (("unshortened_pauses", "600 s, 600 s"),)
    program = analyse(replace(analysis.recording, facts=facts)).program
    assert program is not None
    full = program.unshortened
    assert full is not None
    standing = analysis.steps[2]
    resting = analysis.steps[3]
    assert full.seconds == pytest.approx(
        program.whole.seconds + 1200.0 - standing.seconds - resting.seconds
    )
    more = full.energy - program.whole.energy + standing.energy + resting.energy
    motors = standing.motors_power
    assert motors == pytest.approx(MOTORS, rel=0.3)
    left_alone = motors * (TIMER + BRAKING) + BRAKES * (600.0 - TIMER - CLOSING)
    charged = load_power_data().dc_link.recharge(600.0 - CHANGE)
    assert more == pytest.approx(
        left_alone + motors * CHANGE + BUS_OFF * (600.0 - CHANGE) + charged, rel=1e-6
    )


@pytest.mark.parametrize("seconds", [1.0, 19.0, 20.5, 22.0, 30.0, 180.0, 1800.0])
def test_full_pauses_are_predicted_as_the_planner_predicts_them(seconds: float) -> None:
    """What a recording adds to shortened pauses is what a plan of full ones would say."""
    cell = load_cell("demo")
    data = cell.robot.controller
    scene = Planner(cell).scene("none")
    rests = rests_at(cell.machine_home, scene, TransitionTimes())
    watts = {rest.name: rest.watts for rest in rests.modes}
    alone = BrakeTimer.of(data).joules(rests.motors, watts["STAND_ON_BRAKES"], seconds)
    assert alone == pytest.approx(rests.cost((), seconds)[0])
    for rest in rests.modes:
        change = rest.times.enter + rest.times.leave
        planned = rests.in_time((rest,), seconds)
        if np.isfinite(planned):
            own = pause_joules(rest.watts, rests.motors, seconds, change)
            own += 0.0 if drive_bus_up(rest.name) else data.dc_link.recharge(seconds - change)
            assert own == pytest.approx(planned)


def test_a_run_that_does_not_match_has_no_computed_cycle(analysis: Analysis) -> None:
    facts = (("unshortened_pauses", "600 s"),)
    program = analyse(replace(analysis.recording, facts=facts)).program
    assert program is not None
    assert program.unshortened is not None
    assert program.unshortened.energy != program.unshortened.energy  # not a number


def test_without_the_fact_nothing_is_shortened(analysis: Analysis) -> None:
    assert analysis.program is not None
    assert analysis.program.unshortened is None


def test_a_pause_of_several_modes_lasts_longer_in_its_last_one() -> None:
    """200 s through the brakes to the bus' rest took 60 kJ; 500 s more are spent there, at 205
    W.
    """
    movement = SimpleNamespace(
        is_pause=True,
        power_mode="STAND_ON_BRAKES>BUS_POWER_OFF",
        duration=200.0,
        report=SimpleNamespace(energy=60_000.0),
    )
    step = SimpleNamespace(movement=movement, start=0.0, end=200.0)
    pause = SimpleNamespace(step=step, seconds=200.0, energy=60_000.0)
    meter = SimpleNamespace(energy=lambda start, end: 60_000.0)
    watts = {"STAND_ON_MOTORS": MOTORS, "STAND_ON_BRAKES": BRAKES, "BUS_POWER_OFF": BUS_OFF}
    full = unshortened_cycle(
        cast(Any, [pause]),
        "700 s",
        lambda mode: CHANGE,
        lambda seconds: 0.0,
        BrakeTimer(TIMER, 0.7, CHANGE - 0.7, 1.0),
        lambda mode, result: watts[mode],
        lambda mode, result: np.zeros(1),
        cast(Any, meter),
    )
    assert full is not None
    assert full.energy == pytest.approx(60_000.0 + 500.0 * BUS_OFF)
