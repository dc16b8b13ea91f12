"""A pause in, a power mode out: break-even figures of the data, and never a mode that costs
more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import load_cell, load_power_data
from ir_msgs_py.modes import REST_MODES, RestTimes, TransitionTimes, shortest_pause
from ir_planner.errors import RequestError
from ir_planner.program.pause_lengths import lengths_of
from ir_planner.program.rests import Rest, Rests, mode_watts, rests_at
from ir_planner.program.standby import break_even, plan_standby
from ir_planner.scene.planning_scene import load_text, scene_with
from ir_planner.waiting_postures import Trip, best_posture
from ir_sim_driver.controller.settings import ControllerSettings, SimulationSettings
from ir_sim_driver.controller.simulation import make_simulation

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
    assert break_even("BUS_POWER_OFF", HOME, SCENE, TIMES) == pytest.approx(99.8, abs=0.1)
    assert break_even("HIBERNATION", HOME, SCENE, TIMES) == pytest.approx(1012.1, abs=0.1)


HUNDREDTHS = st.integers(0, 2_000).map(lambda count: count / 100.0)  # s, as users write them


@given(HUNDREDTHS, HUNDREDTHS, HUNDREDTHS, st.sampled_from((3, 2)))
@settings(deadline=None, max_examples=200)
def test_a_pause_as_long_as_its_modes_need_can_be_spent_in_them(
    enter: float, stay: float, leave: float, count: int
) -> None:
    """By the planner's choice, by what is sent, and by the driver's."""
    times = RestTimes(enter, stay, leave)
    modes = tuple(Rest(name, 10.0, times, bus_off=True) for name in REST_MODES[1 : 1 + count])
    rests = Rests(1000.0, 1e9, modes)
    for chosen in (modes[-1:], modes):
        pause = shortest_pause([each.times for each in chosen])
        assert rests.in_time(chosen, pause) < np.inf
        longer = rests.in_time(chosen, pause + 1e-6)
        assert rests.in_time(chosen, pause) == pytest.approx(longer, abs=1e-4)  # at 10 W
        assert rests.in_time(chosen, pause - 1e-3) == np.inf


def test_a_controller_without_brakes_to_close_keeps_its_motors_on() -> None:
    bare = replace(
        POWER,
        modes=tuple(mode for mode in POWER.modes if mode.name != "STAND_ON_BRAKES"),
        table_2=(),
    )
    scene = scene_with(CELL, load_text(CELL), bare)
    for pause in (1.0, 60.0, 90.0, 3600.0):
        standby = plan_standby(pause, HOME, scene, TIMES)
        assert "STAND_ON_BRAKES" not in standby.modes
        assert standby.energy <= min(standby.energies)


def test_times_default_to_those_of_the_controllers_data() -> None:
    for mode in POWER.modes[1:]:
        assert (TIMES.enter(mode.name), TIMES.leave(mode.name), TIMES.minimum_stay(mode.name)) == (
            mode.time_to_pause,
            mode.regular_time_to_operate,
            mode.minimum_stay,
        )


@given(st.floats(0.01, 5000.0))
@settings(deadline=None, max_examples=60)
def test_no_mode_alone_costs_less_and_the_robot_is_ready_in_time(pause: float) -> None:
    standby = plan_standby(pause, HOME, SCENE, TIMES)
    assert standby.energy <= min(standby.energies)
    assert (standby.expected, standby.worst, standby.clairvoyant) == (standby.energy,) * 3
    assert standby.modes[-1] == standby.chosen.name
    assert list(standby.switch_times) == sorted(standby.switch_times)
    assert standby.saving == pytest.approx(
        rests_at(HOME, SCENE, TIMES).cost((), pause)[0] - standby.energy
    )
    motors = mode_watts("STAND_ON_MOTORS", HOME, SCENE)
    assert standby.saving_on_motors == pytest.approx(motors * pause - standby.energy)
    assert pause >= standby.chosen.time_min_pause
    assert standby.wake_at + standby.chosen.regular_time_to_operate == pytest.approx(pause)


def test_longer_pauses_go_deeper() -> None:
    chosen = [
        plan_standby(pause, HOME, SCENE, TIMES).chosen.name for pause in (0.5, 10.0, 200.0, 3000.0)
    ]
    assert chosen == ["STAND_ON_MOTORS", "STAND_ON_BRAKES", "BUS_POWER_OFF", "HIBERNATION"]


@pytest.mark.parametrize("pause", [0.0, -3.0, float("nan"), float("inf"), 1e9])
def test_what_is_no_pause_is_refused(pause: float) -> None:
    with pytest.raises(RequestError, match="pause is"):
        plan_standby(pause, HOME, SCENE, TIMES)


TIMER = POWER.motors_to_brakes_in_program


@pytest.mark.sampled
@pytest.mark.parametrize("pause", [1.0, TIMER - 0.5, TIMER + 0.1, TIMER + 0.8, TIMER + 5.0, 60.0])
def test_a_pause_that_the_controller_is_left_to_costs_what_the_driver_measures(
    pause: float,
) -> None:
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
    planned, planned_late = rests_at(q, SCENE, TIMES).cost((), pause)
    assert late == pytest.approx(planned_late, abs=0.03)
    assert planned == pytest.approx(measured, rel=0.03, abs=20.0)


def test_a_minute_is_not_spent_on_motors() -> None:
    """The controller's own timer is what a saving is held against."""
    standby = plan_standby(60.0, HOME, SCENE, TIMES)
    assert standby.chosen.name == "STAND_ON_BRAKES"
    assert standby.energies[0] < 0.7 * mode_watts("STAND_ON_MOTORS", HOME, SCENE) * 60.0
    assert standby.saving < 0.5 * standby.saving_on_motors
    assert "against the controller's own timer (brakes after 20 s" in standby.sentence
    assert "against standing on motors" in standby.sentence


