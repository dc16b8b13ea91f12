"""Dynamics and inverse kinematics half of `benchmarks/kernels.py`: nanoseconds per sample, beside
Pinocchio.

One thread, best of several repetitions (what the machine can do, not what its other work leaves),
peers in the same run.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio
from _kernels_rows import Row, Tool, best
from _pinocchio_arm import pinocchio_arm
from _results import Claim, at_least, at_most

from ir_description import load_robot
from ir_kernels import CcdSettings, Chain, DynamicsModel, ccd, dc_bus
from ir_kernels.power import DcBusParameters
from ir_kernels.spherical_wrist import SphericalWristIk
from ir_values.arrays import FloatArray

SAMPLES = 4096
PINOCCHIO_SAMPLES = 512
# m, rad: what counts as arrived
POSITION_ERROR = 1e-4
ROTATION_ERROR = 3e-4


def _agreement(model: DynamicsModel, peer: Any, samples: Sequence[FloatArray], robot: Any) -> float:
    """Largest difference of the arm's torque from Pinocchio's, relative to the largest torque."""
    q, qd, qdd = samples
    data = peer.createData()
    rnea = np.array(
        [pinocchio.rnea(peer, data, *sample) for sample in zip(q, qd, qdd, strict=True)]
    )
    drives = (
        robot.reflected_inertia * qdd
        + robot.friction_viscous * qd
        + robot.friction_coulomb * np.sign(qd)
    )
    arm = model.inverse_dynamics(q, qd, qdd) - drives + model.counterbalance(q)
    return float(np.abs(arm - rnea).max() / np.abs(rnea).max())


def _dynamics(
    rng: np.random.Generator,
) -> tuple[list[Row], list[Claim]]:
    robot = load_robot()
    model = DynamicsModel(robot, (Tool(),))
    peer = pinocchio_arm(robot, (Tool(),))
    q = rng.uniform(robot.position_min, robot.position_max, (SAMPLES, 6))
    qd, qdd = rng.normal(size=(2, SAMPLES, 6))
    data = peer.createData()
    few = [x[:PINOCCHIO_SAMPLES] for x in (q, qd, qdd)]

    def rnea() -> None:
        for sample in zip(*few, strict=True):
            pinocchio.rnea(peer, data, *sample)

    double = best(lambda: model.inverse_dynamics(q, qd, qdd), SAMPLES)
    single = best(lambda: model.inverse_dynamics_single(q, qd, qdd), SAMPLES)
    other = best(rnea, PINOCCHIO_SAMPLES, 10)
    tau = model.inverse_dynamics(q, qd, qdd)
    power = model.axis_power(qd, tau)
    bus = DcBusParameters(106.0)
    c = rng.normal(size=(8, 6, 6)) * np.array([1.0, 0.3, 0.3, 0.1, 0.1, 0.05])
    T = rng.uniform(0.3, 1.0, 8)
    ns = "ns per sample"
    rows = [
        Row("inverse dynamics, double", "", double * 1e9, ns),
        Row("inverse dynamics, float", "", single * 1e9, ns),
        Row("inverse dynamics", "pinocchio.rnea, called from Python", other * 1e9, ns),
        Row("inverse dynamics, double, against Pinocchio", "", other / double, "times faster"),
        Row("mass matrix", "", best(lambda: model.mass_matrix(q), SAMPLES) * 1e9, ns),
        Row(
            "forward dynamics",
            "",
            best(lambda: model.forward_dynamics(q, qd, tau), SAMPLES) * 1e9,
            ns,
        ),
        Row(
            "torque gradients",
            "",
            best(lambda: model.torque_gradients(q, qd, qdd), SAMPLES, 5) * 1e9,
            ns,
        ),
        Row("axis power", "", best(lambda: model.axis_power(qd, tau), SAMPLES) * 1e9, ns),
        Row("DC link", "", best(lambda: dc_bus(power, 0.01, bus), SAMPLES) * 1e9, ns),
        Row(
            "torque bounds, 8 segments",
            "",
            best(lambda: model.torque_bounds(c, T), 1, 10) * 1e6,
            "us",
        ),
    ]
    agrees = _agreement(model, peer, few, robot)
    off = float(np.abs(model.inverse_dynamics_single(q, qd, qdd) - tau).max() / np.abs(tau).max())
    claims = [
        at_most("inverse dynamics in double", double * 1e9, ns, 20.0),
        at_most("inverse dynamics in float", single * 1e9, ns, 20.0),
        at_most("inverse dynamics against Pinocchio, double", agrees, "relative", 1e-9),
        at_most("inverse dynamics in float against double", off, "relative", 1e-5),
    ]
    return rows, claims


def _closed_form(rng: np.random.Generator) -> tuple[list[Row], list[Claim]]:
    robot = load_robot()
    chain = Chain(robot)
    ik = SphericalWristIk(chain, robot.position_min, robot.position_max)
    made = rng.uniform(robot.position_min, robot.position_max, (SAMPLES, 6))
    poses = chain.tcp_poses(made)
    seconds = best(lambda: ik.solve(poses), SAMPLES)
    found = ik.solve(poses)
    missed = sum(
        float(np.abs(found.of_pose(k) - made[k]).max(axis=1).min()) > 1e-6 for k in range(SAMPLES)
    )
    error = float(np.abs(chain.tcp_poses(found.q) - poses[found.pose_index]).max())
    us = "us per pose"
    rows = [
        Row("closed-form IK, all branches and turns", "", seconds * 1e6, us),
        Row("closed-form IK, solutions", "", len(found.q) / SAMPLES, "per pose"),
    ]
    claims = [
        at_most("closed-form IK, all branches and turns", seconds * 1e6, us, 2.0),
        at_most("closed-form IK, configurations missed", missed, f"of {SAMPLES}", 0),
        at_most("closed-form IK, error of the pose", error, "m", 1e-9),
    ]
    return rows, claims


def _descent(rng: np.random.Generator, poses: int) -> tuple[list[Row], list[Claim]]:
    robot = load_robot()
    tcp = np.eye(4)
    tcp[:3, 3] = [0.42, 0.0, 0.0]
    chain = Chain(robot, None, tcp)
    low = np.ascontiguousarray(robot.position_min)
    high = np.ascontiguousarray(robot.position_max)
    targets = chain.tcp_poses(rng.uniform(low, high, (poses, 6)))
    starts = np.clip(rng.normal((low + high) / 2.0, (high - low) / 6.0, (poses, 32, 6)), low, high)
    rows = []
    claims = []
    variants = {
        "CCD, 32 starts, Newton finish": CcdSettings(max_sweeps=20, newton_steps=20),
        "CCD, 32 starts, pure eq. 3": CcdSettings(),
    }
    for name, settings in variants.items():
        arrived = 0
        seconds = []
        for pose, first in zip(targets, starts, strict=True):
            begin = time.perf_counter()
            result = ccd(chain, pose, first, low, high, settings)
            seconds.append(time.perf_counter() - begin)
            arrived += bool(result.reached(POSITION_ERROR, ROTATION_ERROR).any())
        share = 100.0 * arrived / poses
        median = float(np.median(seconds)) * 1e3
        rows += [
            Row(name, "", median, "ms per pose, median"),
            Row(name, "", share, "% of the poses reached"),
        ]
        if settings.newton_steps:
            claims += [
                at_most(f"{name}: time", median, "ms per pose, median", 1.0),
                at_least(f"{name}: reached", share, "% of the poses", 99.0),
            ]
    return rows, claims


def measure(seed: int = 0, poses: int = 500) -> tuple[list[Row], list[Claim]]:
    """All rows and claims of this half."""
    rng = np.random.default_rng(seed)
    parts = [_dynamics(rng), _closed_form(rng), _descent(rng, poses)]
    return [row for rows, _ in parts for row in rows], [
        claim for _, claims in parts for claim in claims
    ]
