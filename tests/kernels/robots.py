"""Robots as literals for the tests of the kernels: the KR 210 R2700 extra, and random serial
chains.

Masses, drives and counterbalance of the KR 210: machine data of the KR C4 and
kroshu/kuka_robot_descriptions.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ir_kernels import DynamicsModel
from ir_kernels.dynamics import Gradients
from ir_values.arrays import FloatArray


@dataclass(frozen=True)
class CounterbalanceLiteral:
    joint: int = 1
    pivot: tuple[float, float] = (-0.800, -0.067)
    rod_eye: tuple[float, float] = (-0.010, 0.200)
    piston_area: float = 1.669e-3
    gas_volume: float = 1.67e-3
    charge_pressure: float = 1.56e7
    rod_length_at_charge: float = 0.600
    exponent: float = 1.33


@dataclass(frozen=True)
class LoadLiteral:
    name: str
    mass: float
    com: FloatArray
    inertia: FloatArray


@dataclass(frozen=True)
class RobotLiteral:
    name: str
    joint_names: tuple[str, ...]
    link_names: tuple[str, ...]
    joint_origin: FloatArray
    joint_axis: FloatArray
    position_min: FloatArray
    position_max: FloatArray
    velocity_max: FloatArray
    acceleration_max: FloatArray
    jerk_max: FloatArray
    link_mass: FloatArray
    link_com: FloatArray
    link_inertia: FloatArray
    gear_ratio: FloatArray
    reflected_inertia: FloatArray
    friction_viscous: FloatArray
    friction_coulomb: FloatArray
    copper_loss: FloatArray
    envelope_speed: FloatArray
    envelope_torque: FloatArray
    counterbalance: Any = None
    capsules: tuple[Any, ...] = ()
    self_pairs: tuple[tuple[str, str], ...] = ()
    load_self_capsules: tuple[str, ...] = field(default=())
    motor_turns: Any = None
    first_slides: bool = False

    def __post_init__(self) -> None:
        if self.motor_turns is None:
            object.__setattr__(self, "motor_turns", np.eye(len(self.link_mass) - 1))


def _translations(offsets: list[list[float]]) -> FloatArray:
    poses = np.tile(np.eye(4), (len(offsets), 1, 1))
    poses[:, :3, 3] = offsets
    return poses


def kr210() -> RobotLiteral:
    """KR 210 R2700 extra, bare, KUKA's signs."""
    offsets = [
        [0, 0, 0.675],
        [0.35, 0, 0],
        [1.15, 0, 0],
        [0, 0, -0.041],
        [1.2, 0, 0],
        [0.215, 0, 0],
    ]
    gear = np.array([219.031, 235.368, 241.0, 151.226, 156.674, 123.041])
    stall = np.minimum(
        [7290, 8100, 5291, 2182, 1282, 825], np.array([33, 55, 55, 18, 18, 18]) * gear
    )
    envelope = np.array(
        [
            [[1.33, 5988], [1.81, 4503], [2.07, 2891], [2.16, 1215]],
            [[1.24, 6653], [1.68, 5003], [1.92, 3212], [2.05, 1350]],
            [[1.21, 5174], [1.64, 5040], [1.88, 4895], [1.96, 4744]],
            [[1.93, 1948], [2.62, 1681], [3.00, 1391], [3.12, 1090]],
            [[1.86, 1241], [2.53, 1194], [2.89, 1143], [3.01, 1090]],
            [[2.37, 767], [3.22, 702], [3.68, 630], [3.83, 556]],
        ]
    )
    limits = np.radians(
        [[-185, 185], [-140, -5], [-120, 155], [-350, 350], [-125, 125], [-350, 350]]
    )
    diagonals = [
        [20, 20, 20],
        [13, 31, 29.4],
        [5.59, 55.23, 55.66],
        [2.99, 28.5, 29.2],
        [0.456, 1.22, 1.32],
        [0.183, 0.489, 0.528],
        [0.071, 0.19, 0.205],
    ]
    return RobotLiteral(
        name="kr210_r2700_extra",
        joint_names=tuple(f"joint_a{i}" for i in range(1, 7)),
        link_names=("base_link", *(f"link_{i}" for i in range(1, 7))),
        joint_origin=_translations(offsets),
        joint_axis=np.array(
            [[0, 0, -1], [0, 1, 0], [0, 1, 0], [-1, 0, 0], [0, 1, 0], [-1, 0, 0]], float
        ),
        position_min=limits[:, 0],
        position_max=limits[:, 1],
        velocity_max=np.radians([123, 115, 112, 179, 172, 219]),
        acceleration_max=np.array([4.13, 3.86, 3.76, 10.41, 10.01, 12.74]),
        jerk_max=np.radians([8780, 8170, 7980, 22042, 21276, 27091]),
        link_mass=np.array([228.46, 377.29, 231.49, 173.31, 36.97, 14.81, 5.75]),
        link_com=np.array(
            [
                [0, 0, 0.2],
                [0.06905, -0.01135, -0.13275],
                [0.4949, 0.19, 0],
                [0.19737, 0, 0],
                [(57.53 * 1.1612 - 20.56 * 1.2) / 36.97, 0, 0],
                [0, 0, 0],
                [-0.215, 0, 0],
            ]
        ),
        link_inertia=np.array([np.diag(d) for d in diagonals]),
        gear_ratio=gear,
        reflected_inertia=np.array([524.4, 567.3, 573.6, 57.1, 66.3, 39.4]),
        friction_viscous=np.array([244.2, 459.2, 755.0, 70.5, 66.5, 76.8]),
        friction_coulomb=np.array([607.0, 732.8, 450.8, 81.0, 115.1, 116.6]),
        copper_loss=np.array([0.4178, 0.2878, 0.2878, 0.8356, 0.8356, 0.8356]),
        envelope_speed=envelope[:, :, 0],
        envelope_torque=np.column_stack([stall, envelope[:, :, 1]]),
        counterbalance=CounterbalanceLiteral(),
    )


