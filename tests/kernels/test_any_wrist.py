"""Inverse kinematics without a spherical wrist: exact, none missed, or refused with the reason."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from robots import kr210, random_rotation

from ir_kernels import Chain, KernelError, inverse_kinematics
from ir_kernels.ik_set import InverseKinematics
from ir_kernels.inverse_kinematics import SearchedIk, ThreeParallelIk
from ir_kernels.spherical_wrist import SphericalWristIk
from ir_values.arrays import FloatArray

EXACT = 1e-8  # m and entries of rotations
NEAR = 1e-5  # rad: a configuration near a singularity is known to half the digits
HALF = np.full(6, np.pi)


def arm(points: FloatArray, axis: FloatArray) -> SimpleNamespace:
    """A chain by points (6, 3) and directions (6, 3) of its axes at q = 0, in frames parallel to
    the base.
    """
    origin = np.tile(np.eye(4), (6, 1, 1))
    origin[:, :3, 3] = np.diff(np.vstack([np.zeros(3), points]), axis=0)
    return SimpleNamespace(
        joint_origin=origin, joint_axis=axis / np.linalg.norm(axis, axis=1)[:, None]
    )


def three_parallel(rng: np.random.Generator, meet: bool) -> SimpleNamespace:
    """An arm like a UR with other lengths and, of its first and last axes, other directions."""
    lengths = np.array([0.18, -0.61, -0.57, 0.17, 0.12, 0.11]) * rng.uniform(0.7, 1.3, 6)
    d1, a2, a3, d4, d5, d6 = lengths
    z = np.array([[0, 0, 1], [0, -1, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, -1, 0]], float)
    points = np.array(
        [
            [0, 0, 0],
            [0, 0, d1],
            [a2, 0, d1],
            [a2 + a3, 0, d1],
            [a2 + a3, -d4, d1],
            [a2 + a3, -d4 - d6, d1 - d5],
        ]
    )
    if not meet:
        points[5, 0] += 0.06
        z[[0, 4, 5]] += rng.uniform(-0.2, 0.2, (3, 3))
    return arm(points, z)


def other_wrist(meet: bool) -> SimpleNamespace:
    """The KR 210 with a wrist whose axes do not meet in a point."""
    robot = kr210()
    origin = robot.joint_origin.copy()
    origin[4, :3, 3] += [-0.1, 0.15 if meet else 0.0, 0.0 if meet else 0.1]
    origin[5, :3, 3] += [0.0, 0.0 if meet else 0.05, 0.0]
    return SimpleNamespace(joint_origin=origin, joint_axis=robot.joint_axis)


def placed(robot: SimpleNamespace, seed: int) -> Chain:
    rng = np.random.default_rng(seed)
    base = np.eye(4)
    tcp = np.eye(4)
    base[:3, :3] = random_rotation(rng)
    base[:3, 3] = [1.0, -2.0, 0.5]
    tcp[:3, :3] = random_rotation(rng)
    tcp[:3, 3] = [0.1, 0.05, 0.2]
    return Chain(robot, base, tcp)


def assert_complete(chain: Chain, solver: InverseKinematics, q: FloatArray) -> None:
    """Every answer meets its pose; the configuration that a pose was made from is among them."""
    poses = chain.tcp_poses(q)
    found = solver.solve(poses)
    assert np.abs(chain.tcp_poses(found.q) - poses[found.pose_index]).max() < EXACT
    for k, made in enumerate(q):
        assert np.abs(found.of_pose(k) - made).max(axis=1).min() < NEAR, k


@pytest.mark.parametrize("meet", [True, False], ids=["axes 5 and 6 meet", "they do not"])
@pytest.mark.parametrize("seed", range(3))
def test_three_parallel_axes_are_solved_in_closed_form(seed: int, meet: bool) -> None:
    rng = np.random.default_rng(seed)
    chain = placed(three_parallel(rng, meet), seed)
    solver = inverse_kinematics(chain, -HALF, HALF)
    assert isinstance(solver, ThreeParallelIk)
    assert_complete(chain, solver, rng.uniform(-HALF, HALF, (300, 6)))


@pytest.mark.parametrize("meet", [True, False], ids=["axes 5 and 6 meet", "they do not"])
def test_any_other_wrist_is_solved_by_a_search(meet: bool) -> None:
    chain = placed(other_wrist(meet), 4)
    solver = inverse_kinematics(chain, -HALF, HALF)
    assert isinstance(solver, SearchedIk)
    assert_complete(chain, solver, np.random.default_rng(2).uniform(-HALF, HALF, (40, 6)))


def test_the_search_finds_what_the_closed_form_of_a_spherical_wrist_finds() -> None:
    robot = kr210()
    chain = placed(robot, 5)
    limits = (robot.position_min, robot.position_max)
    poses = chain.tcp_poses(np.random.default_rng(3).uniform(*limits, (20, 6)))
    expected = SphericalWristIk(chain, *limits).solve(poses)
    found = SearchedIk(chain, *limits).solve(poses)
    for k in range(len(poses)):
        own = expected.of_pose(k)
        other = found.of_pose(k)
        apart = np.abs(own[:, None] - other[None]).max(axis=2)
        assert len(own) == len(other), k
        assert apart.min(axis=1).max() < NEAR, k


def test_a_wrist_with_a_free_angle_gives_the_one_nearest_to_zero() -> None:
    chain = placed(three_parallel(np.random.default_rng(0), True), 6)
    made = np.array([[0.3, -1.0, 0.8, 0.5, 0.0, 0.7]])  # axis 6 parallel to axes 2 to 4
    found = ThreeParallelIk(chain, -HALF, HALF).solve(chain.tcp_poses(made))
    reached = chain.tcp_poses(found.q)
    assert len(found.q) > 0
    assert np.abs(reached - chain.tcp_poses(made)).max() < EXACT
    assert np.abs(found.q[:, 5]).min() < np.radians(15.1)  # 0 is out of reach, the next step is not


def test_seven_axes_and_crossed_axes_are_refused_with_the_reason() -> None:
    robot = kr210()
    seven = SimpleNamespace(
        joint_origin=np.concatenate([robot.joint_origin, np.eye(4)[None]]),
        joint_axis=np.concatenate([robot.joint_axis, [[0.0, 1.0, 0.0]]]),
    )
    with pytest.raises(KernelError, match="the arm has 7 axes: inverse kinematics needs 6"):
        inverse_kinematics(Chain(seven), -np.ones(7), np.ones(7))
    axis = robot.joint_axis.copy()
    axis[2] = [0.0, 0.6, 0.8]
    crossed = SimpleNamespace(joint_origin=robot.joint_origin, joint_axis=axis)
    with pytest.raises(KernelError, match="axes 2 and 3 are not parallel"):
        inverse_kinematics(Chain(crossed), -HALF, HALF)


@pytest.mark.parametrize(
    "q",
    [
        [2.7023283765, -1.2019172549, -1.0793580619, 0.0837217278, -1.3339889381, -1.9278133048],
        [-1.1452136411, -2.8819943682, 1.8774129399, 3.1411707729, -0.7528838924, 1.7360801494],
        [-1.1451136411, -2.8819943682, 1.8774129399, 3.1411707729, -0.7528838924, 1.7360801494],
    ],
)
def test_branches_narrower_than_the_grid_are_found(q: list[float]) -> None:
    """All solutions of some branches lie within 0.03 degrees of q4."""
    chain = Chain(other_wrist(meet=False))
    assert_complete(chain, SearchedIk(chain, -HALF, HALF), np.array([q]))


def test_a_single_pose_out_of_reach_has_no_answer() -> None:
    chain = Chain(other_wrist(meet=False))
    pose = np.eye(4)
    pose[:3, 3] = [20.0, 0.0, 0.0]
    assert len(SearchedIk(chain, -HALF, HALF).solve(pose[None]).q) == 0
