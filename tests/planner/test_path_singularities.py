"""Lines beside singularities and stairs of short lines: driven as slowly as the axes need, never a
crash, never slower because more speed is asked for.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

MARGIN = 0.02  # m
_TURN = 0.15  # rad that an axis turns in one step of the oracle, at most
_FINEST = 1e-9  # share of the line
KINDS = ("wrist", "arm", "shoulder")


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner("open", clock=lambda: 0.0)


def singular(rng: np.random.Generator, kind: str, scene: PlanningScene) -> FloatArray:
    """A configuration whose axes 4 and 6 are one line, whose arm is stretched, or whose wrist lies
    on axis 1.
    """
    robot = scene.cell.robot
    q = rng.uniform(0.8 * robot.position_min, 0.8 * robot.position_max)
    q[[0, 3, 5]] = rng.uniform(-2.0, 2.0, 3)
    if kind == "wrist":
        q[4] = 0.0
        return np.asarray(q)
    q[4] = rng.uniform(0.3, 1.8) * rng.choice([-1, 1])
    axis = 2 if kind == "arm" else 1
    values = np.linspace(robot.position_min[axis], robot.position_max[axis], 4001)
    every = np.tile(q, (len(values), 1))
    every[:, axis] = values
    links = scene.chain.link_poses(every)[:, :, :3, 3]
    reach = np.linalg.norm(links[:, 4] - links[:, 1], axis=1)
    beside = np.hypot(links[:, 4, 0], links[:, 4, 1])
    q[axis] = values[reach.argmax() if kind == "arm" else beside.argmin()]
    return np.asarray(q)


def beside_a_singularity(seed: int, scene: PlanningScene) -> CartesianPath:
    """A line of 20 to 300 mm that passes one by 0.01 to 5 mm, its ends free."""
    rng = np.random.default_rng(seed)
    while True:
        pose = scene.chain.tcp_poses(singular(rng, KINDS[seed % 3], scene)[None])[0]
        ahead, aside, _ = Rotation.random(random_state=rng).as_matrix()
        place = pose[:3, 3] + 10.0 ** rng.uniform(-5.0, np.log10(5e-3)) * aside
        length = rng.uniform(0.02, 0.3)
        share = rng.uniform(0.2, 0.8)
        ends = np.stack([pose, pose])
        ends[:, :3, 3] = place + length * np.outer([-share, 1.0 - share], ahead)
        if all(free(scene.inverse_kinematics.solve(end[None]).q, scene).any() for end in ends):
            speed = float(10.0 ** rng.uniform(-2.0, 0.0))
            segments = (CartesianSegment("line", (ends[1],)),)
            return CartesianPath(ends[0], segments, speed, speed_tolerance=1.0)


def seam(seed: int) -> CartesianPath:
    """An upright line of 0.2 to 0.45 m along which axes 4 and 6 come to one line, but for 10 um to
    5 mm: both turn half a turn and back within millimetres.
    """
    rng = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, 3] = rng.uniform((1.9, -1.0, 1.3), (2.25, 1.0, 1.7))
    pose[1, 3] = 10.0 ** rng.uniform(-5.0, -2.3) * rng.choice([-1, 1])
    end = pose.copy()
    end[2, 3] += rng.uniform(0.2, 0.45)
    around = np.eye(4)
    around[:3, :3] = Rotation.from_euler("z", rng.uniform(-2.5, 2.5)).as_matrix()
    segments = (CartesianSegment("line", (around @ end,)),)
    speed = float(10.0 ** rng.uniform(-2.0, 0.0))
    return CartesianPath(around @ pose, segments, speed, speed_tolerance=1.0)


def stairs(seed: int) -> CartesianPath:
    """Three to eleven lines of 0.5 to 50 mm in any direction, with rounded corners."""
    rng = np.random.default_rng(seed)
    step = 10.0 ** rng.uniform(-3.3, -1.3)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("y", 90.0, degrees=True).as_matrix()
    pose[:3, 3] = rng.uniform((1.3, -0.5, 0.9), (1.9, 0.5, 1.6))
    start = pose.copy()
    segments = []
    for _ in range(rng.integers(3, 12)):
        ahead = rng.standard_normal(3)
        pose = pose.copy()
        pose[:3, 3] += step * rng.uniform(0.5, 1.5) * ahead / np.linalg.norm(ahead)
        segments.append(CartesianSegment("line", (pose,)))
    return CartesianPath(
        start,
        tuple(segments),
        tool_speed=float(10.0 ** rng.uniform(-2.0, 0.0)),
        speed_tolerance=1.0,
        blending_radius=step * rng.uniform(0.05, 0.5),
    )


def free(q: FloatArray, scene: PlanningScene) -> FloatArray:
    if len(q) == 0:
        return np.zeros(0, dtype=bool)
    return np.asarray(scene.collision.is_free(q, scene.thresholds(MARGIN)))


def followed(path: CartesianPath, scene: PlanningScene) -> bool:
    """The oracle: whether some configuration can be followed along a line in steps as short as its
    axes need.
    """
    ends = path.start, path.segments[0].poses[0]

    def at(share: float) -> FloatArray:
        pose = np.array(ends[0])
        pose[:3, 3] += share * (ends[1][:3, 3] - ends[0][:3, 3])
        return np.asarray(scene.inverse_kinematics.solve(pose[None]).q)

    def step_from(q: FloatArray, here: float, ahead: float) -> FloatArray | None:
        there = at(ahead)
        halfway = at(0.5 * (here + ahead))
        if len(there) == 0 or len(halfway) == 0:
            return None
        nearest = there[np.abs(there - q).max(axis=1).argmin()]
        between = halfway[np.abs(halfway - q).max(axis=1).argmin()]
        turn = np.abs(nearest - q).max()
        even = np.abs(between - 0.5 * (q + nearest)).max() <= 0.3 * turn + 1e-9
        return nearest if turn <= _TURN and even else None

    for q in at(0.0):
        here = 0.0
        step = 0.02
        while free(q[None], scene)[0] and step >= _FINEST:
            if here == 1.0:
                return True
            ahead = min(here + step, 1.0)
            nearest = step_from(q, here, ahead)
            if nearest is None:
                step *= 0.5
                continue
            q = nearest
            here = ahead
            step = min(1.6 * step, 0.02)
    return False


@pytest.mark.parametrize(
    "seeds", [range(6), pytest.param(range(6, 300), marks=pytest.mark.long)], ids=str
)
def test_what_can_be_followed_beside_a_singularity_is_driven(
    planner: Planner, seeds: range
) -> None:
    scene = planner.scene()
    for seed in seeds:
        path = beside_a_singularity(seed, scene)
        plan = planner.plan_cartesian(path)
        assert plan.status.ok or not followed(path, scene), (seed, plan.status.message)
        assert plan.report.certified == plan.status.ok
        assert plan.tool_error <= 1e-4


@pytest.mark.parametrize(
    "seeds", [range(6, 8), pytest.param(range(60), marks=pytest.mark.long)], ids=str
)
def test_a_seam_beside_the_wrist_takes_no_more_than_its_axes_need(
    planner: Planner, seeds: range
) -> None:
    scene = planner.scene()
    for seed in seeds:
        path = seam(seed)
        plan = planner.plan_cartesian(path)
        assert plan.status.ok or not followed(path, scene), (seed, plan.status.message)
        if plan.trajectory is not None:
            least = by_speeds_alone(plan.trajectory, path.tool_speed, scene)
            assert plan.report.duration <= _LONGER * least, seed


_LONGER = 8.0  # 4.8 at most in 60 seams


def by_speeds_alone(trajectory: JointTrajectory, speed: float, scene: PlanningScene) -> float:
    """Seconds along a trajectory's path if nothing but the speeds of tool and axes bound it."""
    q = trajectory.sample(np.linspace(0.0, trajectory.duration, 20001)).q
    places = scene.chain.tcp_poses(q)[:, :3, 3]
    tool = np.linalg.norm(np.diff(places, axis=0), axis=1) / speed
    axes = (np.abs(np.diff(q, axis=0)) / scene.limits.velocity).max(axis=1)
    return float(np.maximum(tool, axes).sum())