def tool_155() -> LoadLiteral:
    """The 155 kg of the paper's Table II, 0.240 m in front of the flange."""
    return LoadLiteral("tool", 155.0, np.array([0.24, 0.0, 0.0]), np.diag([5.0, 4.0, 6.0]))


def random_rotation(rng: np.random.Generator) -> FloatArray:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def random_chain(rng: np.random.Generator, n: int) -> RobotLiteral:
    """Any serial chain: skew axes, rotated frames, full inertia tensors, no counterbalance."""
    origin = _translations(rng.normal(0.0, 0.5, (n, 3)).tolist())
    for pose in origin:
        pose[:3, :3] = random_rotation(rng)
    axis = rng.normal(size=(n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    inertia = []
    for _ in range(n + 1):
        E = random_rotation(rng)
        a, b, c = rng.uniform(0.5, 3.0, 3)
        inertia.append(E @ np.diag([a + b, b + c, c + a]) @ E.T)
    return RobotLiteral(
        name=f"random_{n}",
        joint_names=tuple(f"joint_{i}" for i in range(n)),
        link_names=tuple(f"link_{i}" for i in range(n + 1)),
        joint_origin=origin,
        joint_axis=axis,
        position_min=np.full(n, -np.pi),
        position_max=np.full(n, np.pi),
        velocity_max=np.full(n, 2.0),
        acceleration_max=np.full(n, 5.0),
        jerk_max=np.full(n, 100.0),
        link_mass=rng.uniform(1.0, 50.0, n + 1),
        link_com=rng.normal(0.0, 0.2, (n + 1, 3)),
        link_inertia=np.array(inertia),
        gear_ratio=np.full(n, 100.0),
        reflected_inertia=rng.uniform(1.0, 10.0, n),
        friction_viscous=rng.uniform(1.0, 10.0, n),
        friction_coulomb=rng.uniform(1.0, 10.0, n),
        copper_loss=np.full(n, 0.5),
        envelope_speed=np.tile([1.0, 2.0], (n, 1)),
        envelope_torque=np.tile([1000.0, 900.0, 500.0], (n, 1)),
    )


def on_a_rail(robot: RobotLiteral, pose: FloatArray, along: FloatArray) -> RobotLiteral:
    """The robot on a carriage of 300 kg that slides along a direction (3,) of the rail's frame,
    whose pose (4, 4) is given in link 0; its own base stands on the carriage, turned.
    """
    cross = np.array(
        [[0.0, 0.0, 1.0, 0.1], [1.0, 0.0, 0.0, -0.2], [0.0, 1.0, 0.0, 0.3], [0, 0, 0, 1.0]]
    )
    balance = robot.counterbalance
    n = len(robot.link_mass)
    turns = np.eye(n)
    turns[1:, 1:] = robot.motor_turns

    def before(value: float, values: FloatArray) -> FloatArray:
        return np.concatenate([np.full((1, *values.shape[1:]), value), values])

    return replace(
        robot,
        name=f"{robot.name} on a rail",
        joint_names=("E1", *robot.joint_names),
        link_names=("rail", *robot.link_names),
        joint_origin=np.concatenate(
            [pose[None], cross @ robot.joint_origin[:1], robot.joint_origin[1:]]
        ),
        joint_axis=np.concatenate([along[None], robot.joint_axis]),
        position_min=before(-3.0, robot.position_min),
        position_max=before(3.0, robot.position_max),
        velocity_max=before(1.9, robot.velocity_max),
        acceleration_max=before(2.0, robot.acceleration_max),
        jerk_max=before(20.0, robot.jerk_max),
        link_mass=np.concatenate([[50.0, 300.0 + robot.link_mass[0]], robot.link_mass[1:]]),
        link_com=np.concatenate([np.zeros((2, 3)), robot.link_com[1:]]),
        link_inertia=np.concatenate([np.eye(3)[None], robot.link_inertia]),
        gear_ratio=before(150.0, robot.gear_ratio),
        reflected_inertia=before(120.0, robot.reflected_inertia),
        friction_viscous=before(400.0, robot.friction_viscous),
        friction_coulomb=before(600.0, robot.friction_coulomb),
        copper_loss=before(0.6, robot.copper_loss),
        envelope_speed=np.concatenate(
            [np.linspace(0.8, 1.9, robot.envelope_speed.shape[1])[None], robot.envelope_speed]
        ),
        envelope_torque=np.concatenate(
            [
                np.linspace(9000.0, 5000.0, robot.envelope_torque.shape[1])[None],
                robot.envelope_torque,
            ]
        ),
        counterbalance=None if balance is None else replace(balance, joint=balance.joint + 1),
        motor_turns=turns,
        first_slides=True,
    )


def coupled(robot: RobotLiteral, seed: int) -> RobotLiteral:
    """The robot with motors that turn with other joints as well, each with one or two."""
    rng = np.random.default_rng(seed)
    n = len(robot.link_mass) - 1
    turns = np.eye(n)
    for motor in range(1, n):
        turns[motor, motor - 1] = rng.uniform(-1.0, 1.0)
    turns[0, -1] += 0.3 if n > 1 else 0.0
    return replace(robot, motor_turns=turns)


def power_gradients(
    model: DynamicsModel, q: FloatArray, qd: FloatArray, qdd: FloatArray
) -> Gradients:
    """Derivatives (N, n, n) of the axes' power at the DC link along a motion (N, n)."""
    torque = model.inverse_dynamics(q, qd, qdd)
    of = model.torque_gradients(q, qd, qdd)
    data = model.data
    turns = data.coupling.turns
    per_torque = (qd @ turns.T + 2.0 * data.copper_loss / data.gear_ratio**2 * torque)[:, :, None]
    return Gradients(
        per_torque * of.q,
        per_torque * of.qd + torque[:, :, None] * turns,
        per_torque * of.qdd,
    )
