"""Law: with a measured table by posture and load, planner, simulated plant and report draw the same
on motors and in every saving mode, at every posture and load, by the stated rule; without one
nothing changes.
"""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import Cell, Load, load_cell, load_power_data
from ir_description.files import power_from_yaml
from ir_description.robot import RestRow, RestTable
from ir_msgs_py.modes import Mode, TransitionTimes
from ir_msgs_py.options import PlanOptions
from ir_planner import Planner
from ir_planner.program.rests import mode_watts, rests_at
from ir_planner.program.standby import break_even, plan_standby
from ir_planner.scene.planning_scene import load_text, scene_with
from ir_recorder.analysis.predicted_power import resting_watts
from ir_sim_driver.controller.settings import ControllerSettings, SimulationSettings
from ir_sim_driver.controller.simulation import make_simulation
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError, RobotFileError

CELL = load_cell("demo")
POWER = load_power_data()
HOME = np.array(CELL.machine_home)
TIMES = TransitionTimes()
SAVING = ("STAND_ON_BRAKES", "BUS_POWER_OFF", "HIBERNATION")
MODES = ("STAND_ON_MOTORS", *SAVING)
TEXT = (files("ir_description") / "data" / "power" / "kr_c4.yaml").read_text(encoding="utf-8")


def by_the_rule(table: RestTable, mode: str, q: FloatArray, load: float) -> float:
    """The rule as it is stated, as arrays: the judge."""
    postures = np.array([row.posture for row in table.rows])
    loads = np.array([row.load for row in table.rows])
    watts = np.array([row.watts[table.modes.index(mode)] for row in table.rows])
    inside = np.clip(q, postures.min(axis=0), postures.max(axis=0))
    levels = np.unique(loads)
    at_levels = []
    for level in levels:
        own = loads == level
        distance = np.linalg.norm(postures[own] - inside, axis=1)
        if distance.min() == 0.0:
            at_levels.append(watts[own][distance == 0.0][0])
        else:
            at_levels.append(np.average(watts[own], weights=distance**-2.0))
    return float(np.interp(load, levels, at_levels))


@st.composite
def tables(draw: st.DrawFn) -> RestTable:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    levels = rng.uniform(0.0, 200.0, rng.integers(1, 4))
    rows = []
    for level in levels:
        for _ in range(rng.integers(1, 5)):
            motors = rng.uniform(50.0, 900.0)
            less = np.sort(rng.uniform(0.05, 1.0, 3))[::-1].tolist()
            watts = tuple(motors * share for share in (1.0, *less))
            rows.append(RestRow(tuple(rng.uniform(-2.0, 2.0, 6).tolist()), float(level), watts))
    table = RestTable(MODES, tuple(rows))
    return table if draw(st.booleans()) else without_motors(table)


def without_motors(table: RestTable) -> RestTable:
    """The saving modes of a table."""
    return RestTable(SAVING, tuple(replace(row, watts=row.watts[1:]) for row in table.rows))


def with_load(kilograms: float) -> Cell:
    """The demonstration with a tool of that mass, watts and all."""
    tool = CELL.tool
    assert tool is not None
    heavy: Load = replace(tool, mass=kilograms, inertia=tool.inertia * kilograms / tool.mass)
    return replace(CELL, tool=heavy)


@settings(max_examples=25, deadline=None)
@given(
    table=tables(),
    angles=st.lists(st.floats(-1.2, 1.2), min_size=6, max_size=6),
    kilograms=st.floats(1.0, 190.0),
    data=st.data(),
)
def test_planner_plant_and_report_draw_what_the_table_says(
    table: RestTable, angles: list[float], kilograms: float, data: st.DataObject
) -> None:
    cell = with_load(kilograms)
    power = replace(POWER, rest_table=table)
    q = HOME + 0.3 * np.array(angles)
    scene = scene_with(cell, load_text(cell), power)
    mode = data.draw(st.sampled_from(table.modes))
    expected = by_the_rule(table, mode, q, kilograms)
    assert mode_watts(mode, q, scene) == pytest.approx(expected, rel=1e-9)
    assert resting_watts(mode, q, cell, scene.loads, power) == pytest.approx(expected, rel=1e-9)
    start = SimulationSettings(controller=ControllerSettings(start_mode=mode))
    simulation = make_simulation(cell, backend="ideal", settings=start, data=power)
    simulation.backend.reset(q)
    simulation.executor.hold(q)
    before = simulation.mains.energy()
    simulation.run(0.5)
    assert (simulation.mains.energy() - before) / 0.5 == pytest.approx(expected, rel=1e-9)
    assert simulation.standing_power(Mode[mode]) == pytest.approx(expected, rel=1e-9)
    answer = plan_standby(3600.0, q, scene, TIMES)
    drawn = {each.name: each.power for each in answer.alternatives}
    assert drawn[mode] == pytest.approx(expected, rel=1e-9)
    lowest = min(row.watts[table.modes.index(mode)] for row in table.rows)
    highest = max(row.watts[table.modes.index(mode)] for row in table.rows)
    assert lowest - 1e-9 <= expected <= highest + 1e-9
    beyond = table.outside(q.tolist(), kilograms)
    assert ("outside of them" in answer.sentence) == bool(beyond)


