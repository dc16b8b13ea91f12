"""Any trajectory becomes cheaper between its end points: certified, as requested, with its trade of
time for energy.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ir_description import PowerData
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks.energy import movement_energy
from ir_planner.errors import CancelledError, RequestError
from ir_planner.optimize.descents import Descents
from ir_planner.planner import Planner
from ir_planner.request.context import Work
from ir_planner.scene.planning_scene import PROOF_TOLERANCE, PlanningScene
from ir_planner.search import SEARCHES
from ir_planner.timing.blended_steps import stretched
from ir_planner.trajectories.optimization import (
    POINTS_MAX,
    OptimizationPlan,
    non_dominated,
    optimize_trajectory,
)
from ir_planner.trajectories.through_points import Reference
from ir_values.errors import JointNamesError

FloatArray = NDArray[np.float64]
SceneOf = Callable[[str], PlanningScene]
TASK = "conv->p1"
OPTIONS = PlanOptions(planning_time=600.0, max_iterations=16_000)  # a main descent and little more
ROUNDING = 1e-6  # s


def budget(options: PlanOptions, cancelled: Callable[[], bool] = lambda: False) -> Work:
    return Work(options.max_iterations or 400_000, 1.0, lambda: 0.0, cancelled)


def optimized(
    trajectory: JointTrajectory, scene: PlanningScene, options: PlanOptions = OPTIONS
) -> OptimizationPlan:
    return optimize_trajectory(trajectory, scene, options, budget(options), SEARCHES)


def ends_of(scene: PlanningScene, task: str) -> FloatArray:
    asked = scene.cell.task(task)
    return np.stack([asked.start, asked.goal])


def quintic(points: FloatArray, duration: float, scene: PlanningScene) -> JointTrajectory:
    rest = np.zeros_like(points)
    times = np.linspace(0.0, duration, len(points))
    return JointTrajectory.from_seconds(scene.cell.robot.joint_names, times, points, rest, rest)


def swung(points: FloatArray, joint: int, by: float) -> FloatArray:
    """The straight path in 20 steps, with a joint that swings out and back."""
    share = np.linspace(0.0, 1.0, 21)
    path = points[0] + share[:, None] * (points[1] - points[0])
    path[:, joint] += by * np.sin(np.pi * share) ** 2
    return np.asarray(path)


def check_movement(
    trajectory: JointTrajectory | None, ends: FloatArray, scene: PlanningScene
) -> None:
    """Ends, rest, limits and clearance, from samples and differences of the points that are
    sent.
    """
    assert trajectory is not None
    assert np.array_equal(trajectory.positions[[0, -1]], ends)
    assert trajectory.velocities is not None
    assert not trajectory.velocities[[0, -1]].any()
    step = 5e-4
    motion = trajectory.sample(np.arange(0.0, trajectory.duration, step))
    limits = scene.limits
    assert (np.abs(np.diff(motion.q, axis=0) / step) <= 1.0001 * limits.velocity).all()
    assert (np.abs(np.diff(motion.qd, axis=0) / step) <= 1.0001 * limits.acceleration).all()
    assert (np.abs(np.diff(motion.qdd, axis=0) / step) <= 1.0001 * limits.jerk).all()
    torque = scene.dynamics.inverse_dynamics(motion.q, motion.qd, motion.qdd)
    assert (np.abs(torque) <= scene.dynamics.torque_limit(motion.qd)).all()
    assert scene.collision.distances(motion.q).min() > 0.02 - PROOF_TOLERANCE


@pytest.fixture(scope="module")
def scene(scene_of: SceneOf) -> PlanningScene:
    return scene_of("open")


@pytest.fixture(scope="module")
def detour(scene: PlanningScene) -> JointTrajectory:
    """A slow certified trajectory with a needless swing."""
    return quintic(swung(ends_of(scene, TASK), 1, -0.3), 30.0, scene)


@pytest.fixture(scope="module")
def full(detour: JointTrajectory, scene: PlanningScene) -> OptimizationPlan:
    """With the whole budget."""
    return optimized(detour, scene, PlanOptions(planning_time=600.0))


# -- better


@pytest.mark.sampled
@pytest.mark.parametrize("order", ["linear", "cubic", "quintic"])
def test_any_kind_of_trajectory_becomes_cheaper_between_the_same_ends(
    order: str, detour: JointTrajectory, scene: PlanningScene
) -> None:
    given = JointTrajectory(
        detour.joint_names,
        detour.times_ns,
        detour.positions,
        None if order == "linear" else detour.velocities,
        detour.accelerations if order == "quintic" else None,
    )
    plan = optimized(given, scene)
    assert plan.status.ok, plan.status.message
    check_movement(plan.trajectory, ends_of(scene, TASK), scene)
    assert plan.after.certified
    assert plan.before.certified == (order == "quintic")
    assert plan.after.duration < plan.before.duration
    assert plan.after.energy < plan.before.energy
    assert plan.before.duration == pytest.approx(30.0)


def test_what_breaks_limits_is_reported_before_and_certified_after(scene: PlanningScene) -> None:
    plan = optimized(quintic(ends_of(scene, TASK), 0.1, scene), scene)
    assert not plan.before.certified
    assert plan.before.velocity_ratio.max() > 5.0
    assert "velocity limit" in plan.info.stages[0].note
    assert plan.after.certified
    check_movement(plan.trajectory, ends_of(scene, TASK), scene)


def test_a_thousand_trembling_points_become_smooth(
    detour: JointTrajectory, scene: PlanningScene
) -> None:
    times = np.linspace(0.0, 30.0, 1000)
    q = detour.sample(times).q
    q[1:-1] += np.random.default_rng(0).normal(0.0, 0.01, q[1:-1].shape)
    plan = optimized(JointTrajectory.from_seconds(detour.joint_names, times, q), scene)
    assert plan.after.certified
    check_movement(plan.trajectory, ends_of(scene, TASK), scene)


def test_a_path_through_a_body_is_pushed_out_of_it(scene_of: SceneOf) -> None:
    scene = scene_of("deep_box")
    ends = ends_of(scene, "bin->pal")
    plan = optimized(quintic(ends, 6.0, scene), scene)
    assert plan.before.min_clearance < 0.0
    assert not plan.before.certified
    assert plan.info.planner_id == "descent"
    check_movement(plan.trajectory, ends, scene)


@pytest.fixture
def no_descent(monkeypatch: pytest.MonkeyPatch) -> None:
    """No descent is certified, whatever the bodies."""
    monkeypatch.setattr(Descents, "improved", lambda *args, **options: None)


def test_a_planner_that_had_nothing_to_search_is_said_to_be_unused(
    detour: JointTrajectory, scene: PlanningScene
) -> None:
    plan = optimized(detour, scene, replace(OPTIONS, planner_id="tree"))
    assert plan.status.ok
    said = [stage.note for stage in plan.info.stages if stage.name == "options"]
    assert said == ["planner_id tree is not used: no new path had to be searched"]


@pytest.mark.usefixtures("no_descent")
def test_a_repair_is_searched_by_the_planner_that_is_named(scene_of: SceneOf) -> None:
    scene = scene_of("table_columns")
    options = replace(OPTIONS, planner_id="tree", max_iterations=400_000)
    plan = optimized(quintic(ends_of(scene, "tL->side1"), 6.0, scene), scene, options)
    assert plan.status.ok, plan.status.message
    assert plan.info.planner_id == "tree"
    assert "options" not in [stage.name for stage in plan.info.stages]


@pytest.mark.usefixtures("no_descent")
def test_where_pushing_fails_a_path_around_is_found_and_noted(scene_of: SceneOf) -> None:
    scene = scene_of("table_columns")
    ends = ends_of(scene, "tL->side1")
    plan = optimized(quintic(ends, 6.0, scene), scene, replace(OPTIONS, max_iterations=400_000))
    assert plan.status.ok, plan.status.message
    check_movement(plan.trajectory, ends, scene)
    assert plan.info.timing == "synchronous"
    assert "new paths" in next(stage for stage in plan.info.stages if stage.name == "repair").note


@pytest.mark.usefixtures("no_descent")
def test_where_nothing_is_found_the_obstructing_pair_is_named(scene_of: SceneOf) -> None:
    scene = scene_of("table_columns")
    options = replace(OPTIONS, planner_id="direct")
    plan = optimized(quintic(ends_of(scene, "tL->side1"), 6.0, scene), scene, options)
    assert plan.status.code == StatusCode.PLANNING_FAILED
    assert plan.trajectory is None
    assert "can't be repaired" in plan.status.message
    assert " mm" in plan.status.message
    assert plan.before.duration == pytest.approx(6.0)
    assert not plan.before.certified


@pytest.mark.parametrize(
    "objective",
    [
        "movement_cost",
        "time_and_energy",
        pytest.param("time", marks=pytest.mark.long),
        pytest.param("energy", marks=pytest.mark.long),
    ],
)
def test_the_answer_is_never_worse_than_a_certified_original(
    objective: str, full: OptimizationPlan, scene: PlanningScene
) -> None:
    values = {
        "time": lambda report: report.duration,
        "energy": lambda report: report.energy - report.base_energy,
        "movement_cost": lambda report: report.movement_cost,
        "time_and_energy": lambda report: (
            report.energy - report.base_energy + 500.0 * report.duration
        ),
    }
    assert full.trajectory is not None
    options = replace(OPTIONS, objective=objective)
    once = optimized(full.trajectory, scene, options)
    assert once.trajectory is not None
    again = optimized(once.trajectory, scene, options)
    value = values[objective]
    assert value(once.after) <= value(once.before) * (1.0 + 1e-5)
    assert value(again.after) <= value(again.before) * (1.0 + 1e-5)
    notes = [stage.note for stage in again.info.stages if stage.name == "result"]
    kept = again.trajectory == once.trajectory
    assert kept == any("the original is kept" in note for note in notes)


def test_an_original_that_is_best_is_given_back_with_a_note(
    scene: PlanningScene, full: OptimizationPlan
) -> None:
    """The least energy of a front is not beaten by a descent that ends at once."""
    best = full.front[-1].trajectory
    options = replace(OPTIONS, objective="energy", max_iterations=1)
    plan = optimized(best, scene, options)
    assert (
        plan.after.energy - plan.after.base_energy <= plan.before.energy - plan.before.base_energy
    )
    if plan.trajectory == best:
        assert "the original is kept" in plan.info.stages[-1].note


# -- as requested


def test_a_requested_duration_is_kept_and_gets_cheaper(
    detour: JointTrajectory, scene: PlanningScene
) -> None:
    energies = []
    for duration in (1.0, 1.3):
        plan = optimized(detour, scene, replace(OPTIONS, duration=duration))
        assert plan.after.certified
        assert plan.after.duration == pytest.approx(duration, abs=ROUNDING)
        check_movement(plan.trajectory, ends_of(scene, TASK), scene)
        energies.append(plan.after.energy)
    assert energies[0] > energies[1]


def test_a_duration_that_is_too_short_is_refused_with_the_shortest(
    detour: JointTrajectory, scene: PlanningScene
) -> None:
    with pytest.raises(RequestError, match=r"duration is 0.5 s: the shortest .* is 0\.\d+ s"):
        optimized(detour, scene, replace(OPTIONS, duration=0.5, max_iterations=100_000))


def test_scalings_bound_the_answer(detour: JointTrajectory, scene: PlanningScene) -> None:
    options = replace(OPTIONS, objective="time", velocity_scaling=0.4, acceleration_scaling=0.3)
    plan = optimized(detour, scene, options)
    assert plan.after.certified
    assert plan.after.velocity_ratio.max() <= 0.4 + 1e-6
    assert plan.after.acceleration_ratio.max() <= 0.3 + 1e-6
    assert plan.after.jerk_ratio.max() <= 0.3 + 1e-6


def test_the_safety_distance_is_kept(detour: JointTrajectory, scene: PlanningScene) -> None:
    plan = optimized(detour, scene, replace(OPTIONS, safety_distance=0.03))
    assert plan.after.certified
    assert plan.after.min_clearance > 0.03 - PROOF_TOLERANCE


def test_what_the_arm_carries_counts(detour: JointTrajectory, planner: Planner) -> None:
    planner.set_cell("open")
    empty = planner.optimize_trajectory(detour, options=replace(OPTIONS, load="none"))
    tool = planner.optimize_trajectory(detour, options=OPTIONS)
    assert empty.before.energy < tool.before.energy
    assert empty.after.energy < tool.after.energy


def test_contacts_of_a_station_hold_for_movements_into_it(planner: Planner) -> None:
    entry = planner.plan_service(
        "lathe_work",
        direction="entry",
        near=np.array(planner.cell.park),
        max_candidates=1,
        options=PlanOptions(planning_time=60.0),
    ).candidates[0]
    assert entry.trajectory is not None
    plan = planner.optimize_trajectory(stretched(entry.trajectory, 1.5), options=OPTIONS)
    assert plan.status.ok, plan.status.message
    assert any("lathe_work" in stage.note for stage in plan.info.stages)
    assert plan.trajectory is not None
    evaluation = planner.evaluate(plan.trajectory, safety_distance=0.02, station="lathe_work")
    assert evaluation.verification.certified
    assert plan.after.duration < plan.before.duration


# -- time against energy


def test_the_front_leads_from_the_fastest_to_the_least_energy(
    full: OptimizationPlan, scene: PlanningScene, planner: Planner
) -> None:
    durations = np.array([point.report.duration for point in full.front])
    energies = np.array([point.report.energy for point in full.front])
    assert 5 <= len(full.front) <= 12
    assert (np.diff(durations) > 0.0).all()
    assert (np.diff(energies) < 0.0).all()
    for point in full.front:
        check_movement(point.trajectory, ends_of(scene, TASK), scene)
        measured = movement_energy(point.trajectory, scene)
        assert measured.total == point.report.energy
    fastest = optimized(full.front[-1].trajectory, scene, replace(OPTIONS, objective="time"))
    assert durations[0] <= 1.02 * fastest.after.duration
    planner.set_cell("open")
    with pytest.raises(RequestError, match="shortest"):
        planner.optimize_trajectory(
            full.front[0].trajectory, options=replace(OPTIONS, duration=0.9 * durations[0])
        )


def test_between_its_ends_the_front_costs_less_than_slowing_the_fastest(
    full: OptimizationPlan, scene: PlanningScene
) -> None:
    """Energy at each duration against the fastest movement, stretched to it."""
    fastest = full.front[0].trajectory
    assert fastest.velocities is not None
    assert fastest.accelerations is not None
    for point in full.front[1:]:
        factor = point.report.duration / fastest.duration
        slowed = JointTrajectory.from_seconds(
            fastest.joint_names,
            fastest.times * factor,
            fastest.positions,
            fastest.velocities / factor,
            fastest.accelerations / factor**2,
        )
        assert point.report.energy < movement_energy(slowed, scene).total


def test_of_two_movements_the_slower_stays_only_where_it_takes_less(full: OptimizationPlan) -> None:
    shuffled = [full.front[k] for k in np.random.default_rng(1).permutation(len(full.front))]
    assert non_dominated([*shuffled, *shuffled]) == non_dominated(list(full.front)) == full.front


# -- the rules of every request


def test_the_same_request_gives_the_same_bytes(
    detour: JointTrajectory, full: OptimizationPlan, scene_of: SceneOf
) -> None:
    again = optimized(detour, scene_of("open"), PlanOptions(planning_time=600.0))
    ids = [[point.trajectory.trajectory_id for point in plan.front] for plan in (full, again)]
    assert ids[0] == ids[1]
    assert full.trajectory == again.trajectory
    assert full.info.iterations == again.info.iterations


def test_little_work_is_a_smaller_answer_and_no_time_a_truncated_one(
    detour: JointTrajectory, full: OptimizationPlan, scene: PlanningScene
) -> None:
    little = optimized(detour, scene)
    assert little.info.iterations < full.info.iterations
    assert not little.info.truncated
    assert little.after.certified
    late = Work(400_000, time.monotonic() - 1.0, time.monotonic)
    cut = optimize_trajectory(detour, scene, OPTIONS, late, SEARCHES)
    assert cut.info.truncated
    assert cut.after.certified


@pytest.mark.parametrize("after", [0, 5, 30])
def test_a_cancel_is_heard(after: int, detour: JointTrajectory, scene: PlanningScene) -> None:
    asked = iter(range(10_000))
    options = PlanOptions(planning_time=600.0)
    with pytest.raises(CancelledError):
        optimize_trajectory(
            detour, scene, options, budget(options, lambda: next(asked) >= after), SEARCHES
        )


def test_the_answer_and_its_front_are_kept_by_id(detour: JointTrajectory, power: PowerData) -> None:
    planner = Planner("open", clock=lambda: 0.0, power=power)
    plan = planner.optimize_trajectory(
        detour, options=PlanOptions(planning_time=600.0, max_iterations=60_000)
    )
    assert plan.trajectory is not None
    for trajectory in (plan.trajectory, *(point.trajectory for point in plan.front)):
        assert planner.trajectories.get(trajectory.trajectory_id) == trajectory


# -- what can't be taken


def refused(trajectory: JointTrajectory, scene: PlanningScene, **options: Any) -> RequestError:
    with pytest.raises(RequestError) as caught:
        optimized(trajectory, scene, replace(OPTIONS, **options))
    return caught.value


@pytest.mark.parametrize(("point", "verb"), [(0, "starts"), (-1, "ends")])
def test_moving_ends_are_refused(
    point: int, verb: str, detour: JointTrajectory, scene: PlanningScene
) -> None:
    assert detour.velocities is not None
    speeds = np.array(detour.velocities)
    speeds[point, 2] = 0.25
    moving = JointTrajectory(
        detour.joint_names, detour.times_ns, detour.positions, speeds, detour.accelerations
    )
    error = refused(moving, scene)
    assert error.code == StatusCode.INVALID_MOTION_PLAN
    assert f"{verb} with velocity 0.25 rad/s of joint_a3" in str(error)


def test_ends_out_of_range_and_in_collision_are_named(scene: PlanningScene) -> None:
    ends = ends_of(scene, TASK)
    beyond = ends.copy()
    beyond[1, 0] = 7.0
    error = refused(quintic(beyond, 5.0, scene), scene)
    assert error.code == StatusCode.GOAL_STATE_INVALID
    assert "the last point" in str(error)
    inside = np.stack([ends[0], np.radians([0.0, -20.0, 60.0, 0.0, 0.0, 0.0])])
    assert scene.collision.distances(inside[1:]).min() < 0.0
    plan = optimized(quintic(inside, 5.0, scene), scene)
    assert plan.status.code == StatusCode.GOAL_IN_COLLISION
    assert "penetration" in plan.status.message
    assert plan.before.duration == pytest.approx(5.0)


def test_points_between_that_leave_the_joints_ranges_are_brought_back(scene: PlanningScene) -> None:
    ends = ends_of(scene, TASK)
    path = swung(ends, 4, 2.0 * float(scene.cell.robot.position_max[4]))
    plan = optimized(quintic(path, 30.0, scene), scene)
    assert not plan.before.certified
    check_movement(plan.trajectory, ends, scene)


def test_loops_single_points_and_too_many_are_refused(scene: PlanningScene) -> None:
    ends = ends_of(scene, TASK)
    loop = np.concatenate([ends, ends[:1]])
    assert "ends where it starts" in str(refused(quintic(loop, 20.0, scene), scene))
    assert "1 point: 2 to" in str(refused(quintic(ends[:1], 0.0, scene), scene))
    many = np.repeat(ends[:1], POINTS_MAX + 1, axis=0)
    assert f"2 to {POINTS_MAX} are taken" in str(refused(quintic(many, 60.0, scene), scene))
    assert "3600" in str(refused(quintic(ends, 3601.0, scene), scene))


def test_standing_still_is_given_back(scene: PlanningScene) -> None:
    still = quintic(np.repeat(ends_of(scene, TASK)[:1], 2, axis=0), 1.0, scene)
    plan = optimized(still, scene)
    assert plan.trajectory == still
    assert "stands still" in plan.info.stages[-1].note


def test_other_joints_are_refused(planner: Planner) -> None:
    other = JointTrajectory.from_seconds(("a", "b"), [0.0, 1.0], np.zeros((2, 2)))
    with pytest.raises(JointNamesError, match="unknown joint 'a'"):
        planner.optimize_trajectory(other)


def test_a_spline_through_points_is_taken_as_it_is_planned(planner: Planner) -> None:
    planner.set_cell("open")
    ends = ends_of(planner.scene(), TASK)
    through = planner.plan_trajectory(
        Reference(swung(ends, 1, -0.2)[::4]), options=PlanOptions(planning_time=60.0)
    )
    assert through.trajectory is not None
    plan = planner.optimize_trajectory(through.trajectory, options=OPTIONS)
    assert plan.after.certified
    assert plan.after.energy - plan.after.base_energy + 500.0 * plan.after.duration < (
        through.report.energy - through.report.base_energy + 500.0 * through.report.duration
    )
