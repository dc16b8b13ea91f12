"""The power modes: every transition takes its time, and none happens that isn't in the table."""

from __future__ import annotations

import pytest

from ir_msgs_py.modes import ROW, Mode, TransitionTimes
from ir_sim_driver.errors import SettingsError
from ir_sim_driver.power import Demand, IdleTimes, PowerModes
from ir_sim_driver.power.power_modes import NO_DEMAND

DT = 0.001
STEP = DT * 1.5  # a demand counts from the next step on
TIMES = TransitionTimes(), IdleTimes()


def run(modes, seconds, demand=NO_DEMAND):
    for _ in range(round(seconds / DT)):
        modes.step(DT, demand)


def time_until(modes, mode, demand=NO_DEMAND, limit=400.0):
    steps = 0
    while modes.mode is not mode:
        modes.step(DT, demand)
        steps += 1
        assert steps * DT < limit, f"{mode.name} was not reached, the mode is {modes.mode.name}"
    return steps * DT


@pytest.mark.parametrize(
    ("rest", "enter", "stay", "leave"),
    [
        (Mode.STAND_ON_BRAKES, 0.3, 1.0, 0.7),
        (Mode.BUS_POWER_OFF, 3.0, 2.0, 20.0),
    ],
)
def test_a_rest_is_entered_kept_and_left_in_its_times(rest, enter, stay, leave):
    modes = PowerModes(*TIMES)
    assert time_until(modes, rest, Demand(rest=rest)) == pytest.approx(enter, abs=2 * STEP)
    back = Demand(rest=Mode.STAND_ON_MOTORS)
    assert time_until(modes, ROW[rest].leaving, back) == pytest.approx(stay, abs=STEP)
    assert modes.time_to_target == pytest.approx(leave)
    assert time_until(modes, Mode.STAND_ON_MOTORS, back) == pytest.approx(leave, abs=STEP)


def test_only_a_packet_ends_hibernation_and_one_is_enough():
    modes = PowerModes(*TIMES)
    assert time_until(modes, Mode.HIBERNATION, Demand(rest=Mode.HIBERNATION)) == pytest.approx(
        60.0, abs=2 * STEP
    )
    run(modes, 130.0, Demand(rest=Mode.STAND_ON_MOTORS, motion=True, recover=True))
    assert modes.mode is Mode.HIBERNATION
    modes.step(DT, Demand(wake=True))
    assert modes.mode is Mode.FROM_HIBERNATION
    assert time_until(modes, Mode.STAND_ON_MOTORS) == pytest.approx(120.0, abs=STEP)


def test_a_packet_before_the_shortest_sleep_is_over_wakes_when_it_is():
    modes = PowerModes(*TIMES, Mode.HIBERNATION)
    modes.step(DT, Demand(wake=True))
    assert modes.mode is Mode.HIBERNATION
    assert time_until(modes, Mode.FROM_HIBERNATION) == pytest.approx(120.0, abs=2 * STEP)


def test_a_packet_while_hibernation_is_entered_is_lost():
    modes = PowerModes(*TIMES)
    run(modes, 1.0, Demand(rest=Mode.HIBERNATION))
    run(modes, 1.0, Demand(rest=Mode.HIBERNATION, wake=True))
    time_until(modes, Mode.HIBERNATION)
    run(modes, 200.0)
    assert modes.mode is Mode.HIBERNATION


@pytest.mark.parametrize(("manual", "idle"), [(False, 20.0), (True, 10.0)])
def test_brakes_close_after_the_controllers_own_timer(manual, idle):
    modes = PowerModes(*TIMES)
    assert time_until(modes, Mode.TO_BRAKES, Demand(manual=manual)) == pytest.approx(idle, abs=STEP)


def test_a_movement_opens_the_brakes():
    modes = PowerModes(*TIMES, Mode.STAND_ON_BRAKES)
    waiting = Demand(motion=True)
    assert time_until(modes, Mode.FROM_BRAKES, waiting) == pytest.approx(1.0, abs=STEP)
    assert time_until(modes, Mode.STAND_ON_MOTORS, waiting) == pytest.approx(0.7, abs=STEP)
    modes.step(DT, Demand(motion=True, standing=False))
    assert modes.mode is Mode.MOVING
    modes.step(DT, NO_DEMAND)
    assert modes.mode is Mode.STAND_ON_MOTORS


def test_a_rest_is_never_entered_while_the_robot_moves():
    modes = PowerModes(*TIMES)
    run(modes, 1.0, Demand(rest=Mode.BUS_POWER_OFF, motion=True, standing=False))
    assert modes.mode is Mode.MOVING
    run(modes, 0.002, Demand(rest=Mode.BUS_POWER_OFF))
    assert modes.mode is Mode.TO_BUS_POWER_OFF


def test_deeper_rests_are_reached_from_shallower_ones():
    modes = PowerModes(*TIMES, Mode.STAND_ON_BRAKES)
    time_until(modes, Mode.TO_BUS_POWER_OFF, Demand(rest=Mode.BUS_POWER_OFF))
    assert modes.level is Mode.STAND_ON_BRAKES  # the power of the mode that is left
    time_until(modes, Mode.BUS_POWER_OFF, Demand(rest=Mode.BUS_POWER_OFF))
    time_until(modes, Mode.TO_HIBERNATION, Demand(rest=Mode.HIBERNATION))
    assert modes.level is Mode.BUS_POWER_OFF


def test_emergency_stop_ends_only_by_recover_and_only_at_rest():
    modes = PowerModes(*TIMES)
    modes.step(DT, Demand(motion=True, standing=False, emergency=True))
    assert modes.mode is Mode.EMERGENCY_STOP
    run(modes, 1.0, Demand(emergency=True, recover=True))
    run(modes, 1.0, Demand(motion=True))
    run(modes, 1.0, Demand(recover=True, standing=False))
    assert modes.mode is Mode.EMERGENCY_STOP
    assert time_until(modes, Mode.STAND_ON_MOTORS, Demand(recover=True)) == pytest.approx(
        0.7, abs=2 * STEP
    )


def test_an_emergency_stop_that_is_pressed_while_the_bus_comes_up_counts():
    modes = PowerModes(*TIMES)
    time_until(modes, Mode.BUS_POWER_OFF, Demand(rest=Mode.BUS_POWER_OFF))
    time_until(modes, Mode.FROM_BUS_POWER_OFF)
    time_until(modes, Mode.EMERGENCY_STOP, Demand(emergency=True))


def test_a_cold_start_takes_as_long_as_waking():
    modes = PowerModes(*TIMES)
    modes.step(DT, Demand(restart=True))
    assert modes.mode is Mode.FROM_HIBERNATION
    assert time_until(modes, Mode.STAND_ON_MOTORS) == pytest.approx(120.0, abs=STEP)


def test_time_to_ready_is_what_it_then_takes():
    modes = PowerModes(*TIMES)
    run(modes, 1.0, Demand(rest=Mode.BUS_POWER_OFF))
    announced = modes.time_to_ready()
    assert time_until(modes, Mode.STAND_ON_MOTORS) == pytest.approx(announced, abs=2 * STEP)


def test_a_start_in_the_middle_of_something_is_refused():
    with pytest.raises(SettingsError, match="MOVING"):
        PowerModes(*TIMES, Mode.MOVING)
