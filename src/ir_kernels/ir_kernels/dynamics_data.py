"""Data of a robot's dynamics: the packed, checked arrays that both builds of the kernels read.

Loads are lumped into the last link here, so that a robot with its tool and part costs as much as
one without.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import portable
from ir_kernels.coupling import Coupling
from ir_kernels.data import ChainLike
from ir_kernels.errors import KernelError
from ir_values.arrays import FloatArray

# What the dynamics need to know of a robot and its loads: structural types, for n joints.
#
# Any object with these attributes serves (ir_description's dataclasses do). Link 0 is the base,
# link i is moved by joint i (1..n); arrays over joints are indexed 0..n-1.


class CounterbalanceLike(Protocol):
    """A gas cylinder between a pivot on the link before `joint` and an eye on the link after it."""

    @property
    def joint(self) -> int:
        """0..n-1."""

    @property
    def pivot(self) -> Sequence[float] | FloatArray:
        """(2,) x, z in the frame of the joint [m]."""

    @property
    def rod_eye(self) -> Sequence[float] | FloatArray:
        """(2,) x, z in the frame of the joint at q = 0 [m]."""

    @property
    def piston_area(self) -> float:
        """[m^2]."""

    @property
    def gas_volume(self) -> float:
        """At charge [m^3]."""

    @property
    def charge_pressure(self) -> float:
        """[Pa]."""

    @property
    def rod_length_at_charge(self) -> float:
        """[m]."""

    @property
    def exponent(self) -> float:
        """Of the gas: p V^exponent is constant."""


class LoadLike(Protocol):
    """Something bolted to the last link."""

    @property
    def name(self) -> str:
        """For messages."""

    @property
    def mass(self) -> float:
        """[kg]."""

    @property
    def com(self) -> FloatArray:
        """(3,) in the frame of the last link [m]."""

    @property
    def inertia(self) -> FloatArray:
        """(3, 3) about the centre of mass [kg m^2]."""


class RobotLike(ChainLike, Protocol):
    """Links and drives of a serial chain. Of a rail (`first_slides`) the figures are those of a
    drive that pushes: kg, N s/m, N and motor rad per m where a joint that turns has kg m^2, Nm
    s/rad, Nm and 1.
    """

    @property
    def link_mass(self) -> FloatArray:
        """(n + 1,) [kg]."""

    @property
    def link_com(self) -> FloatArray:
        """(n + 1, 3) in the links' frames [m]."""

    @property
    def link_inertia(self) -> FloatArray:
        """(n + 1, 3, 3) about the centres of mass [kg m^2]."""

    @property
    def reflected_inertia(self) -> FloatArray:
        """(n,) of rotor and gear at the joint [kg m^2]."""

    @property
    def friction_viscous(self) -> FloatArray:
        """(n,) [Nm s/rad]."""

    @property
    def friction_coulomb(self) -> FloatArray:
        """(n,) [Nm]."""

    @property
    def gear_ratio(self) -> FloatArray:
        """(n,)."""

    @property
    def copper_loss(self) -> FloatArray:
        """(n,) [W/Nm^2] of the motor torque."""

    @property
    def envelope_speed(self) -> FloatArray:
        """(n, K) joint speeds [rad/s], growing."""

    @property
    def envelope_torque(self) -> FloatArray:
        """(n, K + 1) torque available [Nm]: below the first speed, then at each."""

    @property
    def counterbalance(self) -> CounterbalanceLike | None:
        """None where there is none."""


STANDARD_GRAVITY = 9.80665  # m/s^2
# a robot without them has none
FURTHER_LOSSES = (
    "iron_loss",
    "inverter_loss",
    "gear_loss",
    "idle_loss",
)


class CounterbalanceData(NamedTuple):
    """Gas cylinder between a pivot on the link before `joint` and an eye on the link after it (all
    in the x-z plane).

    The joint's axis is +y of its frame; pivot and eye are given in that frame at q = 0, as (x, z)
    in m.
    """

    joint: int
    pivot: tuple[float, float]
    rod_eye: tuple[float, float]
    piston_area: float
    gas_volume: float
    charge_pressure: float
    rod_length_at_charge: float
    exponent: float


