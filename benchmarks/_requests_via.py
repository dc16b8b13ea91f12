"""One to four places that are passed on the way without a stop, in four cells of two robots.

The judge samples the answer 0.1 ms apart and looks for the places in their order. The peer stops at
each: the movements from place to place, each planned as a request of its own.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from _requests_rows import NOT_ASKED, Row
from _requests_toolspeed import CELLS, cost, drawn_states

from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner
from ir_values.arrays import FloatArray

TOLERANCES = (0.01, 0.05, 0.2)  # rad
SAMPLE_S = 1e-4
BETWEEN = 1e-3  # rad that a joint moves between samples at most
OBJECTIVES = ("time", "time_and_energy")


def _passes(trajectory: JointTrajectory, places: list[FloatArray], tolerance: float) -> bool:
    """Whether all places are passed, one after the other."""
    count = int(trajectory.duration / SAMPLE_S) + 2
    q = trajectory.sample(np.linspace(0.0, trajectory.duration, count)).q
    first = 0
    for place in places:
        near = np.flatnonzero(np.abs(q[first:] - place).max(axis=1) <= tolerance + BETWEEN)
        if len(near) == 0:
            return False
        first += int(near[0])
    return True


def rows(count: int) -> Iterator[Row]:
    """So many cases, a cell after the other."""
    planners = [Planner(cell) for cell in CELLS]
    for case in range(count):
        rng = np.random.default_rng([case, 12])
        planner = planners[case % len(CELLS)]
        states = drawn_states(planner, rng, int(rng.integers(3, 7)))
        tolerance = TOLERANCES[int(rng.integers(len(TOLERANCES)))]
        objective = OBJECTIVES[int(rng.integers(len(OBJECTIVES)))]
        began = time.process_time()
        plan = planner.plan_regional(
            start=states[0],
            goal=states[-1],
            via=states[1:-1],
            via_tolerance=tolerance,
            objective=objective,
        )
        seconds = time.process_time() - began
        legs = [
            planner.plan_regional(start=first, goal=second, objective=objective)
            for first, second in pairwise(states)
        ]
        stopped = all(leg.status.ok for leg in legs)
        name = f"{CELLS[case % len(CELLS)]}, {len(states) - 2} places, case {case}"
        if plan.trajectory is None:
            why = plan.status.message.split(":")[0][:80]
            yield Row(name, why, False, (), seconds, peer_only=stopped)
            continue
        wrong = []
        if not _passes(plan.trajectory, states[1:-1], tolerance):
            wrong.append("a place is missed")
        if np.abs(plan.trajectory.positions[-1] - states[-1]).max() > 1e-9:
            wrong.append("it ends elsewhere")
        lasting = sum(leg.report.duration for leg in legs)
        if stopped and objective == "time" and plan.report.duration > lasting + 1e-6:
            wrong.append("it takes longer than with stops")
        paid = sum(cost(leg.report, planner) for leg in legs) if stopped else NOT_ASKED
        yield Row(
            name,
            "",
            plan.report.certified,
            tuple(wrong),
            seconds,
            cost(plan.report, planner),
            paid,
        )
