"""The least J that any method finds for a task when it has longer than a request has."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from itertools import cycle

from _regional_ompl import PLANNERS, OmplPath, ompl_path
from _regional_ours import asked, until
from _regional_tasks import Cost, Task
from _regional_toppra import timed

from ir_planner.errors import RequestError
from ir_planner.planner import Planner
from ir_planner.trajectories.through_points import Reference

ITERATIONS = 2_000_000  # certified edges: more than a minute holds


def best_of(planner: Planner, task: Task, seconds: float) -> dict[str, Cost]:
    """The cheapest movement of each method that found one within `seconds` each."""
    methods: dict[str, Callable[[], Iterator[Cost]]] = {
        "planner": lambda: until(planner, task, seconds, ITERATIONS),
        "OMPL": lambda: (cost for _, cost in _ompl(task, seconds)),
        "planner through OMPL's path": lambda: _followed(planner, task, seconds),
    }
    found = {}
    for name, method in methods.items():
        costs = list(method())
        if costs:
            found[name] = min(costs, key=lambda cost: cost.J)
    return found


def _ompl(task: Task, seconds: float) -> Iterator[tuple[OmplPath, Cost]]:
    """OMPL's planners in turn, each path with its time."""
    end = time.perf_counter() + seconds
    for name in cycle(PLANNERS):
        left = end - time.perf_counter()
        if left <= 0.0:
            return
        path = ompl_path(task, name, min(left, 10.0))
        done = timed(path, task) if path is not None else None
        if path is not None and done is not None:
            yield path, done[1]


def _followed(planner: Planner, task: Task, seconds: float) -> Iterator[Cost]:
    """OMPL's paths driven by the planner: half of the time finds paths, half drives the cheapest of
    them.
    """
    paths = sorted(_ompl(task, 0.5 * seconds), key=lambda found: found[1].J)
    end = time.perf_counter() + 0.5 * seconds
    for path, _ in paths:
        if time.perf_counter() > end:
            return
        try:
            followed = planner.plan_trajectory(Reference(path.corners), options=asked(task))
            if followed.trajectory is None:
                continue
            plan = planner.optimize_trajectory(followed.trajectory, options=asked(task))
        except RequestError:
            continue
        if plan.status.ok and plan.after.certified:
            yield Cost.of(plan.after.energy - plan.after.base_energy, plan.after.duration)
