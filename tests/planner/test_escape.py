"""Law: from a start too near to something, in it or beyond a limit a way leads out on which nothing
gets worse, at no instant and for no pair.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from ir_description.robot import OUTSIDE_MAX
from ir_msgs_py.status import StatusCode
from ir_planner import EscapePlan, Planner, RequestError
from ir_planner.regional.escape import DEEPER

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judge
from _coal_model import Coal
from _second_opinion import SecondOpinion

MARGIN = 0.02  # m
CELLS = ("demo", "table_columns", "deep_box", "kr6_bench")
_DEEPEST = 0.12  # m below what a pair must keep
_ROUNDED = 2e-5  # m between two codes in penetration
_INSTANTS = 300


@pytest.fixture(
    scope="module",
    params=[CELLS[0], *(pytest.param(cell, marks=pytest.mark.long) for cell in CELLS[1:])],
)
def planner(request: pytest.FixtureRequest) -> Planner:
    return Planner(request.param, clock=lambda: 0.0)


def starts(planner: Planner, seed: int, count: int) -> list[np.ndarray]:
    """Drawn configurations that are too near to something, every third beyond a limit."""
    draw = np.random.default_rng(seed)
    robot = planner.cell.robot
    scene = planner.scene()
    kept = scene.thresholds(MARGIN)
    found: list[np.ndarray] = []
    while len(found) < count:
        q = draw.uniform(robot.position_min, robot.position_max)
        if len(found) % 3 == 0:
            joint = draw.integers(robot.n)
            q[joint] = robot.position_max[joint] + draw.uniform(1e-6, 0.1)
        short = (kept - scene.collision.distances(q[None])[0]).max()
        if 0.0 < short < _DEEPEST:
            found.append(q)
    return found


def judged(planner: Planner, start: np.ndarray, plan: EscapePlan) -> None:
    scene = planner.scene()
    loads = [capsule for load in scene.loads for capsule in load.capsules]
    judge = Coal(scene.collision, [*scene.cell.robot.capsules, *loads], scene.cell.bodies())
    judge.precise()
    trajectory = plan.trajectory
    assert trajectory is not None
    assert np.abs(trajectory.positions[0] - start).max() <= 1e-9
    q = trajectory.sample(np.linspace(0.0, trajectory.duration, _INSTANTS)).q
    distances = np.array([judge.distances(one) for one in q])
    least = np.minimum(scene.thresholds(MARGIN), distances[0] - DEEPER) - _ROUNDED
    assert (distances >= least).all(), "no pair gets nearer than it was, nor below what it keeps"
    assert (distances[-1] > scene.thresholds(MARGIN) - _ROUNDED).all()
    robot = planner.cell.robot
    low = np.minimum(robot.position_min, start) - 1e-9
    high = np.maximum(robot.position_max, start) + 1e-9
    assert ((q >= low) & (q <= high)).all()
    assert ((q[-1] >= robot.position_min) & (q[-1] <= robot.position_max)).all()
    beyond = np.maximum(q - robot.position_max, robot.position_min - q).clip(0.0)
    assert np.diff(beyond, axis=0).max() <= 1e-9, "no joint goes farther beyond its limit"
    inside = q[(beyond == 0.0).all(axis=1)]
    shares = np.abs(trajectory.velocities) / robot.velocity_max
    assert shares.max() <= 0.1 + 1e-9, "slowly"
    assert len(inside)


@pytest.mark.parametrize("seeds", [range(1), pytest.param(range(1, 12), marks=pytest.mark.long)])
def test_a_way_out_makes_nothing_worse(planner: Planner, seeds: range) -> None:
    found = 0
    asked = 0
    for seed in seeds:
        for start in starts(planner, seed, 9):
            asked += 1
            plan = planner.plan_escape(start)
            if plan.status.ok:
                found += 1
                assert not plan.report.certified
                judged(planner, start, plan)
                after = plan.trajectory.positions[-1]
                assert planner.check_state(after).valid
            else:
                assert "mm, they must keep" in plan.status.message
    assert found >= 0.9 * asked


def test_limits_hold_as_in_every_movement(planner: Planner) -> None:
    """10 kHz samples and Pinocchio, where the start is within the joints' limits."""
    start = starts(planner, 100, 2)[1]
    plan = planner.plan_escape(start)
    assert plan.status.ok, plan.status.message
    assert SecondOpinion(planner.scene()).largest_share(plan.trajectory) <= 1.0 + 1e-6


def test_the_same_start_gives_the_same_bytes(planner: Planner) -> None:
    start = starts(planner, 7, 1)[0]
    first = planner.plan_escape(start)
    assert first.trajectory == planner.plan_escape(start).trajectory


def test_a_refused_start_is_told_of_the_way_out(planner: Planner) -> None:
    start = starts(planner, 100, 2)[1]
    refused = planner.plan_regional(start=start, goal="home").status
    assert refused.code == StatusCode.START_STATE_IN_COLLISION
    assert "ir ask escape" in refused.message
    robot = planner.cell.robot
    beyond = np.array(robot.machine_home)
    beyond[0] = robot.position_max[0] + 0.05
    with pytest.raises(RequestError, match="ir ask escape"):
        planner.plan_regional(start=beyond, goal="home")
    beyond[0] = robot.position_max[0] + 1.01 * OUTSIDE_MAX
    with pytest.raises(RequestError, match="at most 20 deg beyond"):
        planner.plan_escape(beyond)


def test_who_stands_free_needs_no_way_out(planner: Planner) -> None:
    plan = planner.plan_escape("home")
    assert plan.status.ok
    assert plan.trajectory is None
