"""The contract of the table `ir_msgs_py.modes`, for each power mode to rest in."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import pytest

from ir_description import Cell, cell_from_yaml, load_cell, load_power_data
from ir_msgs.msg import PowerMode
from ir_msgs_py.modes import MODES, RESTS, Mode, ModeRow, TransitionTimes
from ir_msgs_py.plc import PlcInputs
from ir_planner import Planner
from ir_planner.program.rests import mode_watts
from ir_planner.scene.planning_scene import load_text, scene_with
from ir_recorder.analysis.predicted_power import resting_watts
from ir_recorder.report.picture import MODE_COLOURS
from ir_sim_driver.controller.settings import ControllerSettings, SimulationSettings
from ir_sim_driver.controller.simulation import make_simulation

ROOT = Path(__file__).resolve().parents[2]
STYLE = ROOT / "src" / "ir_recorder" / "ir_recorder" / "report" / "assets" / "page.css"
CELL = """
format: ir_cell/1
name: resting
robot: kr210_r2700_extra
program:
  - {{pause: 600.0, power_mode: {mode}}}
"""


@pytest.fixture(params=MODES, ids=lambda row: row.mode.name)
def row(request: pytest.FixtureRequest) -> ModeRow:
    found: ModeRow = request.param
    return found


def test_the_message_has_its_numbers(row: ModeRow) -> None:
    for mode in (row.mode, row.entering, row.leaving):
        assert getattr(PowerMode, mode.name) == mode


def test_it_has_times_and_a_shortest_stay(row: ModeRow) -> None:
    times = TransitionTimes()
    name = row.mode.name
    least = times.enter(name) + times.minimum_stay(name) + times.leave(name)
    assert (least > 0.0) == (row in RESTS)
    assert times.of(row.mode).time_min_pause == least


def test_the_controllers_data_has_its_watts_and_its_number(row: ModeRow) -> None:
    figures = load_power_data().mode(row.mode.name)
    assert figures.controller_watts > 0.0
    assert figures.pe_mode_id > 0


def test_its_bit_is_an_input_that_a_plc_can_set(row: ModeRow) -> None:
    if row.bit:
        assert getattr(PlcInputs().with_bit(row.bit, True), row.bit)
        assert row.bit in {bit.name.lower() for bit in load_power_data().plc_inputs}


def test_a_program_may_rest_in_it_and_the_planner_knows_what_that_costs(row: ModeRow) -> None:
    cell = cell_from_yaml(CELL.format(mode=row.mode.name))
    assert cell.program[0].power_mode == row.mode.name
    planner = Planner(clock=itertools.repeat(0.0).__next__)
    planner.set_cell(text=CELL.format(mode=row.mode.name))
    alternatives = planner.standby(600.0).alternatives
    assert row.mode in {mode.mode for mode in alternatives}


def test_the_plant_rests_in_it_as_the_row_says(row: ModeRow) -> None:
    controller = ControllerSettings(start_mode=row.mode.name)
    simulation = make_simulation(
        "open", backend="ideal", settings=SimulationSettings(controller=controller)
    )
    if row.bit:
        simulation.plc.rest = row.mode
    simulation.run(0.1)
    assert simulation.modes.mode is row.mode
    assert simulation.on_the_network == row.on_the_network
    before = simulation.mains.meter.reading()
    simulation.run(0.2)
    after = simulation.mains.meter.reading()
    watts = (after.energy - before.energy) / (after.time - before.time)
    assert watts == pytest.approx(simulation.standing_power(row.mode), rel=1e-6)


def with_bus_watts(watts: float) -> Cell:
    """The demonstration with a tool that draws so many watts while the drive bus is up."""
    cell = load_cell("demo")
    assert cell.tool is not None
    return replace(cell, tool=replace(cell.tool, watts_drive_bus=watts))


def plant_watts(cell: Cell, row: ModeRow) -> float:
    """What the meter of an ideal plant reads in a mode at machine home."""
    controller = ControllerSettings(start_mode=row.mode.name)
    simulation = make_simulation(
        cell, backend="ideal", settings=SimulationSettings(controller=controller)
    )
    if row.bit:
        simulation.plc.rest = row.mode
    before = simulation.mains.energy()
    simulation.run(0.5)
    return (simulation.mains.energy() - before) / 0.5


@pytest.mark.parametrize("watts", [0.0, 73.0])
def test_planner_driver_and_report_give_a_load_its_bus_watts_alike(
    row: ModeRow, watts: float
) -> None:
    power = load_power_data()
    cell = with_bus_watts(watts)
    scene = scene_with(cell, load_text(cell), power)
    home = cell.machine_home
    planned = mode_watts(row.mode.name, home, scene)
    assert plant_watts(cell, row) == pytest.approx(planned, rel=1e-9)
    assert resting_watts(row.mode.name, home, cell, scene.loads, power) == pytest.approx(planned)
    without = scene_with(with_bus_watts(0.0), load_text(cell), power)
    more = planned - mode_watts(row.mode.name, home, without)
    awake = row.mode in (Mode.STAND_ON_MOTORS, Mode.STAND_ON_BRAKES)  # Table II of the paper
    assert more == pytest.approx(watts if awake else 0.0, abs=1e-9)


def test_the_report_has_a_colour_for_it(row: ModeRow) -> None:
    assert row.mode.name in MODE_COLOURS
    assert f".m-{row.mode.name} " in STYLE.read_text("utf-8")


def test_a_row_that_is_forgotten_elsewhere_is_noticed() -> None:
    forgotten = MODES[-1]._replace(bit="nap")
    with pytest.raises(ValueError, match="nap"):
        test_its_bit_is_an_input_that_a_plc_can_set(forgotten)
