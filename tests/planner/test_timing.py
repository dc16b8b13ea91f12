"""Movements keep speed, acceleration, jerk and torque at 10 kHz, and are as fast as one of them
allows.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks.energy import movement_energy
from ir_planner.errors import RequestError
from ir_planner.planner import Planner
from ir_planner.request.context import Context, Work
from ir_planner.request.goals import Goal
from ir_planner.scene.motion_limits import MotionLimits, torque_use
from ir_planner.scene.planning_scene import PlanningScene
from ir_planner.timing.blended_steps import (
    TimedPath,
    blended,
    largest_overlaps,
    standing,
    stretched,
)
from ir_planner.timing.jerk_limited_laws import StepLaws, TimeLaw
from ir_planner.timing.movement import Movement
from ir_planner.timing.objective import best_stretch
from ir_planner.timing.ptp import fastest, fastest_law
from ir_planner.timing.spline_timing import time_spline
from ir_planner.timing.straight_steps import own_laws, straight_steps

_spec = importlib.util.spec_from_file_location(
    "planner_oracles", Path(__file__).parent / "oracles.py"
)
assert _spec is not None
assert _spec.loader is not None
oracles = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(oracles)

NAMES = ("joint_a1", "joint_a2", "joint_a3", "joint_a4", "joint_a5", "joint_a6")
Degrees = Callable[..., Any]
MOVES = [
    ((0, -90, 90, 0, 0, 0), (90, -60, 60, 30, 30, 0)),
    ((0, -90, 90, 0, 0, 0), (0, -50, 50, 0, 40, 0)),
    ((0, -90, 90, 0, 0, 0), (0, -90, 90, 0, 60, 180)),
    ((20, -60, 80, 0, 40, 0), (22, -61, 79, 0, 40, 0)),
    ((0, -60, 60, 0, 0, 0), (0, -110, 110, 0, 0, 0)),
]


def at_10_khz(trajectory: JointTrajectory) -> Any:
    return trajectory.sample(np.arange(0.0, trajectory.duration, 1e-4))


@pytest.mark.parametrize(("start", "goal"), MOVES)
def test_a_ptp_keeps_all_limits_and_uses_one_of_them_up(
    start: Any, goal: Any, demo_scene: PlanningScene, degrees: Degrees, budget: Work
) -> None:
    options = PlanOptions(objective="time", safety_distance=0.0)
    movement = straight_steps(
        np.stack([degrees(*start), degrees(*goal)]), Context.of(demo_scene, options, budget)
    )
    motion = at_10_khz(movement.trajectory)
    robot = demo_scene.cell.robot
    tau = oracles.torques(demo_scene, motion.q, motion.qd, motion.qdd)
    share = {
        "velocity": np.abs(motion.qd) / robot.velocity_max,
        "acceleration": np.abs(motion.qdd) / robot.acceleration_max,
        "jerk": np.abs(motion.qddd) / robot.jerk_max,
        "torque": np.abs(tau) / oracles.torque_available(robot, motion.qd),
    }
    largest = {name: float(values.max()) for name, values in share.items()}
    assert max(largest.values()) <= 1.0 + 1e-6, largest
    # the jerk is at its limit by construction, unless torque slowed the ramps: then torque is near
    # its share
    assert max(largest["velocity"], largest["acceleration"], largest["torque"]) > 0.93, largest
    report = movement.report
    assert report.certified
    assert (report.torque_ratio >= share["torque"].max(axis=0) - 1e-6).all(), (
        "the bound is no bound"
    )


def test_torques_of_the_planner_are_those_of_pinocchio(demo_scene: PlanningScene) -> None:
    rng = np.random.default_rng(3)
    robot = demo_scene.cell.robot
    q = rng.uniform(robot.position_min, robot.position_max, (50, 6))
    qd, qdd = rng.normal(size=(2, 50, 6))
    ours = demo_scene.dynamics.inverse_dynamics(q, qd, qdd)
    assert ours == pytest.approx(oracles.torques(demo_scene, q, qd, qdd), rel=1e-9, abs=1e-6)
    share = torque_use(demo_scene.dynamics, q, qd, qdd)
    assert share == pytest.approx(np.abs(ours) / oracles.torque_available(robot, qd), rel=1e-9)


def test_a_heavier_load_takes_longer(demo_scene: PlanningScene, degrees: Degrees) -> None:
    a = degrees(0, -50, 50, 0, 40, 0)
    b = degrees(0, -110, 110, 0, 0, 0)
    empty = replace(demo_scene, loads=())
    with_tool = fastest_law(a, b, demo_scene.limits, demo_scene.dynamics).total
    assert fastest_law(a, b, empty.limits, empty.dynamics).total < with_tool


def test_scaling_limits_what_it_says(
    demo_scene: PlanningScene, degrees: Degrees, budget: Work
) -> None:
    path = np.stack([degrees(0, -90, 90, 0, 0, 0), degrees(90, -60, 60, 30, 30, 0)])
    options = PlanOptions(
        objective="time", velocity_scaling=0.3, acceleration_scaling=0.5, safety_distance=0.0
    )
    report = straight_steps(path, Context.of(demo_scene, options, budget)).report
    assert report.velocity_ratio.max() == pytest.approx(0.3, rel=0.02)
    assert report.acceleration_ratio.max() <= 0.5 + 1e-9


def test_a_requested_duration_is_met_and_too_short_a_one_refused(
    demo_scene: PlanningScene, degrees: Degrees, budget: Work
) -> None:
    path = np.stack([degrees(0, -90, 90, 0, 0, 0), degrees(40, -80, 90, 0, 0, 0)])
    movement = straight_steps(path, Context.of(demo_scene, PlanOptions(duration=3.25), budget))
    assert movement.trajectory.duration == pytest.approx(3.25, abs=1e-5)
    assert movement.prove().violation is None
    with pytest.raises(RequestError, match=r"duration is 0\.2 s: the shortest"):
        straight_steps(path, Context.of(demo_scene, PlanOptions(duration=0.2), budget))


@pytest.mark.parametrize(("start", "goal"), MOVES[:3])
def test_asynchronous_joints_arrive_on_their_own(
    start: Any, goal: Any, demo_scene: PlanningScene, degrees: Degrees, budget: Work
) -> None:
    path = np.stack([degrees(*start), degrees(*goal)])
    options = PlanOptions(objective="time", timing="asynchronous", safety_distance=0.0)
    movement = straight_steps(path, Context.of(demo_scene, options, budget))
    assert movement.prove().violation is None
    common = fastest(path[0], path[1], demo_scene.limits, demo_scene.dynamics)
    delta = path[1] - path[0]
    laws, joined = own_laws(path[0], delta, common, demo_scene.limits, demo_scene.dynamics)
    assert laws.total <= common.total
    own = [j for j in range(6) if abs(delta[j]) > 1e-6 and j not in joined]
    assert all(laws.laws[j].total <= common.total for j in own)
    assert bool(own) == ("synchronous" not in movement.note or "keep to" in movement.note)
    motion = at_10_khz(movement.trajectory)
    tau = oracles.torques(demo_scene, motion.q, motion.qd, motion.qdd)
    robot = demo_scene.cell.robot
    assert (np.abs(tau) / oracles.torque_available(robot, motion.qd)).max() <= 1.0 + 1e-6
    assert (np.abs(motion.qd) <= robot.velocity_max * (1 + 1e-9)).all()
    assert movement.trajectory.positions[-1] == pytest.approx(path[1], abs=0.0)


def test_corners_are_cut_within_the_limits_and_save_time(
    demo_scene: PlanningScene, degrees: Degrees, budget: Work
) -> None:
    path = np.stack(
        [degrees(0, -90, 90, 0, 0, 0), degrees(30, -95, 95, 0, 0, 0), degrees(60, -90, 90, 0, 0, 0)]
    )
    options = PlanOptions(objective="time")
    movement = straight_steps(path, Context.of(demo_scene, options, budget))
    laws = tuple(
        StepLaws((fastest_law(a, b, demo_scene.limits, demo_scene.dynamics),))
        for a, b in pairwise(path)
    )
    stopping = blended(TimedPath(path, laws, (0,)), NAMES)
    assert movement.trajectory.duration < stopping.duration - 0.05
    assert movement.prove().violation is None


def test_a_blend_is_the_sum_of_its_laws() -> None:
    path = np.array([[0.0, 0.0], [1.0, 0.5], [0.5, 2.0]])
    laws = (
        StepLaws((TimeLaw((20, 100, 20, 30, 20, 80, 20)),)),
        StepLaws((TimeLaw((30, 50, 30, 0, 30, 50, 30)),)),
    )
    timed = TimedPath(path, laws, largest_overlaps(laws))
    trajectory = blended(timed, ("a", "b"))
    t = np.arange(timed.total + 1)
    expected = path[0].copy() + sum(
        law.at(t - begin)[0] * delta
        for law, begin, delta in zip(laws, timed.starts, np.diff(path, axis=0), strict=True)
    )
    assert trajectory.sample(t * 1e-3).q == pytest.approx(expected, abs=1e-9)


def test_stretching_keeps_the_path_and_divides_the_speed() -> None:
    laws = (StepLaws((TimeLaw((20, 100, 20, 30, 20, 80, 20)),)),)
    fast = blended(TimedPath(np.array([[0.0], [1.0]]), laws, ()), ("a",))
    slow = stretched(fast, 1.2345678)
    factor = slow.duration / fast.duration
    assert factor == pytest.approx(1.234568, abs=1e-9)
    t = np.linspace(0.0, fast.duration, 777)
    assert slow.sample(t * factor).q == pytest.approx(fast.sample(t).q, abs=1e-9)
    assert slow.sample(t * factor).qd * factor == pytest.approx(fast.sample(t).qd, abs=1e-7)


def test_hours_keep_their_nanoseconds() -> None:
    laws = (StepLaws((TimeLaw((20, 100, 20, 30, 20, 80, 20)),)),)
    fast = blended(TimedPath(np.array([[0.0], [1.0]]), laws, ()), ("a",))
    slow = stretched(fast, 2e6)  # nanoseconds times millionths would be 5.8e20
    assert slow.times_ns.tolist() == [2_000_000 * t for t in fast.times_ns.tolist()]


@pytest.mark.parametrize(
    ("scaling", "says"), [(1e-5, "at most 3600 s"), (1e-9, "velocity_scaling is 1e-09")]
)
def test_a_movement_that_would_take_hours_is_refused(
    scaling: float, says: str, planner: Planner
) -> None:
    home = np.array(planner.cell.machine_home)
    park = Goal(configuration=np.array(planner.cell.park))
    with pytest.raises(RequestError, match=says):
        planner.plan_regional(start=home, goal=park, options=PlanOptions(velocity_scaling=scaling))


def test_a_goal_that_is_the_start_takes_a_millisecond(
    demo_scene: PlanningScene, budget: Work
) -> None:
    home = np.array(demo_scene.cell.machine_home)
    movement = straight_steps(np.stack([home, home]), Context.of(demo_scene, PlanOptions(), budget))
    assert movement.trajectory == standing(home, NAMES)
    assert movement.report.certified
    assert movement.report.energy == pytest.approx(movement.report.duration * 735.0, rel=0.01)


def test_a_spline_through_points_keeps_its_limits(
    demo_scene: PlanningScene, degrees: Degrees
) -> None:
    points = np.stack(
        [degrees(0, -90, 90, 0, 0, 0), degrees(20, -80, 85, 10, 20, 0), degrees(50, -85, 95, 0, 30, 40),  # noqa: E501
         degrees(60, -90, 90, 0, 0, 0)]
    )  # fmt: skip
    limits = demo_scene.limits
    trajectory = time_spline(points, NAMES, limits, demo_scene.dynamics)
    motion = at_10_khz(trajectory)
    assert (np.abs(motion.qd) <= limits.velocity * (1 + 1e-6)).all()
    assert (np.abs(motion.qdd) <= limits.acceleration * (1 + 1e-6)).all()
    assert (np.abs(motion.qddd) <= limits.jerk * (1 + 1e-6)).all()
    for q in points:
        assert np.abs(trajectory.positions - q).max(axis=1).min() < 1e-9
    torque = float(torque_use(demo_scene.dynamics, motion.q, motion.qd, motion.qdd).max())
    assert torque <= limits.torque_share + 1e-3
    first, second, *_, before, last = trajectory.times[1:]
    assert (2.0 * first, last - before) == pytest.approx((second, before - trajectory.times[-3]))
    used = max(
        float((np.abs(motion.qd) / limits.velocity).max()),
        float((np.abs(motion.qdd) / limits.acceleration).max()),
        torque,
    )
    assert used > 0.7, "the spline is slower than it needs to be"


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("count", [3, 10, 100])
def test_points_at_which_the_arm_can_stand_are_passed_however_many(
    demo_scene: PlanningScene, seed: int, count: int
) -> None:
    home = np.array(demo_scene.cell.machine_home)
    points = home + np.random.default_rng(seed).uniform(-0.3, 0.3, (count, 6))
    still = np.zeros_like(points)
    assert torque_use(demo_scene.dynamics, points, still, still).max() < 0.7
    trajectory = time_spline(points, NAMES, demo_scene.limits, demo_scene.dynamics)
    motion = trajectory.sample(trajectory.times)
    assert torque_use(demo_scene.dynamics, motion.q, motion.qd, motion.qdd).max() <= 1.0


def test_limits_scale_with_the_request() -> None:
    one = np.ones(2)
    scaled = MotionLimits(one, 2 * one, 3 * one).scaled(0.5, 0.25)
    assert (scaled.velocity[0], scaled.acceleration[0], scaled.jerk[0]) == (0.5, 0.5, 0.75)


@pytest.mark.parametrize(("start", "goal"), MOVES[:3])
def test_where_joules_count_the_best_shape_is_taken(
    start: Any, goal: Any, demo_scene: PlanningScene, degrees: Degrees, budget: Work
) -> None:
    """The fastest law stretched is one of the candidates: never worse than it."""
    path = np.stack([degrees(*start), degrees(*goal)])
    options = PlanOptions(safety_distance=0.0)
    report = straight_steps(path, Context.of(demo_scene, options, budget)).report
    law = fastest(path[0], path[1], demo_scene.limits, demo_scene.dynamics)
    quickest = blended(TimedPath(path, (StepLaws((law,)),), ()), NAMES)
    factor = best_stretch(quickest, Context.of(demo_scene, options, budget))
    alone = stretched(quickest, factor)
    value = report.energy + options.time_value * report.duration
    other = movement_energy(alone, demo_scene).total + options.time_value * alone.duration
    assert value <= other * 1.002, "coarse sampling of the candidates may cost a trifle, no more"


def test_proofs_are_handed_on_to_no_other_scene_distance_or_station(
    demo_scene: PlanningScene, degrees: Degrees, budget: Work
) -> None:
    path = np.stack([degrees(0, -90, 90, 0, 0, 0), degrees(40, -80, 90, 0, 0, 0)])
    context = Context.of(demo_scene, PlanOptions(), budget)
    movement = straight_steps(path, context)
    assert movement.prove().certified
    station = demo_scene.cell.stations[0].name
    options = replace(context.options, safety_distance=1.0)
    others = {
        "S_m": replace(context, options=options),
        "scene": context.inside(replace(demo_scene)),
        "tool": replace(context, options=replace(context.options, tool_speed=1e-3)),
        "tilt": replace(
            context, options=replace(context.options, tilt_max=1e-3, tilt_axis=(1.0, 0.0, 0.0))
        ),
        "rest": context.in_motion(np.ones((2, 2, 6))),
    }
    for what, other in others.items():
        asked = movement.asked_by(other)
        assert asked.proofs is not movement.proofs, what
        anew = Movement(path, movement.trajectory, other)
        assert asked.prove().status == anew.prove().status, what
    assert not movement.asked_by(others["S_m"]).prove().certified
    assert not movement.asked_by(others["tool"]).prove().certified
    at_station = Movement(path, movement.trajectory, context.at(station), known=movement.proofs)
    assert at_station.proofs is not movement.proofs
    assert movement.stretched_by(2.0).proofs is not movement.proofs


def test_proofs_are_kept_where_only_the_objective_or_the_waypoints_differ(
    demo_scene: PlanningScene, degrees: Degrees, budget: Work
) -> None:
    path = np.stack([degrees(0, -90, 90, 0, 0, 0), degrees(40, -80, 90, 0, 0, 0)])
    context = Context.of(demo_scene, PlanOptions(), budget)
    movement = straight_steps(path, context)
    assert movement.asked_by(context.asking("energy")).proofs is movement.proofs
    assert movement.passing(path[[0, 0, 1]]).proofs is movement.proofs
