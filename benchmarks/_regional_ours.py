"""Runs of the planner: what a regional movement costs and how long it took."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

from _regional_tasks import TIME_VALUE, Cost, Task

from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import PlanningInfo
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.planner import Planner
from ir_planner.request.goals import Goal

PLANNING_TIME = 1.0  # s
FIRST = "first feasible"  # how the note of the stage begins that knew the first free path
NOTHING = "nothing free"


@dataclass(frozen=True, eq=False)
class Run:
    """One answer: solved means found and certified; times in ms; clearance [m]."""

    seed: int
    solved: bool
    truncated: bool
    first_ms: float
    final_ms: float
    cost: Cost | None
    clearance: float
    trajectory: JointTrajectory | None
    message: str

    @property
    def trajectory_id(self) -> str:
        """Of the trajectory, "" without one."""
        return self.trajectory.trajectory_id if self.trajectory is not None else ""


def asked(task: Task, seed: int = 0) -> PlanOptions:
    """The request's options: J as the objective."""
    return PlanOptions(
        seed=seed, safety_distance=task.margin, planning_time=PLANNING_TIME, time_value=TIME_VALUE
    )


def first_feasible(info: PlanningInfo) -> float:
    """Seconds until the first free path was known, as the stages say it.

    Without a note of it: until the first stage had ended that didn't come back with nothing.
    """
    for says in (lambda note: note.startswith(FIRST), lambda note: not note.startswith(NOTHING)):
        passed = 0.0
        for stage in info.stages:
            passed += stage.seconds
            if says(stage.note):
                return passed
    return float("nan")


def run(planner: Planner, task: Task, options: PlanOptions) -> Run:
    """Ask once; the time is that of the whole call."""
    begin = time.perf_counter()
    plan = planner.plan_regional(
        start=task.start, goal=Goal(configuration=task.goal), options=options
    )
    took = time.perf_counter() - begin
    report = plan.report
    solved = plan.status.ok and report.certified
    return Run(
        options.seed,
        solved,
        plan.info.truncated,
        1e3 * first_feasible(plan.info),
        1e3 * took,
        Cost.of(report.energy - report.base_energy, report.duration) if solved else None,
        report.min_clearance,
        plan.trajectory,
        plan.status.message,
    )


def runs(planner: Planner, task: Task, seeds: int) -> list[Run]:
    """Seeds 0 .. N-1, after one answer that isn't counted."""
    run(planner, task, asked(task))
    return [run(planner, task, asked(task, seed)) for seed in range(seeds)]


def until(planner: Planner, task: Task, seconds: float, iterations: int) -> Iterator[Cost]:
    """Costs of answers with a large budget and one seed after the other, until the time is up."""
    end = time.perf_counter() + seconds
    seed = 1000
    while (left := end - time.perf_counter()) > 0.0:
        options = replace(
            asked(task, seed), planning_time=max(left, 0.05), max_iterations=iterations
        )
        found = run(planner, task, options)
        if found.cost is not None:
            yield found.cost
        seed += 1
