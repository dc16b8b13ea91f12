"""Reported maxima are never below the true ones: judged at 20 kHz, with Pinocchio and a bus of its
own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from oracles import FloatArray, torque_available, torques

from ir_kernels.power import Regeneration
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import evaluate_trajectory, peak_power
from ir_planner.scene import Drives, PlanningScene

SceneOf = Callable[[str], PlanningScene]
RATE = 20_000.0  # Hz
NAMES = ("positions", "velocities", "accelerations")
RATIOS = ("velocity_ratio", "acceleration_ratio", "jerk_ratio", "torque_ratio")
EXACT = 1e-9  # relative: what rounding may leave
SHARP = 1.02  # times the true peak
GENERATED = settings(
    max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def generated(scene: PlanningScene, seed: int) -> JointTrajectory:
    """Quintics through a few configurations near the park posture, from rest to rest."""
    rng = np.random.default_rng(seed)
    robot = scene.cell.robot
    count = int(rng.integers(2, 6))
    q = np.array(scene.cell.park) + rng.uniform(-0.5, 0.5, (count, robot.n))
    q = np.clip(q, robot.position_min + 0.1, robot.position_max - 0.1)
    qd, qdd = rng.uniform(-0.5, 0.5, (2, count, robot.n))
    qd[[0, -1]] = 0.0
    qdd[[0, -1]] = 0.0
    if rng.random() < 0.3:  # a joint that rests
        still = int(rng.integers(robot.n))
        q[:, still] = q[0, still]
        qd[:, still] = 0.0
        qdd[:, still] = 0.0
    times = np.concatenate([[0], np.cumsum(rng.integers(200_000_000, 900_000_000, count - 1))])
    return JointTrajectory(robot.joint_names, times.astype(np.int64), q, qd, qdd)


def dense(trajectory: JointTrajectory) -> tuple[FloatArray, ...]:
    """q, qd, qdd and jerk (N, n) in the middles of 1 / RATE s, by polynomials fitted to the points
    anew.
    """
    motion: list[list[FloatArray]] = [[], [], [], []]
    times = trajectory.times_ns * 1e-9
    for k, T in enumerate(np.diff(times)):
        t = (np.arange(int(T * RATE)) + 0.5) / RATE
        ends = np.array(
            [
                [v ** max(p - d, 0) * np.prod(range(p - d + 1, p + 1)) * (p >= d) for p in range(6)]
                for v in (0.0, T)
                for d in range(3)
            ]
        )
        right = [getattr(trajectory, name)[k + e] for e in (0, 1) for name in NAMES]
        c = np.linalg.solve(ends, np.array(right))
        for d in range(4):
            powers = np.array([np.prod(range(p - d + 1, p + 1)) * (p >= d) for p in range(6)])
            shifted = t[:, None] ** np.maximum(np.arange(6) - d, 0)
            motion[d].append((shifted * powers) @ c)
    return tuple(np.concatenate(part) for part in motion)


def mains_peak(scene: PlanningScene, qd: FloatArray, torque: FloatArray, charge: float) -> float:
    """Largest power at the mains [W], the bus stepped at RATE."""
    robot = scene.cell.robot
    power = scene.power
    axes = torque * qd + robot.copper_loss * (torque / robot.gear_ratio) ** 2
    if scene.drives.regeneration == "none":
        return scene.base_watts + float(np.maximum(axes, 0.0).sum(axis=1).max())
    stored = charge
    peak = 0.0
    for wanted in axes.sum(axis=1) / RATE:
        stored -= wanted
        peak = max(peak, -stored * RATE)
        stored = min(max(stored, 0.0), power.dc_link_capacity_energy)
    return scene.base_watts + peak


@GENERATED
@given(
    seed=st.integers(0, 10**6),
    cell=st.sampled_from(["demo", "open"]),
    regeneration=st.sampled_from(["shared", "none", "fed_back"]),
    charge=st.sampled_from([0.0, 40.0, 106.0]),
)
def test_no_instant_takes_more_than_the_reported_peak(
    seed: int, cell: str, regeneration: Regeneration, charge: float, scene_of: SceneOf
) -> None:
    scene = replace(scene_of(cell), drives=Drives(regeneration))
    trajectory = generated(scene, seed)
    q, qd, qdd, _ = dense(trajectory)
    true = mains_peak(scene, qd, torques(scene, q, qd, qdd), charge)
    bound = peak_power(trajectory, scene, charge)
    assert true <= bound * (1.0 + EXACT)
    assert bound <= SHARP * true


@GENERATED
@given(seed=st.integers(0, 10**6))
def test_no_instant_uses_more_of_a_limit_than_reported(
    seed: int, demo_scene: PlanningScene
) -> None:
    robot = demo_scene.cell.robot
    trajectory = generated(demo_scene, seed)
    q, qd, qdd, jerk = dense(trajectory)
    torque = np.abs(torques(demo_scene, q, qd, qdd)) / torque_available(robot, qd)
    used = [qd / robot.velocity_max, qdd / robot.acceleration_max, jerk / robot.jerk_max, torque]
    report = evaluate_trajectory(trajectory, demo_scene, 0.02).report
    assert report.peak_power == peak_power(trajectory, demo_scene)
    for name, shares in zip(RATIOS, used, strict=True):
        true = np.abs(shares).max(axis=0)
        reported = getattr(report, name)
        assert (true <= reported * (1.0 + EXACT) + EXACT).all(), name
        if name != "torque_ratio":  # friction of either sign counts where a joint turns
            assert (reported <= true * 1.01 + 1e-3).all(), name
