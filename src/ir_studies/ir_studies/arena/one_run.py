"""One run of an arena: a planner is asked for one task, with further seeds until its seconds end.

The cheapest answer counts. Seconds are processor time.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from ir_kernels.collision import FREE
from ir_msgs_py.options import ROBOTS_TIME_VALUE, PlanOptions
from ir_msgs_py.report import PlanningInfo, TrajectoryReport
from ir_planner import Goal, MovementPlan, Planner, PlannerError
from ir_planner.scene import PROOF_TOLERANCE, PlanningScene
from ir_planner.search.with_ompl import charge_to
from ir_studies.arena.settings import PORTFOLIO, ArenaEntry, ArenaSettings, read_by, tasks_of
from ir_studies.work import Row
from ir_studies.work.results import refuse_others

# Processor time of this process and of those in which OMPL answers it, without what it takes to
# start them: on a machine that others use too, seconds of the wall say who had to wait.
# A process that is forked for each request is how OMPL is made repeatable here, not what its
# planners need.

_SCHEDULED = 2  # Linux: the clock of a process counts what its threads ran
_running: dict[int, float] = {}  # s that each had run when it was last looked at
_ended = 0.0
_start = 0.0  # s of each process that count for nobody


def processor_time() -> float:
    """Seconds that this process has run, and those in which OMPL has answered it or does so now;
    for who asks from one thread.
    """
    return time.process_time() + others_time()


def others_time() -> float:
    """Of the same, the seconds of other processes alone."""
    return _ended + sum(map(_used, tuple(_running)))


def excuse(seconds: float) -> None:
    """From now on so many seconds of each process that is charged count for nobody."""
    global _start
    _start = seconds


@contextmanager
def charged(process: int) -> Iterator[None]:
    """Count a process for as long as this lasts."""
    global _ended
    _running[process] = 0.0
    try:
        yield
    finally:
        _ended += _used(process)
        del _running[process]


def _used(process: int) -> float:
    """Seconds that a process has run since it was started up; where it is gone, when it was last
    seen.
    """
    with suppress(OSError):
        _running[process] = max(time.clock_gettime((~process << 3) | _SCHEDULED) - _start, 0.0)
    return _running[process]


SEEDS = 100_000  # between the first requests of two seeds
# of the clearance at start and goal, where that is smaller than the safety distance
_SHARE_OF_ENDS = 0.8
# s that a request is left to end its last step: a descent and its proof take up to these
_LAST_STEP = 0.05


def one_run(
    entry: ArenaEntry, settings: ArenaSettings, planner: Planner, clock: Callable[[], float]
) -> Row:
    """Figures of the run: seconds, joules, metres; NaN where nothing was certified."""
    start, goal = tasks_of(planner.cell)[entry.task]
    scene = planner.scene(entry.load)
    own = settings.time_value == ROBOTS_TIME_VALUE
    price = scene.cell.robot.time_value if own else settings.time_value
    ends = np.stack([start, goal])
    margin = _margin(scene, ends, settings.safety_distance)
    best = None
    first_path = math.nan
    said = ""
    progress: list[list[float]] = []
    begin = clock()
    requests = 0
    truncated = False
    while True:
        passed = clock() - begin
        left = settings.seconds - passed
        if requests and (left <= 0.0 or requests == settings.requests):
            break
        options = _options(entry, settings, requests, left, margin)
        requests += 1
        try:
            plan = planner.plan_regional(
                start=start, goal=Goal(configuration=goal), options=options
            )
        except PlannerError as error:  # asked again, it would be refused again
            said = str(error)
            break
        truncated |= plan.info.truncated
        if math.isnan(first_path):
            first_path = passed + first_feasible(plan.info)
        if not (plan.status.ok and plan.report.certified):
            said = plan.status.message
            continue
        J = cost_of(plan.report, price)
        at = clock() - begin
        if at > settings.seconds:
            said = f"the answer came after {at:.3g} s, over seconds {settings.seconds:g}"
        elif best is None or cost_of(best.report, price) > J:
            best = plan
            progress.append([round(at, 6), J])
    row: Row = {
        "requests": requests,
        "truncated": truncated,
        "free_ptp": free_ptp(scene, ends, margin),
    }
    row |= {"safety_distance_m": margin, "first_path_s": first_path, "total_s": clock() - begin}
    return row | _figures(best, progress, price) | {"message": "" if best else said}


def _options(
    entry: ArenaEntry, settings: ArenaSettings, request: int, left: float, margin: float
) -> PlanOptions:
    """What a request of the run asks for, counted from 0, when so many seconds are left."""
    return PlanOptions(
        planner_id="" if entry.planner == PORTFOLIO else entry.planner,
        seed=entry.seed * SEEDS + request,
        max_iterations=settings.work_of(request),
        planning_time=planned_in(left),
        safety_distance=margin,
        time_value=settings.time_value,
        timing=entry.timing,
        load=entry.load,
    )


def planned_in(left: float) -> float:
    """How long a request may plan [s] so that it has answered when so many seconds more are
    over.
    """
    return max(left - min(_LAST_STEP, 0.5 * left), 0.001)


def _margin(scene: PlanningScene, ends: np.ndarray, safety_distance: float) -> float:
    nearest = float(scene.collision.min_distance(ends).distance.min())
    return max(min(safety_distance, _SHARE_OF_ENDS * nearest), 0.0)


def _figures(best: MovementPlan | None, progress: list[list[float]], time_value: float) -> Row:
    report = best.report if best is not None else TrajectoryReport()
    solved = best is not None and best.trajectory is not None
    return {
        "solved": solved,
        "first_s": progress[0][0] if solved else math.nan,
        "final_s": progress[-1][0] if solved else math.nan,
        "duration_s": report.duration if solved else math.nan,
        "energy_j": report.energy if solved else math.nan,
        "drives_j": report.energy - report.base_energy if solved else math.nan,
        "cost_j": cost_of(report, time_value) if solved else math.nan,
        "movement_cost": report.movement_cost if solved else math.nan,
        "clearance_m": report.min_clearance if solved else math.nan,
        "trajectory_id": best.trajectory.trajectory_id
        if best is not None and best.trajectory
        else "",
        "progress": progress,
    }


def cost_of(report: TrajectoryReport, time_value: float) -> float:
    """J [J]: energy of the drives without the base load, and the price of the time."""
    return report.energy - report.base_energy + time_value * report.duration


def free_ptp(scene: PlanningScene, ends: np.ndarray, margin: float) -> bool:
    """Whether the straight movement between the ends (2, n) is certified free: then nothing is
    searched.
    """
    threshold = scene.thresholds(margin) - PROOF_TOLERANCE / 2
    return bool(scene.collision.certify_edges(ends[:1], ends[1:], threshold).verdict[0] == FREE)


def first_feasible(info: PlanningInfo) -> float:
    """Seconds of a request until the first free path was known, as its stages say; NaN where none
    was.
    """
    passed = 0.0
    for stage in info.stages:
        passed += stage.seconds
        if stage.has_first_path:
            return passed
    return math.nan


# Cells, models and OMPL are loaded before the first run is timed.

_STARTS = 2  # looks at what it takes to start a process of OMPL, after the first, which loads it


def row_maker(settings: Mapping[str, Any]) -> Callable[[Mapping[str, Any]], Row]:
    """Rows of entries, with everything loaded that is loaded once; `read` of the settings: what
    must be the same here. StudyError where it is not.
    """
    read: dict[str, Any] = {  # JSON knows no tuples
        key: tuple(value) if isinstance(value, list) else value for key, value in settings.items()
    }
    given = read.pop("read", {})
    arena = ArenaSettings(**read)
    refuse_others(given, read_by(arena.cells) if given else {})
    charge_to(charged)
    excuse(0.0)
    warm_up(arena)
    few = replace(arena, cells=arena.cells[:1], loads=arena.loads[:1], tasks=())
    measured = [warm_up(few) for _ in range(_STARTS)]
    start = min((each for each in measured if each > 0.0), default=0.0)  # 0: it was not measured
    excuse(start)

    def row_of(words: Mapping[str, Any]) -> Row:
        entry = ArenaEntry(**words)
        return {**one_run(entry, arena, planner_of(entry.cell), processor_time), "start_s": start}

    return row_of


def warm_up(settings: ArenaSettings) -> float:
    """What is loaded once is loaded before anything is timed: cells, models with every load, OMPL.
    The least that a process of OMPL ran [s] for a question with next to nothing to check: what it
    takes to start one.
    """
    least = math.inf
    for cell in settings.cells:
        planner = planner_of(cell)
        start, there = next(iter(tasks_of(planner.cell).values()))
        goal = Goal(configuration=start + 1e-3 * (there - start))
        for load in settings.loads:
            for name in settings.planners:
                planner_id = "" if name == PORTFOLIO else name
                options = PlanOptions(
                    planner_id=planner_id,
                    max_iterations=10,
                    planning_time=120.0,
                    safety_distance=0.0,  # an end of a task may be near something
                    load=load,
                )
                begin = others_time()
                with suppress(PlannerError):
                    planner.plan_regional(start=start, goal=goal, options=options)
                if others_time() > begin:
                    least = min(least, others_time() - begin)
    return least if math.isfinite(least) else 0.0


@cache
def planner_of(cell: str) -> Planner:
    """One planner per cell."""
    return Planner(cell, clock=processor_time)
