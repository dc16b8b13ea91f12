"""No answer is worse than the baseline movement, and no duration from the fastest on is refused.

The baseline is timed here anew, with torques by Pinocchio.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from asking import planned
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from oracles import torques

from ir_msgs_py.options import PlanOptions
from ir_planner import Planner
from ir_planner.regional import MovementPlan
from ir_planner.request.context import Work
from ir_planner.scene.planning_scene import PlanningScene
from ir_values.arrays import FloatArray

SceneOf = Callable[[str], PlanningScene]
CELLS = st.sampled_from(["demo", "cnc_door", "deep_box", "open"])


def ask(scene: PlanningScene, ends: FloatArray, options: PlanOptions) -> MovementPlan:
    work = Work(400_000, 1.0, lambda: 0.0, improvement=1000)
    return planned(ends[0], ends[1], scene, options, work)


def free_ends(scene: PlanningScene, seed: int) -> FloatArray:
    """Two configurations (2, n) with a free straight segment between them."""
    rng = np.random.default_rng(seed)
    robot = scene.cell.robot
    threshold = scene.thresholds(0.02) + 1e-3
    share = np.linspace(0.0, 1.0, 200)[:, None]
    while True:
        ends = np.array(scene.cell.park) + rng.uniform(-0.8, 0.8, (2, robot.n))
        ends = np.clip(ends, robot.position_min, robot.position_max)
        if (scene.collision.distances(ends[0] + share * (ends[1] - ends[0])) > threshold).all():
            return np.asarray(ends)


def s_curve(count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """s, s', s'' (count, 1) over one second of a seven-phase law whose ramps take all of it: three
    eighths of it for each, a quarter of constant speed; by integrating its jerk.
    """
    jerk = np.repeat([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0], [2, 2, 2, 4, 2, 2, 2])
    fine = np.repeat(jerk, 2000)
    step = 1.0 / len(fine)
    acceleration = np.cumsum(fine) * step
    speed = np.cumsum(acceleration) * step
    s = np.cumsum(speed) * step
    at = ((np.arange(count) + 0.5) / count * len(fine)).astype(int)
    return tuple((x[at] / s[-1])[:, None] for x in (s, speed, acceleration))  # type: ignore[return-value]


def drive_joules(scene: PlanningScene, ends: FloatArray, duration: float) -> float:
    """Joules of the drives for the straight segment by a seven-phase S-curve, without sharing on
    the bus
    losses of the brake resistor: braking energy is lost where nobody takes it.
    """
    s, speed, acceleration = s_curve(2000)
    delta = ends[1] - ends[0]
    q = ends[0] + s * delta
    qd = speed * delta / duration
    qdd = acceleration * delta / duration**2
    torque = torques(scene, q, qd, qdd)
    power = scene.dynamics.axis_power(qd, torque).sum(axis=1)
    return float(np.maximum(power, 0.0).sum() * duration / len(s))


@settings(
    max_examples=4, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(cell=CELLS, seed=st.integers(0, 10_000), factor=st.floats(1.3, 4.0))
def test_no_answer_costs_more_than_an_s_curve_at_its_duration(
    cell: str, seed: int, factor: float, scene_of: SceneOf
) -> None:
    scene = scene_of(cell)
    ends = free_ends(scene, seed)
    fastest = ask(scene, ends, PlanOptions(objective="time"))
    assert fastest.status.ok
    duration = round(factor * fastest.report.duration, 3)
    plan = ask(scene, ends, PlanOptions(duration=duration))
    assert plan.status.ok, plan.status.message
    assert plan.report.duration == pytest.approx(duration, abs=1e-6)
    drives = plan.report.energy - plan.report.base_energy
    # the S-curve of another shape is no candidate, so what is between the two shapes is allowed
    assert drives <= 1.02 * drive_joules(scene, ends, duration) + scene.dc_bus.capacity_energy


@settings(
    max_examples=3, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(cell=CELLS, seed=st.integers(0, 10_000))
def test_every_duration_from_the_fastest_on_is_met(cell: str, seed: int, scene_of: SceneOf) -> None:
    scene = scene_of(cell)
    ends = free_ends(scene, seed)
    fastest = ask(scene, ends, PlanOptions(objective="time")).report
    free = ask(scene, ends, PlanOptions()).report
    assert free.duration >= fastest.duration * (1.0 - 1e-9)
    for duration in (1.001 * fastest.duration, 1.2 * free.duration):
        plan = ask(scene, ends, PlanOptions(duration=duration))
        assert plan.status.ok, plan.status.message
        assert plan.report.duration == pytest.approx(duration, rel=2e-6)


def test_a_movement_to_where_it_starts_takes_the_requested_duration(
    demo_scene: PlanningScene,
) -> None:
    home = np.array(demo_scene.cell.park)
    plan = ask(demo_scene, np.stack([home, home]), PlanOptions(duration=2.5))
    assert plan.status.ok
    assert plan.report.duration == 2.5
    assert ask(demo_scene, np.stack([home, home]), PlanOptions()).report.duration < 0.01


@settings(
    max_examples=3, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(cell=CELLS, seed=st.integers(0, 10_000), planner_id=st.sampled_from(["", "direct"]))
def test_asynchronous_joints_never_take_longer_and_the_answer_names_its_timing(
    cell: str, seed: int, planner_id: str, scene_of: SceneOf
) -> None:
    scene = scene_of(cell)
    ends = free_ends(scene, seed)
    synchronous = PlanOptions(objective="time", planner_id=planner_id)
    common = ask(scene, ends, synchronous)
    own = ask(scene, ends, replace(synchronous, timing="asynchronous"))
    assert own.status.ok
    assert own.report.certified
    assert own.report.duration <= common.report.duration
    note = next(stage.note for stage in own.info.stages if stage.name == "asynchronous")
    assert own.trajectory is not None
    assert common.info.timing == "synchronous"
    if own.trajectory == common.trajectory:
        assert own.info.timing == "synchronous"
        assert "synchronous" in note
    else:
        assert own.info.timing == "asynchronous"


@pytest.mark.parametrize("cell", ["open", "table_columns", "deep_box"])
@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 4))]
)
def test_movement_cost_is_no_more_than_that_of_the_answer_for_energy(cell: str, seed: int) -> None:
    planner = Planner(cell, clock=lambda: 0.0)
    robot = planner.cell.robot
    draw = np.random.default_rng([seed, 17])
    ends: list[np.ndarray] = []
    while len(ends) < 2:
        q = draw.uniform(0.7 * robot.position_min, 0.7 * robot.position_max)
        q = np.clip(q, robot.position_min, robot.position_max)
        if planner.check_state(q).valid:
            ends.append(q)
    start, goal = ends
    cheapest = planner.plan_regional(start=start, goal=goal)
    if not cheapest.status.ok:
        pytest.skip("no path")
    least = planner.plan_regional(start=start, goal=goal, objective="movement_cost")
    assert least.report.movement_cost <= cheapest.report.movement_cost * (1.0 + 1e-9)
