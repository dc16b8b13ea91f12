"""Several robots planned together: certified for every timing that their signals admit, by a judge
that drives the programs with delays of its own and measures with Coal.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judge of the benchmark

from _robots_judge import Judge, drawn_cell, driven

from ir_description import RobotCells, cell_hash, load_robot_cells
from ir_msgs_py.options import PlanOptions
from ir_planner import RequestError
from ir_planner.program import ProgramRequest
from ir_planner.request import Journal
from ir_planner.robots import RobotsPlan, joint_plan, plan_robots
from ir_planner.robots.arm_program import ArmProgram, planned_arm

MARGIN = 0.02  # m: S_m
LITTLE = PlanOptions(max_iterations=3_000)  # movements a little dearer than the cheapest
TWO = Path(__file__).parents[2] / "src/ir_description/ir_description/data/robot_cells"
TEXT = (TWO / "two_robots.yaml").read_text("utf-8")


_arms: dict[str, ArmProgram] = {}


def arm_once(robot: str, request: ProgramRequest, journal: Journal) -> ArmProgram:
    """A program by itself depends on neither cycle time nor peak: it is planned once."""
    cell = request.cell
    key = f"{robot} {cell_hash(cell)} {cell.program} {request.start.tolist()} {request.options}"
    if key not in _arms:
        _arms[key] = planned_arm(robot, request, journal)
    return _arms[key]


def planned(cells: RobotCells, **asked: float) -> RobotsPlan:
    with patch.object(joint_plan, "planned_arm", arm_once):
        return plan_robots(cells, options=LITTLE, **asked)


def cells_of(folder: Path, text: str) -> RobotCells:
    path = folder / "cell.yaml"
    path.write_text(text)
    found = load_robot_cells(path)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def two() -> RobotCells:
    found = load_robot_cells("two_robots")
    assert found is not None
    return found


@pytest.fixture(scope="module")
def plan(two: RobotCells) -> RobotsPlan:
    return planned(two)


def nearest(plan: RobotsPlan, cells: RobotCells, seed: int, delay: float) -> float:
    judge = Judge((cells.cells[0], cells.cells[1]))
    return judge.least(driven(plan, np.random.default_rng(seed), 2, delay=delay), MARGIN)[0]


@pytest.mark.long
def test_two_robots_share_a_table_in_turns(plan: RobotsPlan) -> None:
    assert plan.certified
    (zone,) = plan.zones
    assert zone.first == "right"  # the table holds a blank when the programs begin
    assert zone.turn == "right"
    assert plan.joules < plan.full_speed
    assert 0.0 <= plan.gap < 5.0
    for program, begin in zip(plan.programs, plan.begins, strict=True):
        assert sum(step.duration for step in program.movements) == pytest.approx(
            plan.period, abs=1e-3
        )
        assert -plan.period < begin < plan.period


@pytest.mark.parametrize("delay", [0.0, 2.0])
def test_no_delay_of_a_signal_lets_them_meet(
    plan: RobotsPlan, two: RobotCells, delay: float
) -> None:
    assert nearest(plan, two, 5, delay) >= MARGIN - 1e-5


def test_without_the_signals_they_meet(plan: RobotsPlan, two: RobotCells) -> None:
    free = [
        replace(
            program,
            movements=tuple(
                replace(step, wait_for=(), set_signals=()) for step in program.movements
            ),
        )
        for program in plan.programs
    ]
    planted = replace(plan, programs=tuple(free))
    assert any(nearest(planted, two, seed, 4.0) < MARGIN for seed in (2, 3, 5))


def test_a_part_is_put_down_where_none_lies_and_taken_where_one_does(plan: RobotsPlan) -> None:
    for seed in range(20):
        pieces = driven(plan, np.random.default_rng(seed), 4, delay=3.0)
        handled = []
        for own in pieces:
            for piece in own:
                if piece.moving and piece.step.to_station == "table_seat":
                    at = piece.begin + piece.step.duration
                    handled += [(at, +1)] * (piece.step.detach != "")
                    handled += [(at, -1)] * (piece.step.attach != "")
        lying = 1 + np.cumsum([change for _, change in sorted(handled)])
        assert set(lying.tolist()) <= {0, 1}


def test_a_limit_of_the_peak_holds_at_every_shift(plan: RobotsPlan, two: RobotCells) -> None:
    limit = 0.75 * plan.peak_power
    limited = planned(two, cycle_time=14.0, peak_power=limit)
    assert limited.certified
    assert limited.peak_power <= limit
    peaks = [max(step.report.peak_power for step in p.movements) for p in limited.programs]
    assert sum(peaks) <= limit
    least = planned(two, peak_power=500.0)  # less than standing takes
    assert "needs more than its share of the peak" in least.status.message


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 3])
def test_drawn_robots_keep_apart(seed: int, tmp_path: Path) -> None:
    cells = cells_of(tmp_path, drawn_cell(seed))
    plan = planned(cells)
    assert plan.certified
    assert plan.zones
    assert nearest(plan, cells, seed, 0.7) >= MARGIN - 1e-5


@pytest.mark.long
def test_a_longer_cycle_costs_less_until_waiting_does_and_the_order_says_nothing(
    plan: RobotsPlan, two: RobotCells
) -> None:
    longer = planned(two, cycle_time=1.3 * plan.period)
    assert longer.period == pytest.approx(1.3 * plan.period, abs=1e-3)
    assert longer.joules < plan.joules
    turned = RobotCells(two.name, two.robots[::-1], two.cells[::-1])
    again = planned(turned, cycle_time=1.3 * plan.period)
    assert again.joules == pytest.approx(longer.joules, rel=1e-3)
    assert again.fastest == pytest.approx(longer.fastest, rel=1e-6)


@pytest.mark.long
def test_robots_out_of_reach_cost_the_sum_of_both(tmp_path: Path) -> None:
    far = cells_of(tmp_path, drawn_cell(3, (4.0, 5.0)))
    period = 6.0
    both = planned(far, cycle_time=period)
    assert both.zones == ()
    alone = [
        planned(RobotCells(far.name, (robot,), (cell,)), cycle_time=period).joules
        for robot, cell in zip(far.robots, far.cells, strict=True)
    ]
    assert both.joules == pytest.approx(sum(alone), rel=1e-4)


def test_too_short_a_cycle_is_refused_with_the_shortest(two: RobotCells) -> None:
    with pytest.raises(RequestError, match="cycle_time is 3 s: the shortest of all robots"):
        planned(two, cycle_time=3.0)


REFUSED = {
    "ends elsewhere": (
        "      - {station: outfeed_place, detach: gear, dwell: 0.5}\n      - {posture: park}\n",
        "      - {station: outfeed_place, detach: gear, dwell: 0.5}\n",
        "the program of right ends elsewhere than it begins",
    ),
    "waits for a machine": (
        "      - {station: table_seat, attach: gear, dwell: 0.5}\n",
        "      - {station: table_seat, attach: gear, wait_for: [ready]}\n",
        "step 1 of the program of right waits for ready, which follows nothing that this program",
    ),
    "ends with a part": (
        "{station: outfeed_place, detach: gear, dwell: 0.5}",
        "{station: outfeed_place, dwell: 0.5}",
        "the program of right ends with gear in the gripper",
    ),
    "stands still": (
        "      - {station: table_seat, attach: gear, dwell: 0.5}\n"
        "      - {station: outfeed_place, detach: gear, dwell: 0.5}\n      - {posture: park}\n",
        "      - {pause: 5}\n",
        "the program of right has no movement",
    ),
    "leaves what it takes again": (
        "      - {station: table_seat, detach: gear, dwell: 0.5}\n",
        "      - {station: table_seat, detach: gear, dwell: 0.5}\n      - {posture: park}\n"
        "      - {station: table_seat, attach: gear}\n"
        "      - {station: infeed_pick, detach: gear}\n",
        "table_seat holds one part.*left leaves gear, left takes gear, right takes gear",
    ),
    "a machine that works": (
        "    pose: {xyz: [1.9, 0, 0]}\n",
        "    pose: {xyz: [1.9, 0, 0]}\n    process: {seconds: 20}\n",
        "table has a process of 20 s, and nobody begins it and waits for its end",
    ),
    "a first wait without end": (
        "    program:\n      - {station: infeed_pick, attach: gear, dwell: 0.5}\n",
        "    program:\n      - {station: infeed_pick, attach: gear, wait_for: [done], "
        "set_signals: [ready]}\n",
        "step 1 of the program of left waits for done before the program sets ready",
    ),
    "a machine that changes": (
        "    pose: {xyz: [1.9, 0, 0]}\n",
        "    pose: {xyz: [1.9, 0, 0]}\n    states: {up: [], down: []}\n    state: up\n"
        "    switch: {signal: ready, on: up, off: down}\n",
        "step 1 of the program of left switches table by ready",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_makes_no_sense_is_refused_by_a_sentence(case: str, tmp_path: Path) -> None:
    before, after, sentence = REFUSED[case]
    text = TEXT.replace(
        "floor: true\n", "floor: true\nsignals: [{name: ready}, {name: done, follows: ready}]\n"
    )
    text = text.replace(before, after, 1)
    if "switch:" in after:
        text = text.replace("attach: gear, dwell: 0.5}", "attach: gear, set_signals: [ready]}", 1)
    with pytest.raises(RequestError, match=sentence):
        planned(cells_of(tmp_path, text))


@pytest.mark.long
def test_a_robot_in_the_way_wherever_it_waits_is_said(tmp_path: Path) -> None:
    near = TEXT.replace("home_deg: [45, -125, 120, 0, 80, 0]", "home_deg: [0, -60, 60, 0, 60, 0]")
    with pytest.raises(RequestError, match="waiting place"):
        planned(cells_of(tmp_path, near))


def test_a_station_holds_one_part_whatever_it_is_called(tmp_path: Path) -> None:
    begin = TEXT.index("  - name: gear\n")
    other = TEXT[begin : TEXT.index("equipment:\n")].replace("gear", "disc")
    other = other.replace("    station: infeed_pick\n", "")
    text = TEXT.replace("equipment:\n", other + "equipment:\n")
    at = text.index("  - name: right\n")
    right = text[at:].replace("gear", "disc")
    with pytest.raises(RequestError, match="left leaves gear, right takes disc"):
        planned(cells_of(tmp_path, text[:at] + right))


def test_a_robot_that_only_looks_keeps_clear_of_what_another_has_there(tmp_path: Path) -> None:
    at = TEXT.index("    starts:")
    looks = "    program:\n      - {station: table_seat}\n      - {posture: park}\n"
    with pytest.raises(RequestError, match="right comes too near to gear, which left has at"):
        planned(cells_of(tmp_path, TEXT[:at] + looks))