@dataclass(frozen=True)
class DynamicsData:
    """Inertias, drives and gravity of an n-joint serial chain; arrays are read-only.

    origin (n, 4, 4), axis (n, 3): the joints, each in the frame of the link before. mass (n,), com
    (n, 3), inertia (n, 3, 3) about the centre of mass: the moving links 1..n with the loads in the
    last one. gravity (3,): the acceleration of free fall in the frame of link 0. rotor_inertia,
    viscous, coulomb, gear_ratio, copper_loss, iron_loss, inverter_loss, gear_loss, idle_loss (n,):
    the drives, figures of the motors seen at their joints. coupling: of motors and joints.
    envelope_speed (n, K), envelope_torque (n, K + 1): torque available, a step down at
    the first speed. first_slides: joint 1 is a rail, which moves all of the mass; N and m for Nm
    and rad.
    """

    origin: FloatArray
    axis: FloatArray
    mass: FloatArray
    com: FloatArray
    inertia: FloatArray
    gravity: FloatArray
    rotor_inertia: FloatArray
    viscous: FloatArray
    coulomb: FloatArray
    gear_ratio: FloatArray
    copper_loss: FloatArray
    iron_loss: FloatArray
    inverter_loss: FloatArray
    gear_loss: FloatArray
    idle_loss: FloatArray
    envelope_speed: FloatArray
    envelope_torque: FloatArray
    counterbalance: CounterbalanceData | None
    coupling: Coupling
    first_slides: bool = False

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.mass)