@pytest.mark.parametrize(
    "seeds", [range(1), pytest.param(range(1, 100), marks=pytest.mark.long)], ids=str
)
def test_stairs_of_short_lines_are_driven(planner: Planner, seeds: range) -> None:
    for seed in seeds:
        plan = planner.plan_cartesian(stairs(seed))
        assert plan.status.ok, (seed, plan.status.message)
        assert plan.report.certified


@pytest.mark.parametrize(
    "seeds", [range(1), pytest.param(range(1, 40), marks=pytest.mark.long)], ids=str
)
def test_asking_for_more_speed_never_takes_longer(planner: Planner, seeds: range) -> None:
    scene = planner.scene()
    for seed in seeds:
        path = stairs(seed) if seed % 2 else beside_a_singularity(seed, scene)
        speeds = np.sort(10.0 ** np.random.default_rng(seed).uniform(-2.3, 0.3, 3))
        durations = [
            planner.plan_cartesian(replace(path, tool_speed=float(speed))).report.duration
            for speed in speeds
        ]
        assert np.diff(durations).max() <= 2e-9, (seed, speeds, durations)
        assert min(durations) > 0.0


def test_a_path_that_is_late_is_answered_by_the_first_speed_that_was_begun(
    planner: Planner,
) -> None:
    late = Planner("open", clock=itertools.count(0.0, 10.0).__next__)
    path = stairs(0)
    speeds = []
    for each in (planner, late):
        plan = each.plan_cartesian(path)
        assert plan.report.certified, plan.status.message
        assert plan.info.truncated == (each is late)
        speeds.append(sum(stage.name == "proof" for stage in plan.info.stages))
    assert speeds[1] <= speeds[0]
    assert speeds[1] == 1
