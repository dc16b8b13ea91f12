"""One run: a planner is asked for one task, with other seeds until its seconds are over; the best
counts.

All are treated alike: what a planner finds is simplified, optimised, timed and proved by the same
code. Who answers quickly is asked more often, who can use more work for a better answer gets it.
Seconds are those of processors, also where another process answers.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ir_kernels.collision import FREE
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import PlanningInfo, TrajectoryReport
from ir_planner import Goal, MovementPlan, Planner, PlannerError
from ir_planner.scene import PROOF_TOLERANCE, PlanningScene
from ir_studies.arena.entries import Entry
from ir_studies.arena.settings import PORTFOLIO, ArenaSettings
from ir_studies.arena.tasks import tasks_of
from ir_studies.work import Row

SEEDS = 100_000  # between the first requests of two seeds
_SHARE_OF_ENDS = (
    0.8  # of the clearance at start and goal, where that is smaller than the safety distance
)
_LAST_STEP = (
    0.05  # s that a request is left to end its last step: a descent and its proof take up to these
)
_FIRST = "first feasible"  # how the note of the stage begins that knew the first free path


def one_run(
    entry: Entry, settings: ArenaSettings, planner: Planner, clock: Callable[[], float]
) -> Row:
    """Figures of the run: seconds, joules, metres; NaN where nothing was certified."""
    start, goal = tasks_of(planner.cell)[entry.task]
    scene = planner.scene(entry.load)
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
            plan = planner.plan_regional(start, Goal(configuration=goal), options)
        except PlannerError as error:  # asked again, it would be refused again
            said = str(error)
            break
        truncated |= plan.info.truncated
        if math.isnan(first_path):
            first_path = passed + first_feasible(plan.info)
        if not (plan.status.ok and plan.report.certified):
            said = plan.status.message
            continue
        J = cost_of(plan.report, settings.time_value)
        at = clock() - begin
        if at > settings.seconds:
            said = f"the answer came after {at:.3g} s, over seconds {settings.seconds:g}"
        elif best is None or cost_of(best.report, settings.time_value) > J:
            best = plan
            progress.append([round(at, 6), J])
    row: Row = {
        "requests": requests,
        "truncated": truncated,
        "free_ptp": free_ptp(scene, ends, margin),
    }
    row |= {"safety_distance_m": margin, "first_path_s": first_path, "total_s": clock() - begin}
    return row | _figures(best, progress, settings.time_value) | {"message": "" if best else said}


def _options(
    entry: Entry, settings: ArenaSettings, request: int, left: float, margin: float
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
        if stage.note.startswith(_FIRST):
            return passed
    return math.nan