def _frozen(name: str, value: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    array = np.array(value, dtype=np.float64)
    if array.shape != shape:
        raise KernelError(f"{name} has shape {array.shape}, expected {shape}")
    if not np.isfinite(array).all():
        raise KernelError(f"{name} holds a value that is not finite")
    array.setflags(write=False)
    return array


def lump(
    mass: float, com: FloatArray, inertia: FloatArray, loads: Sequence[LoadLike]
) -> tuple[float, FloatArray, FloatArray]:
    """Mass [kg], centre of mass (3,) [m] and inertia (3, 3) [kg m^2] about it of a link with loads
    bolted on.

    com (3,) and inertia (3, 3) are the link's own; parallel axis theorem. Raises KernelError for a
    load whose mass is negative or not finite.
    """
    masses = [float(mass)]
    centres = [np.asarray(com, float)]
    inertias = [np.asarray(inertia, float)]
    for load in loads:
        own = float(load.mass)
        if not (np.isfinite(own) and own >= 0.0):
            raise KernelError(
                f"load {load.name!r} has a mass of {own} kg: it has to be finite and not negative"
            )
        masses.append(own)
        centres.append(np.asarray(load.com, float))
        inertias.append(np.asarray(load.inertia, float))
    total = sum(masses)
    if total == 0.0:
        return 0.0, centres[0], inertias[0]
    moments = [m * centre for m, centre in zip(masses, centres, strict=True)]
    common = np.asarray(sum(moments) / total)
    lumped = np.zeros((3, 3))
    for m, centre, about_centre in zip(masses, centres, inertias, strict=True):
        d = centre - common
        steiner = portable.matmul(d, d) * np.eye(3) - np.outer(d, d)
        lumped += about_centre + m * steiner
    return total, common, lumped


def _counterbalance(data: CounterbalanceLike | None) -> CounterbalanceData | None:
    if data is None:
        return None
    packed = CounterbalanceData(
        joint=int(data.joint),
        pivot=(float(data.pivot[0]), float(data.pivot[1])),
        rod_eye=(float(data.rod_eye[0]), float(data.rod_eye[1])),
        piston_area=float(data.piston_area),
        gas_volume=float(data.gas_volume),
        charge_pressure=float(data.charge_pressure),
        rod_length_at_charge=float(data.rod_length_at_charge),
        exponent=float(data.exponent),
    )
    longest = float(portable.hypot(*packed.pivot) + portable.hypot(*packed.rod_eye))
    if packed.gas_volume - packed.piston_area * (longest - packed.rod_length_at_charge) <= 0.0:
        raise KernelError(
            f"counterbalance: at its longest ({longest:.3f} m) the rod leaves no volume for the "
            f"gas ({packed.gas_volume} m^3 at {packed.rod_length_at_charge} m)"
        )
    return packed


def _further_losses(robot: RobotLike, n: int) -> dict[str, FloatArray]:
    return {k: _frozen(f"robot.{k}", getattr(robot, k, np.zeros(n)), (n,)) for k in FURTHER_LOSSES}


def _check_rail(data: DynamicsData) -> None:
    """Refuse what a rail can't be."""
    turns = data.coupling.turns
    if data.n == 1:
        raise KernelError("robot has 1 joint: a rail carries at least one that turns")
    if turns[0, 1:].any() or turns[1:, 0].any() or turns[0, 0] != 1.0:
        raise KernelError("robot.motor_turns couples the rail with another joint")
    if data.counterbalance is not None and data.counterbalance.joint == 0:
        raise KernelError("counterbalance: joint 0 is a rail, it has none")


def dynamics_data(
    robot: RobotLike, loads: Sequence[LoadLike], base_pose: ArrayLike, gravity: float
) -> DynamicsData:
    """Pack a robot, its loads and its mounting.

    `base_pose` (4, 4): pose of link 0 in the world, whose z points up. `gravity` [m/s^2]. Raises
    KernelError.
    """
    n = len(robot.joint_axis)
    mass = np.array(robot.link_mass[1:], float)
    com = np.array(robot.link_com[1:], float)
    inertia = np.array(robot.link_inertia[1:], float)
    if mass.shape != (n,) or (mass < 0.0).any():
        raise KernelError(f"robot.link_mass has to be {n + 1} masses in kg, none negative")
    mass[-1], com[-1], inertia[-1] = lump(mass[-1], com[-1], inertia[-1], loads)
    pose = _frozen("base_pose", base_pose, (4, 4))
    knots = np.shape(robot.envelope_speed)[-1]
    data = DynamicsData(
        origin=_frozen("robot.joint_origin", robot.joint_origin, (n, 4, 4)),
        axis=_frozen("robot.joint_axis", robot.joint_axis, (n, 3)),
        mass=_frozen("robot.link_mass", mass, (n,)),
        com=_frozen("robot.link_com", com, (n, 3)),
        inertia=_frozen("robot.link_inertia", inertia, (n, 3, 3)),
        gravity=_frozen(
            "gravity", portable.matmul(pose[:3, :3].T, np.array([0.0, 0.0, -float(gravity)])), (3,)
        ),
        rotor_inertia=_frozen("robot.reflected_inertia", robot.reflected_inertia, (n,)),
        viscous=_frozen("robot.friction_viscous", robot.friction_viscous, (n,)),
        coulomb=_frozen("robot.friction_coulomb", robot.friction_coulomb, (n,)),
        gear_ratio=_frozen("robot.gear_ratio", robot.gear_ratio, (n,)),
        copper_loss=_frozen("robot.copper_loss", robot.copper_loss, (n,)),
        **_further_losses(robot, n),
        envelope_speed=_frozen("robot.envelope_speed", robot.envelope_speed, (n, knots)),
        envelope_torque=_frozen("robot.envelope_torque", robot.envelope_torque, (n, knots + 1)),
        counterbalance=_counterbalance(robot.counterbalance),
        coupling=Coupling(
            _frozen("robot.motor_turns", getattr(robot, "motor_turns", np.eye(n)), (n, n))
        ),
        first_slides=bool(getattr(robot, "first_slides", False)),
    )
    if data.first_slides:
        _check_rail(data)
    if (data.gear_ratio == 0.0).any():
        raise KernelError("robot.gear_ratio holds a zero")
    if (np.diff(data.envelope_speed, axis=1) <= 0.0).any() or (data.envelope_speed < 0.0).any():
        raise KernelError(
            "robot.envelope_speed has to grow from speed to speed and not be negative"
        )
    if (data.envelope_torque <= 0.0).any():
        raise KernelError("robot.envelope_torque has to be positive")
    return data
