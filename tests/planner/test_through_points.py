"""Law: a movement through its points without given times costs no more, by the objective, than the
straight movements between them with a stop at each; it passes all of them and is certified.

Judges: the movements of pairs of points, and samples at 10 kHz.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from ir_msgs_py.report import TrajectoryReport
from ir_planner import Planner, Reference, RequestError
from ir_values.arrays import FloatArray

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judge of limits
from _second_opinion import SecondOpinion

CELLS = ("open", "kr6_bench", "ur10e_bench")
OBJECTIVES = ("time", "time_and_energy", "energy")
PASSED = 1e-3  # rad, what dense points are passed within
ROUNDED = 1e-6  # relative: durations are whole nanoseconds


@pytest.fixture(scope="module")
def planners() -> dict[str, Planner]:
    return {name: Planner(name, clock=lambda: 0.0) for name in CELLS}


def drawn_points(planner: Planner, draw: np.random.Generator) -> FloatArray:
    """Free points around home, some of them turning back in some joints."""
    home = np.array(planner.cell.machine_home)
    points = [home]
    count = int(draw.integers(3, 7))
    while len(points) < count:
        moving = draw.random(len(home)) < draw.choice([0.2, 1.0])
        q = home + draw.uniform(-0.6, 0.6, len(home)) * moving
        if np.abs(q - points[-1]).max() > 0.01 and planner.check_state(q=q).valid:
            points.append(q)
    if draw.random() < 0.4:
        points.append(points[-2])
    return np.array(points)


def cost(report: TrajectoryReport, planner: Planner, objective: str) -> float:
    joules = report.energy - report.base_energy
    if objective == "time_and_energy":
        return joules + planner.cell.robot.time_value * report.duration
    return report.duration if objective == "time" else joules


@pytest.mark.parametrize(
    ("cell", "seeds"),
    [
        ("open", range(1)),
        ("kr6_bench", range(4)),
        *(
            pytest.param(cell, seeds, marks=pytest.mark.long)
            for cell, seeds in (
                ("open", range(1, 30)),
                ("kr6_bench", range(4, 30)),
                ("ur10e_bench", range(30)),
            )
        ),
    ],
)
def test_points_cost_no_more_than_stopping_at_each(
    planners: dict[str, Planner], cell: str, seeds: range
) -> None:
    planner = planners[cell]
    second = SecondOpinion(planner.scene())
    judged = 0
    for seed in seeds:
        draw = np.random.default_rng([seed, 33])
        points = drawn_points(planner, draw)
        objective = OBJECTIVES[seed % len(OBJECTIVES)]
        legs = [
            planner.plan_trajectory(reference=Reference(np.array(pair)), objective=objective)
            for pair in pairwise(points)
        ]
        if not all(leg.status.ok for leg in legs):
            continue
        plan = planner.plan_trajectory(reference=Reference(points), objective=objective)
        assert plan.status.ok, plan.status
        stops = sum(cost(leg.report, planner, objective) for leg in legs)
        assert cost(plan.report, planner, objective) <= stops * (1.0 + ROUNDED)
        assert second.largest_share(plan.trajectory) <= 1.0 + 1e-6
        q = plan.trajectory.sample(np.arange(0.0, plan.report.duration, 1e-4)).q
        first = 0
        for point in points:
            near = np.flatnonzero(np.abs(q[first:] - point).max(axis=1) < PASSED)
            assert len(near)
            first += int(near[0])
        judged += 1
    assert judged > 0


def test_a_duration_that_stopping_keeps_is_not_refused(planners: dict[str, Planner]) -> None:
    planner = planners["open"]
    home = np.array(planner.cell.machine_home)
    there = home + np.eye(6)[0] * 0.6
    reference = Reference(np.array([home, there, home]))
    shortest = planner.plan_trajectory(reference=reference, objective="time").report.duration
    plan = planner.plan_trajectory(reference=reference, duration=1.1 * shortest)
    assert plan.report.duration == pytest.approx(1.1 * shortest, rel=1e-5)
    with pytest.raises(RequestError, match="shortest"):
        planner.plan_trajectory(reference=reference, duration=0.5 * shortest)
