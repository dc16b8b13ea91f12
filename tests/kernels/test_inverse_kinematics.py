"""Closed-form inverse kinematics: exact, complete, within the limits, and honest about arms it
can't do.
"""

from typing import Any

import numpy as np
import pytest
from robots import RobotLiteral, kr210, random_rotation

from ir_kernels import Chain, KernelError
from ir_kernels.spherical_wrist import SphericalWristIk
from ir_values.arrays import FloatArray

EXACT = 1e-9  # m and entries of rotations


def placed(robot: RobotLiteral) -> Chain:
    rng = np.random.default_rng(11)
    base = np.eye(4)
    tcp = np.eye(4)
    base[:3, :3] = random_rotation(rng)
    base[:3, 3] = [1.0, -2.0, 0.5]
    tcp[:3, :3] = random_rotation(rng)
    tcp[:3, 3] = [0.42, 0.1, -0.2]
    return Chain(robot, base, tcp)


def shifted_arm() -> RobotLiteral:
    """A spherical-wrist arm unlike the KR 210: other zero, lateral offset, an axis that points in
    the opposite direction.
    """
    robot = kr210()
    origin = robot.joint_origin.copy()
    origin[1, :3, 3] = [0.2, 0.13, 0.1]
    origin[2, :3, :3] = [
        [0, 0, 1],
        [0, 1, 0],
        [-1, 0, 0],
    ]  # drawn with the forearm turned by 90 degrees
    origin[3, :3, 3] = [0.0, 0.05, 0.1]
    axis = robot.joint_axis.copy()
    axis[2] = [0, -1, 0]
    axis[5] = [1, 0, 0]
    limits = np.radians([180.0, 180.0, 180.0, 180.0, 180.0, 180.0])
    changed = {
        "joint_origin": origin,
        "joint_axis": axis,
        "position_min": -limits,
        "position_max": limits,
    }
    return RobotLiteral(**{**vars(robot), **changed})


@pytest.mark.parametrize("robot", [kr210(), shifted_arm()], ids=["kr210", "shifted"])
def test_every_solution_meets_its_pose_within_the_limits(core: Any, robot: RobotLiteral) -> None:
    chain = placed(robot)
    ik = SphericalWristIk(chain, robot.position_min, robot.position_max, core=core)
    q = np.random.default_rng(0).uniform(robot.position_min, robot.position_max, (200, 6))
    poses = chain.tcp_poses(q)
    found = ik.solve(poses)
    assert np.abs(chain.tcp_poses(found.q) - poses[found.pose_index]).max() < EXACT
    assert (found.q >= robot.position_min).all()
    assert (found.q <= robot.position_max).all()


@pytest.mark.parametrize("robot", [kr210(), shifted_arm()], ids=["kr210", "shifted"])
def test_the_configuration_a_pose_was_made_from_is_found(core: Any, robot: RobotLiteral) -> None:
    chain = placed(robot)
    ik = SphericalWristIk(chain, robot.position_min, robot.position_max, core=core)
    q = np.random.default_rng(1).uniform(robot.position_min, robot.position_max, (500, 6))
    found = ik.solve(chain.tcp_poses(q))
    for k, made in enumerate(q):
        assert np.abs(found.of_pose(k) - made).max(axis=1).min() < 1e-6, (
            k
        )  # an angle near a singularity


@pytest.mark.sampled
def test_no_branch_is_missing_beside_a_numerical_search(core: Any) -> None:
    """Newton from a thousand starts finds nothing that the closed form doesn't have."""
    robot = kr210()
    chain = Chain(robot)
    ik = SphericalWristIk(chain, robot.position_min, robot.position_max, core=core)
    made = np.radians([[20.0, -70.0, 80.0, 30.0, 50.0, -40.0]])
    pose = chain.tcp_poses(made)
    found = ik.solve(pose).q
    q = np.random.default_rng(2).uniform(robot.position_min, robot.position_max, (1000, 6))
    for _ in range(60):
        current = chain.tcp_poses(q)
        turn = pose[0, :3, :3] @ np.swapaxes(current[:, :3, :3], 1, 2)
        vector = 0.5 * np.stack(
            [
                turn[:, 2, 1] - turn[:, 1, 2],
                turn[:, 0, 2] - turn[:, 2, 0],
                turn[:, 1, 0] - turn[:, 0, 1],
            ],
            axis=1,
        )
        error = np.concatenate([pose[0, :3, 3] - current[:, :3, 3], vector], axis=1)
        step = (np.linalg.pinv(chain.jacobian(q), rcond=1e-3) @ error[:, :, None])[:, :, 0]
        q = q + np.clip(step, -0.3, 0.3)
    close = np.abs(chain.tcp_poses(q) - pose).max(axis=(1, 2)) < 1e-9
    inside = ((q >= robot.position_min) & (q <= robot.position_max)).all(axis=1)
    reached = q[close & inside]
    assert len(reached) > 50
    nearest = np.abs(reached[:, None] - found[None]).max(axis=2).min(axis=1)
    assert nearest.max() < 1e-6


