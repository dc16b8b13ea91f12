"""Axes that turn twice: a path is driven as well as if all whole turns were searched."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import numpy as np
import pytest

from ir_kernels.ik_set import turns_of_all
from ir_kernels.reference.inverse_kinematics import turns
from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_msgs_py.options import PlanOptions
from ir_planner import CartesianPlan, Planner
from ir_planner.cartesian.chains import Layers, turned_into_limits, with_all_turns
from ir_planner.cartesian.orientations import about_tool
from ir_planner.scene import PlanningScene

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # random paths
from cartesian import MARGIN, random_path

TURN = 2.0 * np.pi
OPTIONS = PlanOptions(safety_distance=MARGIN)


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner("ur10e_bench", clock=lambda: 0.0)


def with_all(path: CartesianPath, **more: object) -> CartesianPlan:
    """The answer of a planner that searches all whole turns."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PlanningScene, "turning", np.zeros(6, dtype=bool))
        planner = Planner("ur10e_bench", clock=lambda: 0.0)
        return planner.plan_cartesian(path, options=OPTIONS, **more)  # type: ignore[arg-type]


def not_worse(plan: CartesianPlan, other: CartesianPlan) -> None:
    assert plan.status.code == other.status.code, (plan.status.message, other.status.message)
    if plan.trajectory is not None:
        assert plan.report.certified
        assert plan.report.energy <= other.report.energy * (1.0 + 1e-6)
        assert plan.configurations < other.configurations


@pytest.mark.sampled
@pytest.mark.parametrize("seed", [7, 8, 13, 15])
def test_a_path_costs_no_more_than_with_all_turns(planner: Planner, seed: int) -> None:
    path = random_path(np.random.default_rng(seed), planner.scene())
    not_worse(planner.plan_cartesian(path, options=OPTIONS), with_all(path))


def test_from_a_start_near_a_limit_the_axis_turns_back_or_the_tool_does(planner: Planner) -> None:
    scene = planner.scene()
    start = np.radians([20.0, -80.0, 100.0, -110.0, -90.0, 355.0])
    begin = scene.chain.tcp_poses(start[None])[0]
    plans = {}
    for turn, free_angle in itertools.product((-20.0, 20.0), (0.0, 0.5)):
        end = np.array(begin)
        end[:3, 3] += 0.05 * begin[:3, 1]
        end[:3, :3] = begin[:3, :3] @ about_tool(np.radians([turn]))[0]
        path = CartesianPath(
            begin, (CartesianSegment("line", (end,)),), tool_speed=0.05, free_angle=free_angle
        )
        plan = planner.plan_cartesian(path, options=OPTIONS, start=start)
        plans[turn, free_angle] = plan
        not_worse(plan, with_all(path, start=start))
    beyond = next(turn for turn in (-20.0, 20.0) if not plans[turn, 0.0].status.ok)
    assert plans[-beyond, 0.0].status.ok
    assert plans[beyond, 0.5].status.ok
    assert "reaches its limit of 360 deg" in plans[beyond, 0.0].status.message


@pytest.mark.parametrize("seed", range(20))
def test_a_chain_is_turned_into_the_limits_wherever_some_turns_are(
    planner: Planner, seed: int
) -> None:
    scene = planner.scene()
    rng = np.random.default_rng(seed)
    robot = scene.cell.robot
    turning = scene.turning
    steps = rng.uniform(-0.3, 0.3, (40, 6)) + 0.02 * seed * np.eye(6)[seed % 6]
    whole = np.cumsum(steps, axis=0) + rng.uniform(-3.0, 3.0, 6)
    whole[:, ~turning] = np.clip(whole[:, ~turning], robot.position_min[2], robot.position_max[2])
    wrapped = np.where(turning, np.mod(whole + np.pi, TURN) - np.pi, whole)
    fits = [
        [k for k in range(-5, 6) if (np.abs(column + TURN * k) <= most + 1e-9).all()]
        for column, most in zip(whole.T[turning], robot.position_max[turning], strict=True)
    ]
    found = turned_into_limits(wrapped, turning, scene, fixed=False)
    assert (found is not None) == all(fits)
    if found is not None:
        np.testing.assert_allclose(np.diff(found, axis=0), np.diff(whole, axis=0), atol=1e-9)
        least = [
            min(np.abs(c + TURN * k).max() for k in ks)
            for c, ks in zip(whole.T[turning], fits, strict=True)
        ]
        np.testing.assert_allclose(np.abs(found[:, turning]).max(axis=0), least, atol=1e-9)
    as_begun = turned_into_limits(whole, turning, scene, fixed=True)
    inside = (np.abs(whole) <= robot.position_max + 1e-9).all()
    assert (as_begun is not None) == inside


def test_all_turns_of_the_layers_are_those_of_inverse_kinematics(planner: Planner) -> None:
    scene = planner.scene()
    rng = np.random.default_rng(1)
    robot = scene.cell.robot
    poses = scene.chain.tcp_poses(rng.uniform(robot.position_min, robot.position_max, (4, 6)))
    once = scene.inverse_kinematics_once.solve(poses)
    every = scene.inverse_kinematics.solve(poses)
    free = rng.random(len(once.q)) < 0.5
    layers = Layers(
        np.arange(4.0), once.q, once.pose_index, np.zeros(len(once.q)), free, scene.turning
    )
    found = with_all_turns(layers, scene, fixed=False)
    assert len(found.q) == len(every.q) > 16 * len(once.q)
    rows = np.lexsort((*np.round(found.q, 6).T, found.layer))
    others = np.lexsort((*np.round(every.q, 6).T, every.pose_index))
    np.testing.assert_allclose(found.q[rows], every.q[others], atol=1e-9)
    assert (np.diff(found.layer) >= 0).all()
    begun = with_all_turns(layers, scene, fixed=True)
    np.testing.assert_array_equal(begun.q[begun.layer == 0], once.q[once.pose_index == 0])


def test_turns_of_many_angles_are_those_of_each() -> None:
    rng = np.random.default_rng(3)
    angles = np.concatenate([rng.uniform(-20.0, 20.0, 200), TURN * np.arange(-3, 4), [1.0 + 5e-11]])
    for low, high in ((-TURN, TURN), (-np.pi, np.pi), (-6.1, 6.1), (1.0, 1.0), (0.5, 9.0)):
        which, values = turns_of_all(angles, low, high)
        wanted = [
            (k, value) for k, angle in enumerate(angles) for value in turns(float(angle), low, high)
        ]
        assert list(zip(which.tolist(), values.tolist(), strict=True)) == wanted