@settings(max_examples=25, deadline=None)
@given(table=tables(), angles=st.lists(st.floats(-2.5, 2.5), min_size=6, max_size=6))
def test_break_even_is_where_two_modes_cost_the_same(table: RestTable, angles: list[float]) -> None:
    q = np.array(angles)
    scene = scene_with(CELL, load_text(CELL), replace(POWER, rest_table=table))
    timer = replace(scene.power, motors_to_brakes_in_program=1e6)
    scene = replace(scene, power=timer)
    for shallower, deeper in pairwise(SAVING):
        pause = break_even(deeper, q, scene, TIMES)
        if not np.isfinite(pause) or pause > 1e6:
            continue
        rests = rests_at(q, scene, TIMES)
        both = [rests.in_time((rests.named(mode),), pause) for mode in (shallower, deeper)]
        shortest = TIMES.enter(deeper) + TIMES.minimum_stay(deeper) + TIMES.leave(deeper)
        if pause > shortest:
            assert both[0] == pytest.approx(both[1], rel=1e-9)
        else:
            assert both[1] <= both[0] * (1.0 + 1e-9)


def test_a_row_is_met_exactly_and_between_loads_it_is_linear() -> None:
    posture = tuple(HOME.tolist())
    rows = (
        RestRow(posture, 0.0, (420.0, 135.0, 115.0, 15.0)),
        RestRow(posture, 155.0, (735.0, 325.0, 205.0, 105.0)),
    )
    table = RestTable(MODES, rows)
    for row in rows:
        for mode, watts in zip(MODES, row.watts, strict=True):
            assert table.watts(mode, row.posture, row.load) == watts
            assert watts == POWER.measured(row.load, mode)
    assert table.watts("HIBERNATION", posture, 77.5) == pytest.approx(60.0)
    assert table.watts("HIBERNATION", posture, 300.0) == 105.0
    assert "load 300 kg (measured 0 to 155)" in table.outside(posture, 300.0)
    assert "joint 1 at 1 rad" in table.outside((1.0, *posture[1:]), 0.0)


ROWS = """
rests:
  - {posture_deg: [0, -90, 90, 0, 0, 0], load_kg: 0, watts: {STAND_ON_BRAKES: 140, HIBERNATION: 20}}
  - {posture_deg: [0, -45, 45, 0, 0, 0], load_kg: 0, watts: {STAND_ON_BRAKES: 150, HIBERNATION: 20}}
"""


def test_a_power_file_holds_the_rows() -> None:
    table = power_from_yaml(TEXT + ROWS).rest_table
    assert table is not None
    assert table.modes == ("STAND_ON_BRAKES", "HIBERNATION")
    assert table.rows[1].posture[1] == pytest.approx(np.radians(-45.0))
    assert power_from_yaml(TEXT).rest_table is None


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("STAND_ON_BRAKES: 150", "STAND_ON_MOTORS: 700, STAND_ON_BRAKES: 150", "STAND_ON_MOTORS"),
        ("STAND_ON_BRAKES: 150", "BUS_POWER_OFF: 150", "STAND_ON_BRAKES"),
        (
            "[0, -45, 45, 0, 0, 0]",
            "[0, -90, 90, 0, 0, 0]",
            "row 1 of the table of rests stands there twice",
        ),
        ("[0, -45, 45, 0, 0, 0]", "[0, -45, 45, 0, 0]", "row 1 of the table of rests has 5 joints"),
        (
            "load_kg: 0, watts: {STAND_ON_BRAKES: 150",
            "load_kg: -1, watts: {STAND_ON_BRAKES: 150",
            "load_kg",
        ),
        ("STAND_ON_BRAKES: 140, HIBERNATION: 20", "STANDING: 140", "STANDING"),
        ("{STAND_ON_BRAKES: 140, HIBERNATION: 20}", "{}", "names no mode"),
    ],
)
def test_rows_that_are_none_are_refused_by_their_place(old: str, new: str, words: str) -> None:
    with pytest.raises(RobotFileError, match=words):
        power_from_yaml(TEXT + ROWS.replace(old, new, 1))


def test_a_table_of_another_robot_is_refused() -> None:
    table = RestTable(SAVING, (RestRow((0.0,) * 7, 0.0, (3.0, 2.0, 1.0)),))
    with pytest.raises(InvalidValueError, match="postures of 7 joints, the robot has 6"):
        replace(CELL.robot, controller=replace(POWER, rest_table=table))


def test_without_a_table_the_answer_is_as_ever_and_says_so() -> None:
    scene = scene_with(CELL, load_text(CELL), POWER)
    for mode in SAVING:
        known = POWER.mode(mode).controller_watts + scene.tool_watts(
            drive_bus=mode == "STAND_ON_BRAKES"
        )
        assert mode_watts(mode, HOME + 0.5, scene) == known
    assert (
        "no table by posture and load was measured"
        in plan_standby(60.0, HOME, scene, TIMES).sentence
    )


@pytest.mark.long
def test_a_program_that_rests_beyond_the_table_says_where() -> None:
    row = RestRow(tuple((HOME + 0.1).tolist()), 500.0, (200.0, 100.0, 50.0))
    power = replace(POWER, rest_table=RestTable(SAVING, (row,)))
    robot = replace(CELL.robot, controller=power)
    plan = Planner(replace(CELL, robot=robot)).plan_program(
        options=PlanOptions(seed=1, max_iterations=1_500)
    )
    pauses = [step for step in plan.movements if step.is_pause and step.power_mode]
    assert pauses
    assert "outside of them" in plan.status.message
