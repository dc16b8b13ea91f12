"""Cyclic coordinate descent (eqs. 2 and 3): each joint takes its best value, and the search
arrives.
"""

from typing import Any

import numpy as np
import pytest
from robots import kr210, random_chain, random_rotation

from ir_kernels import CcdSettings, Chain, KernelError, ccd
from ir_kernels.reference import ccd as reference
from ir_kernels.reference.chain import axes
from ir_values.arrays import FloatArray

TOOL = np.eye(4)
TOOL[:3, 3] = [0.42, 0.0, 0.0]


def truncated_normal(
    rng: np.random.Generator, low: FloatArray, high: FloatArray, count: int
) -> FloatArray:
    """Starts of eq. 1."""
    return np.clip(rng.normal((low + high) / 2.0, (high - low) / 6.0, (count, len(low))), low, high)


def problem_of(
    chain: Chain, pose: FloatArray, low: FloatArray, high: FloatArray
) -> reference.Problem:
    return reference.Problem(
        chain.joint_origin,
        chain.joint_axis,
        chain.base_pose,
        chain.tcp,
        pose,
        low,
        high,
        rotation_length=0.5,
    )


@pytest.mark.parametrize("n", [1, 3, 6, 7])
def test_closed_form_of_each_joint_is_the_minimum_over_a_scan(n: int) -> None:
    """Eq. 3: no angle within the limits gives a smaller Psi than the one of the closed form."""
    rng = np.random.default_rng(n)
    chain = Chain(random_chain(rng, n))
    pose = np.eye(4)
    pose[:3, :3] = random_rotation(rng)
    pose[:3, 3] = rng.normal(size=3)
    low, high = np.sort(rng.uniform(-3.0, 3.0, (2, n)), axis=0)
    problem = problem_of(chain, pose, low, high)
    q = rng.uniform(low, high, (4, n))
    links = chain.link_poses(q)
    origin, direction = axes(chain.joint_axis, links)
    for i in range(n):
        k = reference.coefficients(problem, direction[:, i], origin[:, i], links[:, -1] @ chain.tcp)
        best = q.copy()
        best[:, i] = reference.best_value(q[:, i], *k, float(low[i]), float(high[i]))
        reached = reference.psi(problem, chain.tcp_poses(best))
        for angle in np.linspace(low[i], high[i], 721):
            scanned = q.copy()
            scanned[:, i] = angle
            assert (reached <= reference.psi(problem, chain.tcp_poses(scanned)) + 1e-12).all()


def test_psi_is_eq_2_and_never_grows(core: Any) -> None:
    robot = kr210()
    chain = Chain(robot, None, TOOL)
    rng = np.random.default_rng(0)
    low = robot.position_min
    high = robot.position_max
    pose = chain.tcp_poses(rng.uniform(low, high, (1, 6)))[0]
    starts = rng.uniform(low, high, (9, 6))
    before = np.full(9, np.inf)
    for sweeps in range(6):
        result = ccd(chain, pose, starts, low, high, CcdSettings(max_sweeps=sweeps), core=core)
        reached = chain.tcp_poses(result.q)
        distance = np.linalg.norm(reached[:, :3, 3] - pose[:3, 3], axis=1)
        frobenius = ((reached[:, :3, :3] - pose[:3, :3]) ** 2).sum(axis=(1, 2))
        assert result.psi == pytest.approx(distance**2 + 0.5**2 / 2.0 * frobenius)
        assert result.position_error == pytest.approx(distance)
        # |R - R*|_F^2 = 4 (1 - cos angle)
        assert 4.0 * (1.0 - np.cos(result.rotation_error)) == pytest.approx(frobenius, abs=1e-12)
        assert (result.psi <= before + 1e-12).all()
        assert (result.sweeps == sweeps).all()
        before = result.psi


