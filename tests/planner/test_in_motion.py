"""Laws: a movement in motion has at its ends what was asked, keeps every limit and distance, takes
no longer than stopping first, and continues what is driven without a jump.

Judges: Pinocchio and samples at 10 kHz (limits, torque), Coal (distances), SciPy's Hermite
polynomials (continuity), a step-by-step integration (braking).
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import BPoly

from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import MovementPlan, Planner, RequestError
from ir_planner.regional.in_motion import MovingEnd, braking, stopping_distance
from ir_planner.request import Context, Journal, Work
from ir_values.arrays import FloatArray
from ir_values.errors import TrajectoryError

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judges
from _coal_model import Coal
from _second_opinion import SecondOpinion

MARGIN = 0.02  # m
_INSTANTS = 400
_ROUNDED = 1e-5  # m between two codes
# times the duration of the stop and go whose second half had the work of a whole plan
_NEARLY = 1.15


@pytest.fixture(
    scope="module",
    params=[
        *(pytest.param(cell, marks=pytest.mark.long) for cell in ("open", "table_columns")),
        "kr6_bench",
    ],
)
def planner(request: pytest.FixtureRequest) -> Planner:
    return Planner(request.param, clock=lambda: 0.0)


def free_states(planner: Planner, draw: np.random.Generator, count: int) -> FloatArray:
    robot = planner.cell.robot
    found: list[FloatArray] = []
    while len(found) < count:
        q = draw.uniform(robot.position_min, robot.position_max, (64, robot.n))
        found += list(q[planner.check_states(q).valid])
    return np.array(found[:count])


def driven(planner: Planner, seed: int) -> tuple[JointTrajectory, float, FloatArray]:
    """A movement, a time on it, and another goal."""
    draw = np.random.default_rng(seed)
    while True:
        start, first, other = free_states(planner, draw, 3)
        plan = planner.plan_regional(start=start, goal=first, objective="time")
        if plan.trajectory is not None:
            at = round(plan.trajectory.duration * draw.uniform(0.1, 0.9), 9)
            return plan.trajectory, at, other


def judged(planner: Planner, trajectory: JointTrajectory) -> None:
    scene = planner.scene()
    assert SecondOpinion(scene).largest_share(trajectory) <= 1.0 + 1e-6
    loads = [capsule for load in scene.loads for capsule in load.capsules]
    judge = Coal(scene.collision, [*scene.cell.robot.capsules, *loads], scene.cell.bodies())
    q = trajectory.sample(np.linspace(0.0, trajectory.duration, _INSTANTS)).q
    for one in q:
        assert (judge.distances(one) > scene.thresholds(MARGIN) - _ROUNDED).all()


def hermite(trajectory: JointTrajectory) -> BPoly:
    values = np.stack(
        [trajectory.positions, trajectory.velocities, trajectory.accelerations], axis=1
    )
    return BPoly.from_derivatives(trajectory.times, values)


def replanned(planner: Planner, seed: int) -> tuple[JointTrajectory, float, MovementPlan]:
    before, at, goal = driven(planner, seed)
    return before, at, planner.replan(before, at, goal=goal, objective="time")


@pytest.mark.parametrize("seeds", [range(3), pytest.param(range(3, 20), marks=pytest.mark.long)])
def test_what_continues_a_movement_is_certified_and_has_no_jump(
    planner: Planner, seeds: range
) -> None:
    found = 0
    for seed in seeds:
        before, at, plan = replanned(planner, seed)
        if plan.trajectory is None:
            assert plan.status.code == StatusCode.PLANNING_FAILED
            continue
        found += 1
        assert plan.report.certified
        judged(planner, plan.trajectory)
        left = hermite(before)
        right = hermite(plan.trajectory)
        for order, most in enumerate((1e-9, 1e-9, 1e-7)):
            there = left.derivative(order)(at) if order else left(at)
            assert np.abs(right(0.0, nu=order) - there).max() <= most
        whole = hermite(before.until(at).then(plan.trajectory))
        t = np.linspace(0.0, at, 50)
        assert np.abs(whole(t) - left(t)).max() <= 1e-9
        t = np.linspace(0.0, plan.trajectory.duration, 50)
        assert np.abs(whole(t + round(at * 1e9) * 1e-9) - right(t)).max() <= 1e-9
    assert found >= 0.6 * len(seeds)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_stopping_first_takes_no_less_time(planner: Planner, seed: int) -> None:
    before, at, plan = replanned(planner, seed)
    if plan.trajectory is None:
        pytest.skip("nothing leads on from there")
    state = before.sample([at])
    work = Work(1000, 1.0, lambda: 0.0)
    context = Context(planner.scene(), PlanOptions(), Journal(work, 0))
    end = MovingEnd(*(values[0] for values in state[:3]), "start", StatusCode.START_STATE_INVALID)
    stop = braking(end, context)
    assert stop is not None
    again = planner.plan_regional(
        start=stop.positions[-1], goal=plan.trajectory.positions[-1], objective="time"
    )
    if again.trajectory is not None and planner.evaluate(stop).report.min_clearance > MARGIN:
        assert plan.trajectory.duration <= _NEARLY * (stop.duration + again.trajectory.duration)


def test_both_ends_have_the_motion_that_was_asked_for(planner: Planner) -> None:
    before, _, _ = driven(planner, 11)
    at = 0.25 * before.duration
    until = 0.7 * before.duration
    state = before.sample([at, until])
    plan = planner.plan_regional(
        start=state.q[0],
        start_velocity=state.qd[0],
        start_acceleration=state.qdd[0],
        goal=state.q[1],
        goal_velocity=state.qd[1],
        goal_acceleration=state.qdd[1],
        objective="time",
    )
    assert plan.trajectory is not None, plan.status.message
    assert plan.report.certified
    judged(planner, plan.trajectory)
    ends = plan.trajectory
    for values, asked in zip(
        (ends.positions, ends.velocities, ends.accelerations), state[:3], strict=True
    ):
        assert np.abs(values[[0, -1]] - asked).max() <= 1e-9


def test_rest_asked_for_in_words_or_in_zeros_gives_the_same_bytes(planner: Planner) -> None:
    n = planner.cell.robot.n
    words = planner.plan_regional(goal="park").trajectory
    none = np.zeros(n)
    zeros = planner.plan_regional(
        goal="park", start_velocity=none, start_acceleration=none, goal_velocity=none
    ).trajectory
    assert words == zeros


def test_the_same_request_in_motion_gives_the_same_bytes(planner: Planner) -> None:
    before, at, goal = driven(planner, 3)
    first = planner.replan(before, at, goal=goal)
    assert first.trajectory == planner.replan(before, at, goal=goal).trajectory


def refused(planner: Planner, **asked: FloatArray) -> str:
    with pytest.raises(RequestError) as caught:
        planner.plan_regional(goal="park", **asked)
    return str(caught.value)


def test_what_no_movement_can_do_is_refused_with_axis_value_and_bound(planner: Planner) -> None:
    robot = planner.cell.robot
    q = np.array(robot.machine_home)
    fast = np.zeros(robot.n)
    fast[0] = 1.5 * robot.velocity_max[0]
    sentence = refused(planner, start=q, start_velocity=fast)
    assert f"{robot.joint_names[0]} has velocity {fast[0]:.6g} rad/s" in sentence
    assert f"at most {robot.velocity_max[0]:.6g} rad/s" in sentence
    near = q.copy()
    near[0] = robot.position_max[0] - 0.01
    fast[0] = 0.9 * robot.velocity_max[0]
    sentence = refused(planner, start=near, start_velocity=fast)
    assert robot.joint_names[0] in sentence
    assert "0.573 deg are left to its limit" in sentence
    assert planner.plan_regional(goal="park", start=near, start_velocity=-fast).status.ok
    gaining = 0.999 * robot.velocity_max[0] * np.eye(robot.n)[0]
    harder = 0.9 * robot.acceleration_max[0] * np.eye(robot.n)[0]
    sentence = refused(planner, start=q, start_velocity=gaining, start_acceleration=harder)
    assert "it reaches" in sentence
    with pytest.raises(RequestError, match="a pose is reached at rest"):
        planner.plan_regional(goal=planner.scene().chain.tcp_poses(q[None])[0], goal_velocity=fast)
    with pytest.raises(RequestError, match="start_velocity has shape"):
        planner.plan_regional(goal="park", start_velocity=np.zeros(3))
    with pytest.raises(RequestError, match="must be finite"):
        planner.plan_regional(goal="park", start_velocity=np.full(robot.n, np.nan))


def test_a_braking_joint_goes_on_as_far_as_was_said() -> None:
    draw = np.random.default_rng(0)
    step = 1e-5
    for _ in range(60):
        most = draw.uniform(1.0, 8.0)
        jerk = draw.uniform(20.0, 400.0)
        v = draw.uniform(-2.0, 3.0)
        a = draw.uniform(-1.0, 1.0) * most
        times = np.arange(0.0, 6.0, step)
        braking = np.maximum(a - jerk * times, -most)
        speed = v + np.cumsum(braking) * step
        places = np.cumsum(speed) * step
        assert stopping_distance(v, a, most, jerk) == pytest.approx(
            max(places.max(), 0.0), abs=1e-3 * max(abs(v), 1.0)
        )


def test_a_cut_is_the_same_motion_and_what_begins_elsewhere_is_not_joined(planner: Planner) -> None:
    before, at, _ = driven(planner, 2)
    with pytest.raises(TrajectoryError, match="lasts from 0 to"):
        before.until(before.duration + 1.0)
    with pytest.raises(TrajectoryError, match="from where it was"):
        before.until(at).then(before)
    points = JointTrajectory(before.joint_names, before.times_ns, before.positions)
    with pytest.raises(TrajectoryError, match="no accelerations"):
        points.until(at)
    again = before.until(before.duration)
    assert again == before
