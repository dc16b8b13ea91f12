"""A pause in, a power mode out: break-even figures of the data, and never a mode that costs more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import load_cell, load_power_data
from ir_msgs_py.transitions import TransitionTimes
from ir_planner.errors import RequestError
from ir_planner.program.standby import break_even, late_start, mode_watts, pause_energy, plan_standby
from ir_planner.scene.planning_scene import load_text, scene_with
from ir_sim_driver.controller.assembly import make_simulation
from ir_sim_driver.controller.settings import ControllerSettings, SimulationSettings

CELL = load_cell("demo")
POWER = load_power_data()
SCENE = scene_with(CELL, load_text(CELL), POWER)
EMPTY = replace(SCENE, loads=())
HOME = np.array(CELL.machine_home)
TIMES = TransitionTimes()


@pytest.mark.parametrize("payload", [0.0, 155.0])
def test_the_modes_draw_what_table_2_says(payload: float) -> None:
    scene = SCENE if payload else EMPTY
    for mode in POWER.modes:
        assert mode_watts(mode.name, HOME, scene) == pytest.approx(
            POWER.measured(payload, mode.name), rel=0.01
        )


def test_break_even_with_the_tool_alone_is_that_of_the_data() -> None:
    assert break_even("BUS_POWER_OFF", HOME, SCENE, TIMES) == pytest.approx(98.0, rel=0.005)
    assert break_even("HIBERNATION", HOME, SCENE, TIMES) == pytest.approx(1012.0, rel=0.005)


def test_times_default_to_those_of_the_controllers_data() -> None:
    for mode in POWER.modes[1:]:
        assert (TIMES.enter(mode.name), TIMES.leave(mode.name), TIMES.minimum_stay(mode.name)) == (
            mode.time_to_pause,
            mode.regular_time_to_operate,
            mode.minimum_stay,
        )


@given(st.floats(0.01, 5000.0))
@settings(deadline=None, max_examples=60)
def test_the_chosen_mode_is_the_cheapest_that_the_pause_has_time_for(pause: float) -> None:
    standby = plan_standby(pause, HOME, SCENE, TIMES)
    assert standby.energy == min(standby.energies)
    assert standby.saving == pytest.approx(
        pause_energy("STAND_ON_MOTORS", pause, HOME, SCENE, TIMES) - standby.energy
    )
    motors = mode_watts("STAND_ON_MOTORS", HOME, SCENE)
    assert standby.saving_on_motors == pytest.approx(motors * pause - standby.energy)
    assert pause >= standby.chosen.time_min_pause
    assert standby.wake_at + standby.chosen.regular_time_to_operate == pytest.approx(pause)


def test_longer_pauses_go_deeper() -> None:
    chosen = [plan_standby(pause, HOME, SCENE, TIMES).chosen.name for pause in (0.5, 10.0, 200.0, 3000.0)]
    assert chosen == ["STAND_ON_MOTORS", "STAND_ON_BRAKES", "BUS_POWER_OFF", "HIBERNATION"]


@pytest.mark.parametrize("pause", [0.0, -3.0, float("nan"), float("inf"), 1e9])
def test_what_is_no_pause_is_refused(pause: float) -> None:
    with pytest.raises(RequestError, match="pause is"):
        plan_standby(pause, HOME, SCENE, TIMES)


TIMER = POWER.motors_to_brakes_in_program


@pytest.mark.parametrize("pause", [1.0, TIMER - 0.5, TIMER + 0.1, TIMER + 0.8, TIMER + 5.0, 60.0])
def test_a_pause_that_the_controller_is_left_to_costs_what_the_driver_measures(pause: float) -> None:
    """The simulated controller stands, and after the pause a movement asks for motors."""
    start = SimulationSettings(controller=ControllerSettings(start_mode="STAND_ON_MOTORS"))
    simulation = make_simulation("demo", backend="ideal", settings=start, data=POWER)
    q = np.array(simulation.backend.q)
    simulation.run(pause)
    simulation.plc.set_bit("drives_on", True)  # what a movement asks for: motors
    late = 0.0
    while not simulation.modes.motors_on:
        simulation.run(0.01)
        late += 0.01
    simulation.mains.settle()
    measured = simulation.mains.meter.reading().energy
    assert late == pytest.approx(late_start(pause, SCENE, TIMES), abs=0.03)
    planned = pause_energy("STAND_ON_MOTORS", pause, q, SCENE, TIMES)
    assert planned == pytest.approx(measured, rel=0.03, abs=20.0)


def test_a_minute_is_not_spent_on_motors() -> None:
    """The controller's own timer is what a saving is held against."""
    standby = plan_standby(60.0, HOME, SCENE, TIMES)
    assert standby.chosen.name == "STAND_ON_BRAKES"
    assert standby.energies[0] < 0.7 * mode_watts("STAND_ON_MOTORS", HOME, SCENE) * 60.0
    assert standby.saving < 0.5 * standby.saving_on_motors
    assert "against the controller's own timer (brakes after 20 s" in standby.sentence
    assert "against standing on motors" in standby.sentence


@given(st.floats(0.5, 7200.0))
@settings(deadline=None, max_examples=60)
def test_no_sequence_of_two_modes_costs_less(pause: float) -> None:
    """Standing on motors first, or leaving and entering again, never pays."""
    best = plan_standby(pause, HOME, SCENE, TIMES).energy
    for share in (0.1, 0.3, 0.5, 0.9):
        split = [
            min(pause_energy(mode.name, part, HOME, SCENE, TIMES) for mode in POWER.modes)
            for part in (share * pause, (1.0 - share) * pause)
        ]
        assert best <= sum(split) + 1e-6
