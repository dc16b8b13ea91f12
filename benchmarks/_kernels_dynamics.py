"""Dynamics and inverse kinematics half of `benchmarks/kernels.py`: nanoseconds per sample, beside Pinocchio.

`rows()` measures and `claims()` judges; `python benchmarks/_kernels_dynamics.py` prints both on its own.
One thread, best of several repetitions (what the machine can do, not what its other work leaves), peers in
the same run.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio

from ir_description import load_robot
from ir_kernels import (
    CcdSettings,
    Chain,
    DcBusParameters,
    DynamicsModel,
    SphericalWristIk,
    ccd,
    dc_bus,
    motion_extrema,
)
from ir_msgs_py.arrays import FloatArray

SAMPLES = 4096
PINOCCHIO_SAMPLES = 512
REPETITIONS = 30
POSITION_ERROR, ROTATION_ERROR = 1e-4, 3e-4  # m, rad: what counts as arrived


@dataclass(frozen=True)
class Row:
    """One measurement: what, beside what it stands, how long one item took."""

    kernel: str
    peer: str
    value: float
    unit: str


@dataclass(frozen=True)
class Claim:
    """A measured figure beside the bound it was asked to keep."""

    name: str
    value: float
    unit: str
    bound: float
    holds: bool


@dataclass(frozen=True)
class Tool:
    """The 155 kg of the paper's Table II."""

    name: str = "tool"
    mass: float = 155.0
    com: tuple[float, float, float] = (0.24, 0.0, 0.0)
    inertia: tuple[tuple[float, ...], ...] = ((5.0, 0.0, 0.0), (0.0, 4.0, 0.0), (0.0, 0.0, 6.0))


def best(function: Callable[[], Any], items: int, repetitions: int = REPETITIONS) -> float:
    """Seconds per item, the fastest of the repetitions."""
    fastest = np.inf
    for _ in range(repetitions):
        begin = time.perf_counter()
        function()
        fastest = min(fastest, time.perf_counter() - begin)
    return fastest / items


def _pinocchio_model(robot: Any, load: Tool) -> Any:
    model = pinocchio.Model()
    model.gravity.linear = np.array([0.0, 0.0, -9.80665])
    parent = 0
    for i, (origin, axis) in enumerate(zip(robot.joint_origin, robot.joint_axis, strict=True)):
        placement = pinocchio.SE3(origin[:3, :3].copy(), origin[:3, 3].copy())
        parent = model.addJoint(
            parent, pinocchio.JointModelRevoluteUnaligned(axis.copy()), placement, f"joint_{i}"
        )
        own = pinocchio.Inertia(
            float(robot.link_mass[i + 1]), robot.link_com[i + 1].copy(), robot.link_inertia[i + 1].copy()
        )
        model.appendBodyToJoint(parent, own, pinocchio.SE3.Identity())
    carried = pinocchio.Inertia(load.mass, np.array(load.com), np.array(load.inertia))
    model.appendBodyToJoint(parent, carried, pinocchio.SE3.Identity())
    return model


def _agreement(model: DynamicsModel, peer: Any, samples: Sequence[FloatArray], robot: Any) -> float:
    """Largest difference of the arm's torque from Pinocchio's, relative to the largest torque."""
    q, qd, qdd = samples
    data = peer.createData()
    rnea = np.array([pinocchio.rnea(peer, data, *sample) for sample in zip(q, qd, qdd, strict=True)])
    drives = (
        robot.reflected_inertia * qdd + robot.friction_viscous * qd + robot.friction_coulomb * np.sign(qd)
    )
    arm = model.inverse_dynamics(q, qd, qdd) - drives + model.counterbalance(q)
    return float(np.abs(arm - rnea).max() / np.abs(rnea).max())


