"""The contract of a controller's power table: modes from shallow to deep, times, bits, measured
watts.
"""

from __future__ import annotations

import itertools
from importlib.resources import files

import numpy as np
import pytest

from ir_description import PowerData, load_power_data
from ir_msgs_py.modes import REST_MODES, Mode
from ir_planner import Planner
from ir_sim_driver.controller.settings import ControllerSettings, SimulationSettings
from ir_sim_driver.controller.simulation import make_simulation

FOLDER = files("ir_description") / "data" / "power"
CONTROLLERS = sorted(entry.name.removesuffix(".yaml") for entry in FOLDER.iterdir())
WATTS = 0.01  # of the mode's power: Table II is given in steps of 5 W
PAUSES = np.geomspace(1.0, 1e5, 40)  # s
ENTERING = 10.0  # s: the drive bus is off by then in a pause that rests so deep


@pytest.fixture(params=CONTROLLERS)
def power(request: pytest.FixtureRequest) -> PowerData:
    return load_power_data(request.param)


@pytest.fixture
def planner(power: PowerData) -> Planner:
    """A planner with these figures; its clock stands still."""
    return Planner("open", clock=itertools.repeat(0.0).__next__, power=power)


def test_its_modes_are_those_of_the_interface_from_shallow_to_deep(power: PowerData) -> None:
    assert [mode.name for mode in power.modes] == list(REST_MODES)
    watts = [mode.controller_watts for mode in power.modes]
    assert watts == sorted(watts, reverse=True)
    assert len({mode.pe_mode_id for mode in power.modes}) == len(power.modes)


def test_a_mode_is_worth_entering_only_when_the_pause_has_time_for_it(power: PowerData) -> None:
    for mode in power.modes:
        change = mode.time_to_pause + mode.regular_time_to_operate
        assert mode.time_min_pause >= change
        assert mode.name != "STAND_ON_MOTORS" or change == 0.0


def test_bits_that_exclude_each_other_do_so_mutually(power: PowerData) -> None:
    inputs = {bit.name: bit for bit in power.plc_inputs}
    assert len({bit.bit for bit in power.plc_inputs}) == len(power.plc_inputs)
    assert len({bit.bit for bit in power.plc_outputs}) == len(power.plc_outputs)
    for bit in power.plc_inputs:
        assert all(bit.name in inputs[other].excludes for other in bit.excludes)


def test_the_planner_draws_the_measured_watts(power: PowerData, planner: Planner) -> None:
    advice = planner.standby(10.0)
    drawn = {mode.name: mode.power for mode in advice.alternatives}
    payload = max(row.payload for row in power.table_2)
    for name in REST_MODES:
        assert drawn[name] == pytest.approx(power.measured(payload, name), rel=WATTS)


@pytest.mark.parametrize("mode", REST_MODES)
def test_the_plant_draws_the_measured_watts(power: PowerData, mode: str) -> None:
    settings = SimulationSettings(controller=ControllerSettings(start_mode=mode))
    simulation = make_simulation("open", backend="ideal", settings=settings, data=power)
    payload = max(row.payload for row in power.table_2)
    assert simulation.standing_power(Mode[mode]) == pytest.approx(
        power.measured(payload, mode), rel=WATTS
    )


def test_a_longer_pause_never_rests_shallower_and_costs_at_most_the_longer_rest(
    planner: Planner, power: PowerData
) -> None:
    """And what the DC link loses meanwhile, of which a mode with the drive bus off is charged."""
    before = planner.standby(float(PAUSES[0]))
    link = power.dc_link
    charge = link.capacitance * link.voltage**2  # J: half of it is stored, half lost in charging
    for shorter, longer in itertools.pairwise(PAUSES):
        now = planner.standby(float(longer))
        assert REST_MODES.index(now.chosen.name) >= REST_MODES.index(before.chosen.name)
        off = max(before.wake_at - ENTERING, 0.0)
        lost = charge * np.exp(-link.discharge_rate * off) if link.discharge_rate else 0.0
        assert now.energy <= before.energy + before.chosen.power * (longer - shorter) + lost + 1e-6
        assert 0.0 <= now.wake_at <= longer
        before = now
    assert before.chosen.name == REST_MODES[-1]
