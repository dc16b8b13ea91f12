"""PROFIenergy on the simulated controller, and when a rest pays."""

from __future__ import annotations

import pytest

from ir_description import load_power_data
from ir_msgs_py.modes import Mode
from ir_msgs_py.plc import OperatingMode
from ir_sim_driver.controller.settings import ControllerSettings
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.power import IdleTimes, charging_of
from ir_sim_driver.power.profienergy import energy_of

CHARGING = charging_of(load_power_data().dc_link)


def by_mode(simulation):
    return {mode.mode: mode for mode in simulation.pauses.query_modes()}


def test_times_and_numbers_are_those_of_the_controller(make):
    modes = by_mode(make())
    bus = modes[Mode.BUS_POWER_OFF]
    assert (bus.time_to_pause, bus.regular_time_to_operate, bus.time_min_length_of_stay) == (
        3.0,
        20.0,
        2.0,
    )
    assert bus.time_min_pause == 25.0
    assert modes[Mode.HIBERNATION].time_min_pause == 300.0
    assert [mode.pe_mode_id for mode in modes.values()] == [0xFF, 0x01, 0x02, 0xFE]


@pytest.mark.parametrize(
    ("start_mode", "bus_power_off", "hibernation"),
    [("STAND_ON_MOTORS", 99.8, 1012.1), ("STAND_ON_BRAKES", 90.4, 778.4)],
)
def test_break_even_of_the_tool_of_table_2(make, start_mode, bus_power_off, hibernation):
    simulation = make(controller=ControllerSettings(start_mode=start_mode))
    modes = by_mode(simulation)
    assert modes[Mode.BUS_POWER_OFF].break_even == pytest.approx(bus_power_off, abs=0.1)
    assert modes[Mode.HIBERNATION].break_even == pytest.approx(hibernation, abs=0.1)


@pytest.mark.parametrize(
    ("pause", "mode"),
    [(1.0, 0), (1.9, 0), (5.0, 2), (99.0, 2), (100.5, 3), (1011.0, 3), (1013.0, 4)],
)
def test_the_energies_of_the_table_say_which_mode_takes_least(make, pause, mode):
    table = make().pauses.query_modes()
    fitting = [each for each in table if pause >= each.time_min_pause]
    assert min(fitting, key=lambda each: energy_of(each, pause, CHARGING)).mode == mode


def test_a_mode_costs_what_query_modes_said(make):
    simulation = make()
    simulation.run(0.01)
    bus = by_mode(simulation)[Mode.BUS_POWER_OFF]
    before = simulation.mains.meter.reading()
    simulation.plc.set_bit("ab", True)
    simulation.run(80.0)
    assert simulation.modes.mode is Mode.BUS_POWER_OFF
    simulation.plc.set_bit("ab", False)
    simulation.run(20.1)
    after = simulation.mains.meter.reading()
    assert simulation.modes.mode is Mode.STAND_ON_MOTORS
    assert after.energy - before.energy == pytest.approx(
        energy_of(bus, after.time - before.time, CHARGING), rel=5e-3
    )


def test_a_pause_goes_through_the_modes_that_make_it_cheaper(make):
    """Each is entered at the power of the one before."""
    simulation = make()
    chosen = simulation.pauses.start(2000.0, executing=False)
    assert chosen.mode is Mode.HIBERNATION
    seen = []
    for _ in range(700):
        if simulation.modes.mode not in seen[-1:]:
            seen.append(simulation.modes.mode)
        simulation.run(0.1)
    assert seen == [
        Mode.STAND_ON_MOTORS,
        Mode.TO_BRAKES,
        Mode.STAND_ON_BRAKES,
        Mode.TO_BUS_POWER_OFF,
        Mode.BUS_POWER_OFF,
        Mode.TO_HIBERNATION,
        Mode.HIBERNATION,
    ]


def test_a_pause_that_lasts_longer_goes_deeper_and_never_back(make):
    simulation = make()
    assert simulation.pauses.start(60.0, executing=False).mode is Mode.STAND_ON_BRAKES
    simulation.run(5.0)
    assert simulation.modes.mode is Mode.STAND_ON_BRAKES
    assert simulation.pauses.start(300.0, executing=False).mode is Mode.BUS_POWER_OFF
    simulation.run(5.0)
    assert simulation.modes.mode is Mode.BUS_POWER_OFF
    assert simulation.pauses.start(3.0, executing=False).mode is Mode.BUS_POWER_OFF
    assert simulation.pauses.start(5000.0, executing=False).mode is Mode.HIBERNATION
    simulation.run(1.0)
    assert simulation.modes.mode is Mode.TO_HIBERNATION


def test_ending_a_pause_early_finishes_the_shortest_stay(make):
    simulation = make()
    simulation.pauses.start(200.0, executing=False)
    simulation.run(4.4)  # on brakes for 1.3 s, then into bus power off
    announced = simulation.control.end_pause()
    assert announced == pytest.approx(1.9 + 20.0, abs=0.01)
    simulation.run(announced + 0.01)
    assert simulation.modes.mode is Mode.STAND_ON_MOTORS


@pytest.mark.parametrize("pause", [float("nan"), float("inf"), 0.0, -1.0, 604_801.0, 1e30])
def test_a_pause_of_no_length_or_beyond_a_week_is_refused(make, pause):
    with pytest.raises(RequestRefusedError, match=r"pause is .* s: it must be in \(0, 604800\] s"):
        make().pauses.start(pause, executing=False)


def test_a_pause_is_refused_outside_ext_beside_power_bits_and_in_motion(make):
    simulation = make()
    with pytest.raises(RequestRefusedError, match="executing"):
        simulation.pauses.start(10.0, executing=True)
    simulation.plc.set_operating_mode(OperatingMode.AUT)
    with pytest.raises(RequestRefusedError, match="AUT"):
        simulation.pauses.start(10.0, executing=False)
    simulation.plc.set_operating_mode(OperatingMode.EXT)
    simulation.plc.set_bit("ab", True)
    simulation.run(0.05)
    with pytest.raises(RequestRefusedError, match="power bit"):
        simulation.pauses.start(10.0, executing=False)


def test_the_brake_timer_runs_again_after_a_pause_that_was_ended_on_motors(make):
    simulation = make(idle=IdleTimes(motors_to_brakes_in_program=0.5))
    simulation.control.end_pause()
    simulation.run(0.9)
    assert simulation.modes.mode is Mode.STAND_ON_BRAKES


def test_a_pause_begins_where_the_controller_has_gone_by_itself(make):
    simulation = make()
    simulation.run(25.0)
    assert simulation.modes.mode is Mode.STAND_ON_BRAKES
    assert simulation.pauses.start(60.0, executing=False).mode is Mode.STAND_ON_BRAKES
    assert simulation.pauses.rest is Mode.STAND_ON_BRAKES
