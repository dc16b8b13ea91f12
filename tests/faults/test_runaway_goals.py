"""Goals that would make the robot run away: refused, or executed within its limits. An independent
judge.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ir_description import load_cell
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver import (
    DriverError,
    ExecutionSettings,
    Simulation,
    TrajectoryGoal,
    make_simulation,
)
from ir_sim_driver.motion.corner_rounding import rounded

BARE = replace(
    load_cell("open"), floor=False, equipment=(), stations=(), parts=(), program=(), tasks=()
)

# share: a command is judged by differences over a step, the limits hold for its derivatives
SLACK = 0.02
STEP_NOISE = 1e-3  # rad/s^2: differences of positions to 1e-16 rad, and interpolation of path time


def excesses(positions: list[np.ndarray], simulation: Simulation) -> dict[str, float]:
    """Largest use of the limits by finite differences of executed positions (K, n), one per step of
    dt.
    """
    q = np.array(positions)
    robot = simulation.robot
    dt = simulation.settings.dt
    speed = np.diff(q, axis=0) / dt
    change = np.diff(speed, axis=0) / dt
    beyond = np.maximum(q - robot.position_max, robot.position_min - q)
    return {
        "position": float(beyond.max()),
        "velocity": float((np.abs(speed) / robot.velocity_max).max(initial=0.0)),
        "acceleration": float(
            ((np.abs(change) - STEP_NOISE) / robot.acceleration_max).max(initial=0.0)
        ),
    }


def within(found: dict[str, float]) -> bool:
    return found["position"] < 1e-5 and max(found["velocity"], found["acceleration"]) < 1.0 + SLACK


def execute(simulation: Simulation, trajectory: JointTrajectory, **goal: Any) -> bool:
    """Start a goal; False when it is refused."""
    try:
        simulation.execute(simulation.vet(TrajectoryGoal(trajectory, **goal), 1), 1)
    except DriverError:
        return False
    return True


def ride(simulation: Simulation, seconds: float) -> list[np.ndarray]:
    positions = [simulation.backend.q.copy()]
    for _ in range(round(seconds / simulation.settings.dt)):
        simulation.step()
        positions.append(simulation.backend.q.copy())
    return positions


@pytest.fixture
def simulation() -> Simulation:
    return make_simulation(BARE, backend="ideal")


def trajectory(
    simulation: Simulation, times: Any, points: Any, *derivatives: Any
) -> JointTrajectory:
    return JointTrajectory.from_seconds(simulation.robot.joint_names, times, points, *derivatives)


@pytest.mark.parametrize("length", [1e-9, 1e-6, 1e-4, 1e-3])
@pytest.mark.parametrize("kind", ["linear", "cubic", "quintic"])
def test_a_radian_in_a_millisecond_is_refused_however_it_is_interpolated(
    simulation: Simulation, length: float, kind: str
) -> None:
    q = simulation.backend.q
    rest = np.zeros((2, 6))
    more = {"linear": (), "cubic": (rest,), "quintic": (rest, rest)}[kind]
    assert not execute(simulation, trajectory(simulation, [0.0, length], [q, q + 1.0], *more))
    assert within(excesses(ride(simulation, 0.05), simulation))


@pytest.mark.parametrize("joint", range(6))
def test_five_percent_more_than_an_axis_may_accelerate_is_refused(
    simulation: Simulation, joint: int
) -> None:
    q = simulation.backend.q
    rest = np.zeros((2, 6))
    angle = 0.2
    most = 1.05 * simulation.robot.acceleration_max[joint]
    time = (10.0 / np.sqrt(3.0) * angle / most) ** 0.5  # of a quintic from rest to rest
    there = q + angle * np.eye(6)[joint]
    with pytest.raises(DriverError, match=r"needs .* rad/s\^2"):
        simulation.vet(
            TrajectoryGoal(trajectory(simulation, [0.0, time], [q, there], rest, rest)), 1
        )


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("joint", range(6))
def test_five_percent_more_than_an_axis_may_turn_is_refused_in_either_direction(
    simulation: Simulation, joint: int, sign: float
) -> None:
    q = simulation.backend.q
    rest = np.zeros((2, 6))
    angle = 0.2
    time = (
        1.875 * angle / (1.05 * simulation.robot.velocity_max[joint])
    )  # of a quintic from rest to rest
    there = q + sign * angle * np.eye(6)[joint]
    with pytest.raises(DriverError, match=r"needs .* rad/s at"):
        simulation.vet(
            TrajectoryGoal(trajectory(simulation, [0.0, time], [q, there], rest, rest)), 1
        )


def test_what_leads_in_keeps_the_limits_too(simulation: Simulation) -> None:
    """A trajectory of one point is nothing but its lead-in."""
    q = simulation.backend.q
    rest = np.zeros((1, 6))
    assert not execute(simulation, trajectory(simulation, [0.1], [q + 0.3], rest, rest))
    assert execute(simulation, trajectory(simulation, [2.0], [q + 0.3], rest, rest))
    assert within(excesses(ride(simulation, 2.2), simulation))


def test_what_happens_between_milliseconds_is_seen(simulation: Simulation) -> None:
    """A spike of 0.4 ms, at rest at every whole millisecond."""
    q = simulation.backend.q
    points = [q, q, q + 0.01, q, q]
    times = [0.0, 1.0001, 1.0003, 1.0005, 2.0]
    rest = np.zeros((5, 6))
    assert not execute(simulation, trajectory(simulation, times, points, rest, rest))


def test_long_paths_are_checked_as_finely_as_short_ones(simulation: Simulation) -> None:
    q = simulation.backend.q
    rest = np.zeros((4, 6))
    points = [q, q + 0.1, q + 0.13, q + 0.13]  # 30 mrad in 4 ms, in the middle of an hour
    assert not execute(
        simulation, trajectory(simulation, [0.0, 1800.0, 1800.004, 3600.0], points, rest, rest)
    )


def test_many_small_jumps_are_bounded_in_rate(simulation: Simulation) -> None:
    """Each corner alone is allowed; a zigzag of them every millisecond is not."""
    q = simulation.backend.q
    limit = simulation.robot.acceleration_max
    step = 0.45 * 0.02 * limit * 1e-3
    points = [q + (k % 2) * step * (k > 0) + 0.6 * step * k for k in range(200)]
    zigzag = trajectory(simulation, 1e-3 * np.arange(200.0), points)
    if execute(simulation, zigzag):
        assert within(excesses(ride(simulation, 0.5), simulation))


def test_positions_alone_are_executed_within_the_limits_and_arrive(simulation: Simulation) -> None:
    q = simulation.backend.q
    t = np.arange(0.0, 3.0, 0.01)
    points = q + (0.2 * (1.0 - np.cos(np.pi * t / t[-1])))[:, None]
    assert execute(simulation, trajectory(simulation, t, points))
    assert within(excesses(ride(simulation, 3.2), simulation))
    assert np.abs(simulation.backend.q - points[-1]).max() < 1e-9


def test_rounded_corners_are_the_mean_over_the_blend_time(simulation: Simulation) -> None:
    q = simulation.backend.q
    given = trajectory(simulation, [0.5, 1.0, 1.5], [q, q + 0.015, q])
    settings = ExecutionSettings()
    blend = settings.blend_time
    executed = rounded(given, simulation.robot, settings)
    assert executed.window == blend
    smooth = executed.trajectory
    for instant in (0.51, 0.8, 1.0, 1.005, 1.013, 1.02, 1.3, 1.5, 1.51):
        u = instant - blend + (np.arange(2000) + 0.5) * blend / 2000.0
        first = q + (u[:, None] - 0.5) * 0.03  # before the first point the first line goes on
        line = np.where(u[:, None] < 0.5, first, given.sample(u).q)
        assert np.abs(smooth.sample(np.array([instant])).q[0] - line.mean(axis=0)).max() < 1e-8


def test_a_first_velocity_at_rest_is_reached_by_a_bridge(simulation: Simulation) -> None:
    q = simulation.backend.q
    allowed = 0.019 * simulation.robot.acceleration_max
    v = np.array([allowed, np.zeros(6)])
    points = [q, q + 0.5 * allowed]
    assert execute(simulation, trajectory(simulation, [0.0, 1.0], points, v))
    assert within(excesses(ride(simulation, 1.5), simulation))


def test_a_first_velocity_at_rest_beyond_the_bridge_is_refused(simulation: Simulation) -> None:
    q = simulation.backend.q
    v = np.zeros((2, 6))
    v[0] = 0.021 * simulation.robot.acceleration_max
    goal = TrajectoryGoal(trajectory(simulation, [0.0, 1.0], [q, q + 0.5 * v[0]], v))
    with pytest.raises(DriverError, match="against the command"):
        simulation.execute(simulation.vet(goal, 1), 1)


def test_a_movement_that_is_replaced_by_a_later_one_does_not_stop_dead(
    simulation: Simulation,
) -> None:
    q = simulation.backend.q
    rest = np.zeros((2, 6))
    assert execute(simulation, trajectory(simulation, [0.0, 2.0], [q, q + 0.5], rest, rest))
    positions = ride(simulation, 1.0)
    later = trajectory(simulation, [2.0], [q], rest[:1])
    assert execute(simulation, later, stamp_ns=1 + 500_000_000)
    positions += ride(simulation, 2.4)[1:]
    assert np.abs(simulation.backend.q - q).max() > 1e-6, "it arrives at its stamp, not before"
    assert within(excesses(positions + ride(simulation, 0.2)[1:], simulation))
    assert np.abs(simulation.backend.q - q).max() < 1e-9


def random_goal(
    simulation: Simulation, generator: np.random.Generator
) -> tuple[JointTrajectory, int]:
    """Goals of all kinds: spacings from a nanosecond to minutes, every interpolation, lead-ins,
    stamps.
    """
    count = int(generator.integers(1, 8))
    spacing = 10.0 ** generator.uniform(-9.0, 1.5, count)
    times = np.cumsum(spacing) + 1e-9 * np.arange(count)
    if generator.random() < 0.5:
        times = times - times[0]
    scale = 10.0 ** generator.uniform(-8.0, 0.3, (count, 1))
    points = simulation.executor.command + scale * generator.normal(size=(count, 6))
    if generator.random() < 0.6:  # timed so that some are accepted
        times = (
            times[0]
            + np.concatenate(([0.0], np.cumsum(np.abs(np.diff(points, axis=0)).max(axis=1)))) * 3.0
        )
        times = times + 0.2 * np.arange(count)
        points[0] = simulation.executor.command if times[0] == 0.0 else points[0]
    velocities = 10.0 ** generator.uniform(-6.0, 0.5, (count, 1)) * generator.normal(
        size=(count, 6)
    )
    velocities[-1] = 0.0
    accelerations = 10.0 ** generator.uniform(-6.0, 1.0, (count, 1)) * generator.normal(
        size=(count, 6)
    )
    quiet = generator.random() < 0.5
    more: list[Any] = [None, None]
    kind = int(generator.integers(3))
    if kind > 0:
        more[0] = 0.0 * velocities if quiet else velocities
    if kind > 1:
        more[1] = 0.0 * accelerations if quiet else accelerations
    delay = int(generator.choice([0, 0, 1 + 200_000_000]))
    return trajectory(simulation, times, points, *more), delay


def judged(cases: int, seed: int) -> tuple[int, list[str]]:
    """Accepted goals, and what the judge found beyond a limit."""
    generator = np.random.default_rng(seed)
    settings = ExecutionSettings()
    accepted = 0
    beyond = []
    simulation = make_simulation(BARE, backend="ideal")
    positions = [simulation.backend.q.copy()]
    for case in range(cases):
        if case % 50 == 0 or simulation.fault:
            simulation = make_simulation(BARE, backend="ideal")
            positions = [simulation.backend.q.copy()]
        try:
            goal, stamp = random_goal(simulation, generator)
        except ValueError:
            continue
        if not execute(simulation, goal, stamp_ns=stamp):
            continue
        accepted += 1
        positions += ride(
            simulation, min(2.0, settings.stop_time + generator.uniform(0.0, goal.duration))
        )[1:]
        simulation.set_speed_scaling(float(generator.choice([0.0, 0.3, 1.0, 1.0])))
        positions += ride(simulation, 0.3)[1:]
        simulation.set_speed_scaling(1.0)
        found = excesses(positions, simulation)
        if not within(found):
            beyond.append(f"case {case} of seed {seed}: {found}")
        positions = positions[-3:]
    return accepted, beyond


def test_a_hundred_random_goals_keep_the_limits() -> None:
    accepted, beyond = judged(150, seed=1)
    assert beyond == []
    assert accepted >= 10, "too few goals were accepted: nothing was judged"


@pytest.mark.long
@pytest.mark.parametrize("seed", range(8))
def test_ten_thousand_random_goals_keep_the_limits(seed: int) -> None:
    _, beyond = judged(1_250, seed=100 + seed)
    assert beyond == []
