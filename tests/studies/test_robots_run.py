"""Two robots driven in one time by the program runner, judged by Coal on their joint values."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path as File

import numpy as np
import pytest

sys.path.append(str(File(__file__).parents[2] / "benchmarks"))  # the judge of the benchmark

from _robots_judge import Judge, Path

from ir_description import RobotCells, load_robot_cells
from ir_msgs_py.report import PlannedMovement
from ir_planner.robots import RobotsPlan, plan_robots
from ir_studies.errors import StudyError
from ir_studies.stepped_run import RobotRun, driven_robots

MARGIN = 0.02  # m: S_m
LOOK = 0.005  # s: 1 cm of the tools
SHARE = 0.01  # of joules
CYCLES = 2
DATA = File(__file__).parents[2] / "src/ir_description/ir_description/data"
CELL = DATA / "robot_cells/two_robots.yaml"


@cache
def cells() -> RobotCells:
    found = load_robot_cells("two_robots")
    assert found is not None
    return found


@cache
def plan() -> RobotsPlan:
    return plan_robots(cells(), cycle_time=10.0)


def programs() -> dict[str, tuple[PlannedMovement, ...]]:
    return {robot: plan().run(robot, CYCLES) for robot in plan().robots}


def driven(
    given: Mapping[str, Sequence[PlannedMovement]], late: Mapping[str, float] | None = None
) -> dict[str, RobotRun]:
    return driven_robots(cells().by_name, given, late=late, signal_timeout=30.0)


def nearest(runs: Mapping[str, RobotRun]) -> float:
    judge = Judge((cells().cells[0], cells().cells[1]))
    paths = [
        Path(
            np.array(run.times),
            np.array(run.postures),
            [(step.start - run.zero, step.movement.load) for step in run.steps],
        )
        for run in runs.values()
    ]
    return judge.least_recorded(paths, MARGIN, LOOK)[0]


def off(runs: Mapping[str, RobotRun]) -> float:
    """How far the tools were off their paths [m]."""
    return sum(run.deviation for run in runs.values())


def common_peak(runs: Mapping[str, RobotRun]) -> float:
    """The most that the robots need together [W], in steps of the plant."""
    grid = np.arange(0.0, min(run.times[-1] for run in runs.values()), LOOK)
    joules = sum((np.interp(grid, run.times, run.joules) for run in runs.values()), np.zeros(1))
    return float(np.diff(joules).max() / LOOK)


@cache
def limited() -> RobotsPlan:
    """A limit, and waits long enough to switch the drive bus off."""
    return plan_robots(cells(), cycle_time=90.0, peak_power=0.8 * plan().peak_power)


@pytest.mark.long
@pytest.mark.parametrize("late", [{}, {"left": 7.0}])
def test_a_limit_of_the_peak_holds_at_every_shift_and_where_robots_wake_up(
    late: dict[str, float],
) -> None:
    steps = [step for program in limited().programs for step in program.movements]
    assert any("BUS_POWER_OFF" in step.power_mode for step in steps)
    assert limited().peak_power <= 0.8 * plan().peak_power
    runs = driven({robot: limited().run(robot, 1) for robot in limited().robots}, late)
    assert common_peak(runs) <= limited().peak_power * (1.0 + SHARE)


@pytest.mark.long
def test_two_robots_need_what_was_planned_and_keep_apart_by_their_order() -> None:
    """They meet where the signals that keep the order are taken away: the judge sees it."""
    runs = driven(programs())
    joules = sum(step.joules for run in runs.values() for step in run.steps)
    assert joules == pytest.approx(CYCLES * plan().joules, rel=SHARE)
    assert nearest(runs) >= MARGIN - off(runs)
    assert common_peak(runs) <= plan().peak_power * (1.0 + SHARE)
    free = {
        robot: tuple(replace(step, wait_for=()) for step in plan().run(robot, 1))
        for robot in plan().robots
    }
    assert nearest(driven(free, {"right": 4.0})) < 0.0


@pytest.mark.long
@pytest.mark.parametrize("robot", ["left", "right"])
def test_a_late_robot_shifts_who_waits_for_it_and_they_keep_apart(robot: str) -> None:
    runs = driven(programs(), {robot: 3.0})
    assert nearest(runs) >= MARGIN - off(runs)
    assert max(run.times[-1] for run in runs.values()) < CYCLES * plan().period + 3.5


FEEDER = 20.0  # s until the next blank lies there


def fed_cells(folder: File) -> RobotCells:
    """The infeed brings the next blank when it is told that the last one was taken."""
    changes = {
        "floor: true\n": "floor: true\nsignals:\n  - {name: feed}\n"
        "  - {name: fed, follows: feed, process: infeed, initial: true}\n",
        "  - name: infeed\n": f"  - name: infeed\n    process: {{seconds: {FEEDER}}}\n",
        "infeed_pick, attach: gear,": "infeed_pick, attach: gear, wait_for: [fed], "
        "set_signals: [feed],",
    }
    text = CELL.read_text("utf-8")
    for before, after in changes.items():
        assert before in text
        text = text.replace(before, after, 1)
    path = folder / "fed.yaml"
    path.write_text(text)
    found = load_robot_cells(path)
    assert found is not None
    return found


@pytest.mark.long
def test_a_machine_of_one_robot_is_waited_for_and_never_too_early(tmp_path: File) -> None:
    several = fed_cells(tmp_path)
    fed = plan_robots(several)
    assert fed.fastest > FEEDER
    assert fed.certified
    given = {robot: fed.run(robot, 3) for robot in fed.robots}
    runs = driven_robots(several.by_name, given, signal_timeout=60.0)
    left = runs["left"]
    told = [s.end for s in left.steps if "feed" in " ".join(s.movement.set_signals)]
    gone = [s.start for s in left.steps if "fed" in " ".join(s.movement.wait_for)]
    assert len(told) == len(gone) == 3
    for earlier, later in zip(told, gone[1:], strict=False):
        assert later - earlier >= FEEDER - 0.01
    assert left.times[-1] == pytest.approx(3 * fed.period, rel=0.02)


@pytest.mark.long
def test_a_robot_whose_turn_never_comes_stands_and_says_so() -> None:
    right = tuple(replace(step, set_signals=()) for step in programs()["right"])
    silent = {**programs(), "right": right}
    with pytest.raises(StudyError, match=r"left: .*signal zone_1 did not come within 30 s"):
        driven(silent)