def _dynamics(rng: np.random.Generator) -> tuple[list[Row], list[Claim]]:
    robot = load_robot()
    model, peer = DynamicsModel(robot, (Tool(),)), _pinocchio_model(robot, Tool())
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
        Row("forward dynamics", "", best(lambda: model.forward_dynamics(q, qd, tau), SAMPLES) * 1e9, ns),
        Row("torque gradients", "", best(lambda: model.torque_gradients(q, qd, qdd), SAMPLES, 5) * 1e9, ns),
        Row("axis power", "", best(lambda: model.axis_power(qd, tau), SAMPLES) * 1e9, ns),
        Row("DC bus", "", best(lambda: dc_bus(power, 0.01, bus), SAMPLES) * 1e9, ns),
        Row("torque bounds, 8 segments", "", best(lambda: model.torque_bounds(c, T), 1, 10) * 1e6, "us"),
        Row("motion extrema, 8 segments", "", best(lambda: motion_extrema(c, T), 1, 10) * 1e6, "us"),
    ]
    agrees = _agreement(model, peer, few, robot)
    off = float(np.abs(model.inverse_dynamics_single(q, qd, qdd) - tau).max() / np.abs(tau).max())
    claims = [
        Claim("inverse dynamics in double", double * 1e9, ns, 20.0, double * 1e9 <= 20.0),
        Claim("inverse dynamics in float", single * 1e9, ns, 20.0, single * 1e9 <= 20.0),
        Claim("inverse dynamics against Pinocchio, double", agrees, "relative", 1e-9, agrees <= 1e-9),
        Claim("inverse dynamics in float against double", off, "relative", 1e-5, off <= 1e-5),
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
    missed = sum(float(np.abs(found.of_pose(k) - made[k]).max(axis=1).min()) > 1e-6 for k in range(SAMPLES))
    error = float(np.abs(chain.tcp_poses(found.q) - poses[found.pose_index]).max())
    us = "us per pose"
    rows = [
        Row("closed-form IK, all branches and turns", "", seconds * 1e6, us),
        Row("closed-form IK, solutions", "", len(found.q) / SAMPLES, "per pose"),
    ]
    claims = [
        Claim("closed-form IK, all branches and turns", seconds * 1e6, us, 2.0, seconds * 1e6 <= 2.0),
        Claim("closed-form IK, configurations missed", float(missed), f"of {SAMPLES}", 0.0, missed == 0),
        Claim("closed-form IK, error of the pose", error, "m", 1e-9, error <= 1e-9),
    ]
    return rows, claims


def _descent(rng: np.random.Generator, poses: int) -> tuple[list[Row], list[Claim]]:
    robot = load_robot()
    tcp = np.eye(4)
    tcp[:3, 3] = [0.42, 0.0, 0.0]
    chain = Chain(robot, None, tcp)
    low, high = np.ascontiguousarray(robot.position_min), np.ascontiguousarray(robot.position_max)
    targets = chain.tcp_poses(rng.uniform(low, high, (poses, 6)))
    starts = np.clip(rng.normal((low + high) / 2.0, (high - low) / 6.0, (poses, 32, 6)), low, high)
    rows, claims = [], []
    variants = {
        "CCD, 32 starts, Newton finish": CcdSettings(max_sweeps=20, newton_steps=20),
        "CCD, 32 starts, pure eq. 3": CcdSettings(),
    }
    for name, settings in variants.items():
        arrived, seconds = 0, []
        for pose, first in zip(targets, starts, strict=True):
            begin = time.perf_counter()
            result = ccd(chain, pose, first, low, high, settings)
            seconds.append(time.perf_counter() - begin)
            arrived += bool(result.reached(POSITION_ERROR, ROTATION_ERROR).any())
        share, median = 100.0 * arrived / poses, float(np.median(seconds)) * 1e3
        rows += [Row(name, "", median, "ms per pose, median"), Row(name, "", share, "% of the poses reached")]
        if settings.newton_steps:
            claims += [
                Claim(f"{name}: time", median, "ms per pose, median", 1.0, median <= 1.0),
                Claim(f"{name}: reached", share, "% of the poses", 99.0, share >= 99.0),
            ]
    return rows, claims


def measure(seed: int = 0, poses: int = 500) -> tuple[list[Row], list[Claim]]:
    """All rows and claims of this half."""
    rng = np.random.default_rng(seed)
    parts = [_dynamics(rng), _closed_form(rng), _descent(rng, poses)]
    return [row for rows, _ in parts for row in rows], [claim for _, claims in parts for claim in claims]


def main() -> None:
    rows, claims = measure()
    for row in rows:
        print(f"{row.kernel + (' (' + row.peer + ')' if row.peer else ''):66s} {row.value:10.3f} {row.unit}")
    print()
    for claim in claims:
        verdict = "holds" if claim.holds else "falls short"
        print(f"{claim.name:50s} {claim.value:10.3g} {claim.unit:22s} bound {claim.bound:<8g} {verdict}")


if __name__ == "__main__":
    main()
