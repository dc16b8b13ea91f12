"""Time scaling of a fixed path: faster than by rules, near TOPP-RA, within limits, through the
points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from ir_kernels.reference.descent import ProfileCost
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks.energy import movement_energy
from ir_planner.checks.verification import verify
from ir_planner.curves.uniform_spline import along_path
from ir_planner.errors import CancelledError, RequestError
from ir_planner.optimize.path_timing import (
    KEPT,
    FixedPath,
    Passing,
    PathTiming,
    along_its_path,
    never_back,
)
from ir_planner.optimize.spline_cost import spline_cost
from ir_planner.regional.regional import MovementPlan
from ir_planner.request.context import Context, Work
from ir_planner.scene.planning_scene import PlanningScene
from ir_planner.timing.blended_steps import stretched
from ir_planner.timing.movement import TORQUE_SHARES
from ir_planner.timing.objective import objective_weights
from ir_planner.timing.spline_timing import time_spline
from ir_planner.trajectories.through_points import Reference, plan_through

FloatArray = NDArray[np.float64]
TIME = PlanOptions(objective="time", planning_time=600.0)


def budget(cancelled: Callable[[], bool] = lambda: False, work: int = 400_000) -> Work:
    return Work(work, 1.0, lambda: 0.0, cancelled)


@pytest.fixture(scope="module")
def scene(scene_of: Callable[[str], PlanningScene]) -> PlanningScene:
    return scene_of("open")


def waved(scene: PlanningScene, count: int, by: float = 0.25) -> FloatArray:
    """Points of a smooth free path that turns."""
    task = scene.cell.task("home->p1")
    start = np.array(task.start)
    goal = np.array(task.goal)
    share = np.linspace(0.0, 1.0, count)[:, None]
    points = start + share * (goal - start)
    points[:, 2] += by * np.sin(2.0 * np.pi * share[:, 0])
    points[:, 4] += by * np.sin(3.0 * np.pi * share[:, 0])
    return np.asarray(points)


def by_rules(points: FloatArray, scene: PlanningScene) -> JointTrajectory:
    """The spline timed by rules alone: what is left of a request without work."""
    plan = plan_through(Reference(points), scene, TIME, budget(work=0))
    assert plan.trajectory is not None
    return plan.trajectory


def planned(points: FloatArray, scene: PlanningScene, options: PlanOptions = TIME) -> MovementPlan:
    return plan_through(Reference(points), scene, options, budget())


def deviation(trajectory: JointTrajectory, path: JointTrajectory) -> float:
    """Largest distance [rad] of samples of a trajectory from a polyline of many samples of the
    path.
    """
    q = trajectory.sample(np.linspace(0.0, trajectory.duration, 700)).q
    corners = path.sample(np.linspace(0.0, path.duration, 3000)).q
    first = corners[:-1]
    step = np.diff(corners, axis=0)
    length = np.maximum((step**2).sum(axis=1), 1e-18)
    worst = 0.0
    for one in q:
        share = np.clip(((one - first) * step).sum(axis=1) / length, 0.0, 1.0)
        worst = max(worst, float(np.abs(one - first - share[:, None] * step).max(axis=1).min()))
    return worst


@pytest.mark.parametrize("count", [5, 7, 9])
def test_the_path_stays_the_points_are_passed_and_the_time_gets_shorter(
    count: int, scene: PlanningScene
) -> None:
    points = waved(scene, count)
    rules = by_rules(points, scene)
    plan = planned(points, scene)
    assert plan.status.ok, plan.status.message
    assert plan.trajectory is not None
    assert plan.report.certified
    assert plan.report.duration < 0.93 * rules.duration
    assert deviation(plan.trajectory, rules) < KEPT
    for point in points:
        assert np.abs(plan.trajectory.positions - point).max(axis=1).min() < 5e-9
    step = 5e-4
    motion = plan.trajectory.sample(np.arange(0.0, plan.trajectory.duration, step))
    assert (np.abs(np.diff(motion.qdd, axis=0) / step) <= 1.0001 * scene.limits.jerk).all()
    use = np.abs(scene.dynamics.inverse_dynamics(motion.q, motion.qd, motion.qdd))
    assert (use <= scene.dynamics.torque_limit(motion.qd)).all()


def test_dense_points_are_passed_within_the_deviation(scene: PlanningScene) -> None:
    points = waved(scene, 200)
    plan = planned(points, scene)
    assert plan.trajectory is not None
    assert plan.report.duration < 0.8 * by_rules(points, scene).duration
    q = plan.trajectory.sample(np.linspace(0.0, plan.trajectory.duration, 20_000)).q
    assert max(np.abs(q - point).max(axis=1).min() for point in points) < KEPT
    assert "mrad of its path" in plan.info.stages[0].note


def test_a_requested_duration_costs_less_than_slowing_the_rules(scene: PlanningScene) -> None:
    points = waved(scene, 5)
    rules = by_rules(points, scene)
    requested = round(1.1 * rules.duration, 3)
    plan = planned(points, scene, replace(TIME, duration=requested))
    assert plan.report.certified
    assert plan.report.duration == pytest.approx(requested, abs=1e-6)
    assert plan.trajectory is not None
    assert deviation(plan.trajectory, rules) < KEPT
    slowed = stretched(rules, requested / rules.duration)
    assert plan.report.energy < 0.98 * movement_energy(slowed, scene).total


def test_the_objective_counts_at_a_free_duration(scene: PlanningScene) -> None:
    points = waved(scene, 5)
    plans = [
        planned(points, scene, replace(TIME, objective=objective)).report
        for objective in ("time", "energy", "time_and_energy")
    ]
    durations = [report.duration for report in plans]
    energies = [report.energy - report.base_energy for report in plans]
    sums = [
        energy + 500.0 * report.duration for energy, report in zip(energies, plans, strict=True)
    ]
    assert all(report.certified for report in plans)
    assert durations[0] < 0.95 * min(durations[1:])
    assert (
        energies[1] <= 1.005 * energies[2] < 0.95 * energies[0]
    )  # descents end a little above the least
    assert sums[2] <= min(1.005 * sums[1], 0.95 * sums[0])


def test_a_duration_that_is_too_short_is_refused_with_the_shortest(scene: PlanningScene) -> None:
    points = waved(scene, 5)
    shortest = planned(points, scene).report.duration
    with pytest.raises(
        RequestError, match=f"the shortest found within the limits is {shortest:.4g} s"
    ):
        planned(points, scene, replace(TIME, duration=0.9 * shortest))


def test_given_times_keep_their_proportions(scene: PlanningScene) -> None:
    points = waved(scene, 4)
    times = np.array([0.0, 3.0, 4.0, 9.0])
    plan = plan_through(Reference(points, times), scene, TIME, budget())
    assert plan.trajectory is not None
    passed = [int(np.abs(plan.trajectory.positions - q).max(axis=1).argmin()) for q in points]
    assert plan.trajectory.times[passed] == pytest.approx(times, abs=0.01)


def test_without_work_left_the_rules_time_it_and_a_cancel_is_heard(scene: PlanningScene) -> None:
    points = waved(scene, 5)
    plan = plan_through(Reference(points), scene, TIME, budget(work=0))
    limits = (scene.limits.with_torque_share(share) for share in TORQUE_SHARES[:2])
    timed = [
        time_spline(points, scene.cell.robot.joint_names, one, scene.dynamics) for one in limits
    ]
    assert plan.trajectory in timed
    asked = iter(range(1000))
    with pytest.raises(CancelledError):
        plan_through(Reference(points), scene, TIME, budget(lambda: next(asked) >= 3))


def test_the_same_request_gives_the_same_bytes(scene: PlanningScene) -> None:
    first, second = (planned(waved(scene, 4), scene) for _ in range(2))
    assert first.trajectory == second.trajectory


@pytest.mark.sampled
@pytest.mark.parametrize(("count", "by"), [(3, 0.25), (5, 0.25), (9, 0.25), (9, 0.4), (60, 0.25)])
def test_near_the_time_of_toppra_that_needs_no_jerk_limit(
    count: int, by: float, scene: PlanningScene
) -> None:
    """TOPP-RA on the same path with bounds that the true limits imply is faster than any answer can
    be.
    """
    points = waved(scene, count, by)
    rules = by_rules(points, scene)
    bound = toppra_seconds(rules, scene)
    timing = rescaled(rules, points, scene)
    assert verify(timing.trajectory, scene, 0.0).certified
    assert 0.99 * bound <= timing.trajectory.duration <= 1.6 * bound
    print(f"{count} points, by {by}: {timing.trajectory.duration / bound:.3f} times TOPP-RA's time")


def rescaled(rules: JointTrajectory, points: FloatArray, scene: PlanningScene) -> PathTiming:
    limits = scene.limits.with_torque_share(0.98)
    found = along_its_path(rules, points, limits, Context.of(scene, TIME, budget()))
    assert found is not None
    return found


def toppra_seconds(path: JointTrajectory, scene: PlanningScene) -> float:
    """Duration by TOPP-RA [s]: speed, acceleration, and torque of the rigid body within the largest
    torque at any speed and friction beside it.
    """
    toppra = pytest.importorskip("toppra")
    from toppra import algorithm, constraint

    robot = scene.cell.robot
    dynamics = scene.dynamics
    times = np.linspace(0.0, path.duration, 800)
    q = path.sample(times).q
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
    keep = np.concatenate([[True], np.diff(length) > 1e-4])
    geometry = toppra.SplineInterpolator(length[keep] / length[-1], q[keep])

    def rigid(q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
        friction = robot.friction_viscous * qd + robot.friction_coulomb * np.sign(qd)
        return np.asarray(dynamics.inverse_dynamics(q[None], qd[None], qdd[None])[0] - friction)

    friction = robot.friction_viscous * robot.velocity_max + robot.friction_coulomb
    largest = robot.envelope_torque.max(axis=1) + friction
    limits = [
        constraint.JointVelocityConstraint(robot.velocity_max),
        constraint.JointAccelerationConstraint(scene.limits.acceleration),
        constraint.JointTorqueConstraint(
            rigid, np.column_stack([-largest, largest]), np.zeros(robot.n)
        ),
    ]
    grid = np.linspace(*geometry.path_interval, 201)
    instance = algorithm.TOPPRA(limits, geometry, gridpoints=grid, solver_wrapper="seidel")
    _, speed, _ = instance.compute_parameterization(0.0, 0.0)
    assert speed is not None
    return float((2.0 * np.diff(grid) / (speed[1:] + speed[:-1])).sum())


def test_a_path_is_made_of_a_motion_that_passes_none_of_its_points(scene: PlanningScene) -> None:
    """Also where it has fewer points itself: a line in which clearance asked for a motion beside
    it.
    """
    for few in (2, 3, 5, 12):
        given = by_rules(waved(scene, few, 0.2), scene)
        path = FixedPath(given, waved(scene, 12))
        at = path.knots_at_points(path.places(40))
        assert np.isfinite(at).all()
        assert (np.diff(at) >= 0.0).all()


def test_the_derivatives_are_those_of_differences(scene: PlanningScene) -> None:
    points = waved(scene, 5)
    rules = by_rules(points, scene)
    path = FixedPath(rules, points)
    s = path.places(60)
    context = Context.of(scene, replace(TIME, objective="energy"), budget())
    weights = objective_weights(context, path.q)
    cost = spline_cost(context, scene.limits, weights, 4.0 * weights.power)
    along = path.cubics.breaks, path.cubics.cubics
    descent = ProfileCost(cost._core, along, s, rules.duration, fixed=False)
    rng = np.random.default_rng(2)
    x = rng.normal(0.0, 0.02, len(s) + 1)
    value, gradient = descent.value(x)
    assert value > 0.0
    for direction in rng.normal(0.0, 1.0, (4, len(x))):
        step = 1e-5 * direction
        difference = (descent.value(x + step)[0] - descent.value(x - step)[0]) / 2e-5
        assert gradient @ direction == pytest.approx(
            difference, rel=2e-3, abs=1e-3 * np.linalg.norm(gradient)
        )


def test_a_correction_passes_the_points_and_keeps_the_ends(scene: PlanningScene) -> None:
    spline = along_path(waved(scene, 50), 40, 3.0)
    at = np.array([5.3, 12.0, 20.71, 30.2])
    knots = spline.knots()[0]
    wanted = np.array([knots[5], knots[12], knots[21], knots[30]]) + 1e-3
    points = np.concatenate([knots[:1], wanted, knots[-1:]])
    passing = Passing.of(spline, at, points)
    corrected = passing.corrected(spline)
    assert np.array_equal(
        corrected.control[[0, 1, 2, -3, -2, -1]], spline.control[[0, 1, 2, -3, -2, -1]]
    )
    trajectory, exact = passing.sent(corrected, scene.cell.robot.joint_names)
    for point in points:
        assert np.abs(trajectory.positions - point).max(axis=1).min() < 1e-12
    assert len(trajectory.times_ns) > exact.intervals + 1
    plain = exact.trajectory(scene.cell.robot.joint_names)
    for times in (np.linspace(0.0, plain.duration, 999),):
        a = trajectory.sample(times)
        b = plain.sample(times)
        assert a.q == pytest.approx(b.q, abs=1e-12)
        assert a.qdd == pytest.approx(b.qdd, abs=1e-6)
        assert a.qddd == pytest.approx(b.qddd, rel=1e-3, abs=1e-2)


@pytest.mark.parametrize("seed", range(20))
def test_a_profile_that_is_mended_never_goes_back(seed: int) -> None:
    """The cubic spline over s, at rest at both ends, of profiles that fall and stand too."""
    rng = np.random.default_rng(seed)
    s = np.sort(rng.random(int(rng.integers(6, 60)))) ** float(rng.uniform(0.5, 3.0))
    s[: int(rng.integers(0, 4))] = 0.0
    s = np.clip(s + rng.normal(0.0, 0.02, len(s)), 0.0, 1.0)
    mended = never_back(s)
    assert ((mended >= 0.0) & (mended <= 1.0)).all()
    control = np.linalg.solve(_values_at_knots(len(s)), 6.0 * mended - np.eye(len(s))[-1])
    ends = np.concatenate([np.zeros(3), control, np.ones(3)])
    motion = BSpline(np.arange(len(ends) + 4.0), ends, 3)
    places = np.linspace(3.0, float(len(ends)), 5000)
    assert np.diff(motion(places)).min() > -1e-12
    assert np.abs(never_back(mended) - mended).max() < 1e-9


def _values_at_knots(count: int) -> FloatArray:
    return 4.0 * np.eye(count) + np.eye(count, k=1) + np.eye(count, k=-1)