def test_hibernation_is_entered_through_the_modes_before_it() -> None:
    """While a mode is entered the power is that of the mode before: a minute of it, not on
    motors.
    """
    standby = plan_standby(1800.0, HOME, SCENE, TIMES)
    assert standby.modes == ("STAND_ON_BRAKES", "BUS_POWER_OFF", "HIBERNATION")
    assert standby.switch_times == pytest.approx((0.0, 1.3, 6.3))
    motors = mode_watts("STAND_ON_MOTORS", HOME, SCENE)
    assert standby.energies[-1] - standby.energy > 0.5 * TIMES.enter("HIBERNATION") * motors


def test_where_to_wait_counts_moving_there_and_back() -> None:
    """On motors for a minute, so that holding torque matters: a posture that needs none is worth a
    trip.
    """
    times = replace(
        TIMES, stand_on_brakes_enter=500.0, bus_power_off_enter=500.0, hibernation_enter=500.0
    )
    scene = replace(SCENE, power=replace(POWER, motors_to_brakes_in_program=1e5))
    arm = np.radians([0.0, -20.0, 60.0, 0.0, 60.0, 0.0])
    watts = {
        name: mode_watts("STAND_ON_MOTORS", q, scene) for name, q in (("home", HOME), ("arm", arm))
    }
    assert watts["arm"] < watts["home"]
    pause = 60.0
    stays = watts["arm"] * 55.0
    there = (2.0, 900.0)
    back = (3.0, 1000.0)
    worth = watts["home"] * pause - stays
    for factor, best in ((0.9, "arm"), (1.1, "")):
        scaled = tuple(
            (seconds, joules * factor * worth / 1900.0) for seconds, joules in (there, back)
        )
        trips = (Trip("arm", arm, *scaled), Trip("lathe", HOME, problem="not free"))
        found = best_posture(lengths_of(pause), HOME, trips, scene, times)
        assert found.posture == best
        assert found.posture_energies == pytest.approx((stays + factor * worth, np.inf))
        assert found.energy == pytest.approx(min(found.posture_energies[0], watts["home"] * pause))
        assert "lathe is out of the question: not free" in found.sentence