@pytest.mark.sampled
@pytest.mark.parametrize("newton_steps", [0, 20])
def test_compiled_core_walks_like_the_reference(core: Any, newton_steps: int) -> None:
    robot = kr210()
    chain = Chain(robot, None, TOOL)
    rng = np.random.default_rng(1)
    low = robot.position_min
    high = robot.position_max
    pose = chain.tcp_poses(rng.uniform(low, high, (1, 6)))[0]
    starts = truncated_normal(rng, low, high, 11)
    settings = CcdSettings(max_sweeps=30, newton_steps=newton_steps)
    one = ccd(chain, pose, starts, low, high, settings, core=core)
    other = ccd(chain, pose, starts, low, high, settings, core=None)
    assert (
        np.abs(one.q - other.q).max() < 1e-6
    )  # near singularities a Newton step amplifies rounding
    assert (one.sweeps == other.sweeps).all()


def test_newton_finish_arrives_where_sweeps_slow_down(core: Any) -> None:
    """At least one of 32 starts of eq. 1 arrives at every reachable pose, and to rounding."""
    robot = kr210()
    chain = Chain(robot, None, TOOL)
    rng = np.random.default_rng(2)
    low = robot.position_min
    high = robot.position_max
    settings = CcdSettings(max_sweeps=30, newton_steps=20)
    count = 10 if core is not None else 2  # the reference is slow
    poses = chain.tcp_poses(rng.uniform(low, high, (count, 6)))
    for pose in poses:
        result = ccd(
            chain, pose, truncated_normal(rng, low, high, 32), low, high, settings, core=core
        )
        assert result.reached().any()
        assert result.position_error[result.reached()].min() < 1e-9
        assert ((result.q >= low) & (result.q <= high)).all()


def test_a_start_ends_the_same_in_any_batch(core: Any) -> None:
    robot = random_chain(np.random.default_rng(3), 7)
    chain = Chain(robot)
    rng = np.random.default_rng(4)
    low = robot.position_min
    high = robot.position_max
    pose = chain.tcp_poses(rng.uniform(low, high, (1, 7)))[0]
    starts = rng.uniform(low, high, (10, 7))
    settings = CcdSettings(max_sweeps=20, newton_steps=10)
    together = ccd(chain, pose, starts, low, high, settings, core=core)
    for k in range(10):
        alone = ccd(chain, pose, starts[k : k + 1], low, high, settings, core=core)
        # the reference's BLAS sums batches of other sizes in another order
        assert np.abs(alone.q[0] - together.q[k]).max() <= (0.0 if core is not None else 1e-6)


def test_a_start_that_is_there_spends_no_work(core: Any) -> None:
    robot = kr210()
    chain = Chain(robot, None, TOOL)
    q = np.radians([[10.0, -80.0, 70.0, 20.0, 40.0, 30.0]])
    settings = CcdSettings(newton_steps=5)
    limits = (robot.position_min, robot.position_max)
    result = ccd(chain, chain.tcp_poses(q)[0], q, *limits, settings, core=core)
    assert (result.q == q).all()
    assert (result.sweeps[0], result.newton_steps[0]) == (0, 0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pose": np.full((4, 4), np.nan)}, "pose"),
        ({"starts": np.zeros((3, 5))}, "starts has shape"),
        ({"starts": np.zeros((0, 6))}, "starts is empty"),
        ({"position_min": np.full(6, 4.0)}, r"position_min\[0\] is 4.0 rad, above"),
    ],
)
def test_a_bad_argument_is_named(change: dict[str, FloatArray], message: str) -> None:
    arguments: dict[str, Any] = {"pose": np.eye(4), "starts": np.zeros((1, 6))}
    arguments |= {"position_min": np.full(6, -3.0), "position_max": np.full(6, 3.0)} | change
    with pytest.raises(KernelError, match=message):
        ccd(Chain(kr210()), **arguments)


def test_settings_refuse_what_makes_no_sense() -> None:
    with pytest.raises(KernelError, match="max_sweeps is -1"):
        CcdSettings(max_sweeps=-1)
    with pytest.raises(KernelError, match="xi is nan"):
        CcdSettings(xi=float("nan"))