def test_solutions_come_sorted_and_all_turns_are_there(core: Any) -> None:
    robot = kr210()
    chain = placed(robot)
    ik = SphericalWristIk(chain, robot.position_min, robot.position_max, core=core)
    q = np.random.default_rng(3).uniform(robot.position_min, robot.position_max, (50, 6))
    found = ik.solve(chain.tcp_poses(q))
    keys = [
        (int(p), int(b), *row)
        for p, b, row in zip(found.pose_index, found.branch, found.q, strict=True)
    ]
    assert keys == sorted(keys)
    assert len(set(keys)) == len(keys)
    for joint in (
        3,
        5,
    ):  # +-350 degrees: each angle has its other turn, but for those within 10 degrees of 0
        turned = found.q.copy()
        turned[:, joint] -= np.sign(turned[:, joint]) * 2.0 * np.pi
        inside = np.abs(turned[:, joint]) <= robot.position_max[joint]
        gap = np.abs(turned[inside][:, None] - found.q[None]).max(axis=2)
        assert gap.min(axis=1).max() < 1e-9


def test_branches_agree_with_the_reference(core: Any) -> None:
    robot = kr210()
    chain = placed(robot)
    limits = (robot.position_min, robot.position_max)
    poses = chain.tcp_poses(np.random.default_rng(4).uniform(*limits, (100, 6)))
    one = SphericalWristIk(chain, *limits, core=core).solve(poses)
    other = SphericalWristIk(chain, *limits, core=None).solve(poses)
    assert (one.branch == other.branch).all()
    assert (one.pose_index == other.pose_index).all()
    assert np.abs(one.q - other.q).max() < 1e-7


@pytest.mark.parametrize("a5", [0.0, 1e-12, 1e-9, 1e-6, -1e-4])
def test_a_singular_wrist_still_meets_the_pose(core: Any, a5: float) -> None:
    robot = kr210()
    chain = Chain(robot)
    ik = SphericalWristIk(chain, robot.position_min, robot.position_max, core=core)
    q = np.random.default_rng(5).uniform(robot.position_min, robot.position_max, (50, 6))
    q[:, 4] = a5
    poses = chain.tcp_poses(q)
    found = ik.solve(poses)
    assert set(found.pose_index.tolist()) == set(range(50))
    assert np.abs(chain.tcp_poses(found.q) - poses[found.pose_index]).max() < EXACT


def test_stretched_arm_and_wrist_over_the_base_are_found(core: Any) -> None:
    robot = kr210()
    chain = Chain(robot)
    ik = SphericalWristIk(chain, robot.position_min, robot.position_max, core=core)
    stretched = np.array([[0.3, -0.5, -np.arctan2(0.041, 1.2), 0.4, 0.5, 0.6]])
    overhead = np.array([[0.0, -1.9, 0.0, 0.3, 0.4, 0.5]])
    heights = np.linspace(0.0, 2.7, 20001)  # A3 that brings the wrist centre over axis 1
    candidates = np.repeat(overhead, len(heights), axis=0)
    candidates[:, 2] = heights - 0.6
    wrist = chain.link_poses(candidates)[:, 5, :2, 3]
    overhead = candidates[[np.linalg.norm(wrist, axis=1).argmin()]]
    for q in (stretched, overhead):
        pose = chain.tcp_poses(q)
        found = ik.solve(pose)
        assert len(found.q) > 0
        assert np.abs(chain.tcp_poses(found.q) - pose).max() < EXACT


def test_out_of_reach_is_no_solution(core: Any) -> None:
    robot = kr210()
    ik = SphericalWristIk(Chain(robot), robot.position_min, robot.position_max, core=core)
    far = np.eye(4)
    far[:3, 3] = [3.2, 0.0, 1.0]
    near = Chain(robot).tcp_poses(np.radians([[0.0, -90.0, 90.0, 0.0, 30.0, 0.0]]))[0]
    found = ik.solve(np.stack([far, near]))
    assert (found.pose_index == 1).all()
    assert len(found.q) > 0


def with_origin(joint: int, xyz: list[float]) -> RobotLiteral:
    robot = kr210()
    origin: FloatArray = robot.joint_origin.copy()
    origin[joint, :3, 3] = xyz
    return RobotLiteral(**{**vars(robot), "joint_origin": origin})


def with_axis(joint: int, axis: list[float]) -> RobotLiteral:
    robot = kr210()
    axes = robot.joint_axis.copy()
    axes[joint] = axis
    return RobotLiteral(**{**vars(robot), "joint_axis": axes})


@pytest.mark.parametrize(
    ("robot", "message"),
    [
        (with_origin(5, [0.215, 0.001, 0.0]), "wrist is not spherical.*by 0.0005 m"),
        (with_axis(2, [0.0, 0.8, 0.6]), "axes 2 and 3 are not parallel"),
        (with_axis(0, [0.0, 0.6, -0.8]), "axes 1 and 2 are not perpendicular"),
        (with_axis(4, [0.6, 0.8, 0.0]), "axes 4 and 5 are not perpendicular"),
    ],
)
def test_an_arm_of_another_kind_is_refused_with_the_reason(
    robot: RobotLiteral, message: str
) -> None:
    with pytest.raises(KernelError, match=message):
        SphericalWristIk(Chain(robot), robot.position_min, robot.position_max)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (np.eye(4), "poses has shape"),
        (np.zeros((0, 4, 4)), "poses is empty"),
        (np.full((1, 4, 4), np.nan), r"poses\[0, 0, 0\] is nan"),
        (2.0 * np.eye(4)[None], "poses is not a rigid transform"),
        (np.diag([1.0, 1.0, -1.0, 1.0])[None], "poses mirrors"),
    ],
)
def test_a_bad_pose_is_named(core: Any, bad: FloatArray, message: str) -> None:
    robot = kr210()
    ik = SphericalWristIk(Chain(robot), robot.position_min, robot.position_max, core=core)
    with pytest.raises(KernelError, match=message):
        ik.solve(bad)
