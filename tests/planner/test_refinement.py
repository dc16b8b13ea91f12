"""Path and time scaling, optimised together: better than what they came from, within every
bound.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from asking import planned
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from ir_msgs_py.options import PlanOptions
from ir_planner.checks.evaluation import evaluate_trajectory
from ir_planner.curves.uniform_spline import UniformSpline, along_path
from ir_planner.errors import RequestError
from ir_planner.optimize.refinement import Refinement, movement_over
from ir_planner.request.context import Context, Work
from ir_planner.scene.planning_scene import PlanningScene
from ir_planner.service.service_movement import ServiceRequest, plan_service
from ir_planner.timing.objective import coarse_cost, objective_value
from ir_planner.timing.straight_steps import straight_steps

SceneOf = Callable[[str], PlanningScene]
FloatArray = NDArray[np.float64]


def unhurried() -> Work:
    return Work(400_000, 1.0, lambda: 0.0)


def random_spline(count: int = 9, interval: float = 0.07) -> UniformSpline:
    rng = np.random.default_rng(3)
    ends = rng.uniform(-1.0, 1.0, (2, 6))
    inner = rng.uniform(-1.0, 1.0, (count, 6))
    control = np.concatenate(
        [np.repeat(ends[:1], 3, axis=0), inner, np.repeat(ends[1:], 3, axis=0)]
    )
    return UniformSpline(control, interval)


def test_the_trajectory_of_a_spline_is_the_spline() -> None:
    spline = random_spline()
    trajectory = spline.trajectory(tuple("abcdef"))
    knots = (np.arange(len(spline.control) + 4) - 3) * spline.interval
    reference = BSpline(knots, spline.control, 3)
    t = np.linspace(0.0, trajectory.duration, 500)
    motion = trajectory.sample(t)
    assert np.abs(motion.q - reference(t)).max() < 1e-6  # times are whole nanoseconds
    assert np.abs(motion.qd - reference.derivative()(t)).max() < 1e-5
    assert trajectory.velocities is not None
    assert not np.any(trajectory.velocities[[0, -1]])
    assert trajectory.accelerations is not None
    assert not np.any(trajectory.accelerations[[0, -1]])
    assert np.array_equal(trajectory.positions[[0, -1]], spline.control[[0, -1]])


def test_extremes_of_a_spline_are_those_of_dense_samples() -> None:
    spline = random_spline()
    top = spline.extremes()
    _, qd, qdd = spline.samples(400)
    jerk = np.diff(spline.knots()[2], axis=0) / spline.interval
    for largest, values in ((top.velocity, qd), (top.acceleration, qdd), (top.jerk, jerk)):
        assert (largest >= np.abs(values).max(axis=0) - 1e-9).all()
        assert largest == pytest.approx(np.abs(values).max(axis=0), rel=1e-3)


def test_a_finer_spline_is_the_same_motion_and_keeps_its_ends() -> None:
    spline = random_spline()
    finer = spline.subdivided().subdivided()
    assert finer.interval == spline.interval / 4
    assert np.abs(finer.samples(1)[0][::4] - spline.samples(1)[0]).max() < 1e-12
    assert np.array_equal(finer.control[:3], spline.control[:3])
    assert np.array_equal(finer.control[-3:], spline.control[-3:])


def test_a_spline_along_a_path_stays_near_it_and_rests_at_its_ends() -> None:
    path = np.array([[0.0] * 6, [1.0, 0.5, 0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 0.5, 0.0, 0.0, 0.0]])
    spline = along_path(path, 60, 2.0)
    q, _, _ = spline.samples(5)
    places = np.concatenate(
        [a + np.linspace(0, 1, 400)[:, None] * (b - a) for a, b in itertools.pairwise(path)]
    )
    assert max(np.abs(places - row).max(axis=1).min() for row in q) < 0.02
    assert spline.duration == pytest.approx(2.0)


@pytest.mark.parametrize("objective", ["time_and_energy", "time", "energy", "movement_cost"])
def test_refined_is_better_than_the_same_path_in_straight_steps(
    objective: str, demo_scene: PlanningScene
) -> None:
    path = np.radians(
        [[0, -125, 120, 0, 80, 0], [40, -100, 100, 20, 60, 0], [70, -90, 80, 0, 40, 30]]
    )
    options = PlanOptions(objective=objective, safety_distance=0.0, time_value=500.0)
    refined = movement_over(path, Context.of(demo_scene, options, unhurried()))
    straight = straight_steps(path, Context.of(demo_scene, options, unhurried()))
    assert refined.prove().violation is None
    value, before = (
        objective_value(m.report, objective, options.time_value) for m in (refined, straight)
    )
    assert value < before
    assert coarse_cost(refined.trajectory, refined.context) == pytest.approx(value, rel=0.01)


def test_j_counts_the_drives_and_not_the_base_load(demo_scene: PlanningScene) -> None:
    path = np.radians([[0, -90, 90, 0, 0, 0], [30, -100, 100, 0, 20, 0]])
    report = movement_over(
        path, Context.of(demo_scene, PlanOptions(safety_distance=0.0), unhurried())
    ).report
    drives = float(np.sum(report.joint_energy)) + report.burnt_energy
    value = objective_value(report, "time_and_energy", 500.0)
    assert value == pytest.approx(report.energy - report.base_energy + 500.0 * report.duration)
    assert (
        value - 500.0 * report.duration >= drives - 1e-6
    )  # what is left in the capacitor is not credited


def test_a_movement_at_the_joint_limits_stays_within_them(scene_of: SceneOf) -> None:
    scene = scene_of("open")
    robot = scene.cell.robot
    start = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
    goal = np.radians([20.0, -100.0, 100.0, 0.0, 0.0, 0.0])
    start[3] = robot.position_max[3]
    goal[3] = robot.position_max[3]
    start[5] = robot.position_min[5]
    goal[5] = robot.position_min[5]
    plan = planned(start, goal, scene, PlanOptions(safety_distance=0.0), unhurried())
    assert plan.status.ok, plan.status.message
    assert plan.trajectory is not None
    assert not plan.info.rejected
    assert (plan.trajectory.positions <= robot.position_max).all()
    assert (plan.trajectory.positions >= robot.position_min).all()


def test_joules_fall_with_the_requested_duration_and_it_is_met(demo_scene: PlanningScene) -> None:
    path = np.radians([[0, -90, 90, 0, 0, 0], [60, -100, 100, 0, 20, 0]])
    options = PlanOptions(objective="time", safety_distance=0.0)
    fastest = movement_over(path, Context.of(demo_scene, options, unhurried())).trajectory.duration
    joules = []
    for factor in (1.02, 1.2, 1.6):
        requested = replace(options, duration=factor * fastest)
        movement = movement_over(path, Context.of(demo_scene, requested, unhurried()))
        assert movement.prove().violation is None
        assert movement.trajectory.duration == pytest.approx(factor * fastest, rel=2e-6)
        report = movement.report
        joules.append(report.energy - report.base_energy)
    assert joules == sorted(joules, reverse=True)
    with pytest.raises(RequestError, match="the shortest found within the limits is"):
        movement_over(
            path, Context.of(demo_scene, replace(options, duration=0.7 * fastest), unhurried())
        )


def test_a_coarse_solution_costs_no_more_with_more_work(demo_scene: PlanningScene) -> None:
    path = np.radians([[0, -90, 90, 0, 0, 0], [60, -100, 100, 0, 20, 0]])
    costs = []
    for evaluations in (10, 40, 160):
        budget = unhurried()
        refinement = Refinement(Context.of(demo_scene, PlanOptions(safety_distance=0.0), budget))
        costs.append(refinement.coarse(path, evaluations).cost)
        assert budget.iterations > 0
    assert costs == sorted(costs, reverse=True)


def test_a_station_s_contacts_hold_in_its_zone_only(scene_of: SceneOf) -> None:
    scene = scene_of("demo")
    stations = [s for s in scene.cell.stations if s.allowed_contacts]
    assert stations
    for station in stations[:2]:
        request = ServiceRequest(station, "exit", None, np.array(scene.cell.park), 1)
        context = Context.of(scene, PlanOptions(), unhurried())
        plan = plan_service(request, context)
        assert plan.status.ok, plan.status.message
        trajectory = plan.candidates[0].trajectory
        assert trajectory is not None
        assert evaluate_trajectory(trajectory, scene, 0.02, station.name).verification.certified
