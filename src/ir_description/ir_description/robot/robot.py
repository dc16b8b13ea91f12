"""The robot as data: chain, limits, bodies, drives, torque envelope, counterbalance, capsules.

With it the loads of its flange, and the tree of frames from the cell to the tool centre point.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from ir_description.poses import transformed
from ir_description.robot.power import PowerData, without_table
from ir_description.robot.rail import Rail
from ir_description.shapes import Capsule
from ir_kernels import portable
from ir_kernels.coupling import Coupling
from ir_kernels.errors import KernelError
from ir_msgs_py.names import WORLD_FRAME, axis_labels
from ir_msgs_py.trajectory import in_people_units
from ir_values.arrays import FloatArray, frozen, frozen_inertia, frozen_pose, in_range
from ir_values.errors import InvalidValueError


@dataclass(frozen=True, eq=False)
class Counterbalance:
    """A gas spring between link `joint` (0-based index; pivot) and the link it carries (rod eye).

    pivot (2,) and rod_eye (2,) are x, z [m] in the joint's frame at angle 0. With th the joint
    angle, P the rod eye turned by th about +y and l = |P - pivot|: the pressure is
    p = charge_pressure (V / (V - A (l - rod_length_at_charge)))^exponent, the force A p along the
    rod, and its torque about the positive axis is what helps the motor.
    """

    joint: int
    pivot: FloatArray
    rod_eye: FloatArray
    piston_area: float
    gas_volume: float
    charge_pressure: float
    rod_length_at_charge: float
    exponent: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "pivot", frozen(self.pivot, (2,), "pivot"))
        object.__setattr__(self, "rod_eye", frozen(self.rod_eye, (2,), "rod_eye"))
        for name, high, unit in (
            ("piston_area", 1.0, "m^2"),
            ("gas_volume", 10.0, "m^3"),
            ("charge_pressure", 1e9, "Pa"),
            ("rod_length_at_charge", 10.0, "m"),
            ("exponent", 3.0, ""),
        ):
            value = in_range(getattr(self, name), 0.0, high, unit, name, open_low=True)
            object.__setattr__(self, name, value)


class ReducedDistance(NamedTuple):
    """A self pair of capsules that are near by construction: what they keep [m] instead of the
    safety distance, where that is larger; below 0 they may overlap so far. reason: why, for people.
    """

    first: str
    second: str
    distance: float
    reason: str


_NOT_IN_DATA = ("iron_loss", "inverter_loss", "gear_loss", "idle_loss")


_TIME_SHARE = 8.94e-3  # of the drives' peak power: 500 W of the KR 210 R2700 extra's 55.9 kW


@dataclass(frozen=True, eq=False)
class RobotModel:
    """One robot. SI, all arrays float64 and read-only.

    joint_origin (n, 4, 4): pose of joint frame i, which is the frame of link i+1 at q_i = 0, in
    link i. joint_axis (n, 3): unit axis in the joint frame; signs are KUKA's, so q is A1..A6.
    position_min/max (n,) rad, velocity_max rad/s, acceleration_max rad/s^2 (the hard cap), jerk_max
    rad/s^3. link_mass (n+1,) kg, link_com (n+1, 3) m in the link frame, link_inertia (n+1, 3, 3) kg
    m^2 about the com. gear_ratio (n,), reflected_inertia kg m^2, friction_viscous Nm s/rad,
    friction_coulomb Nm (joint side), copper_loss W/Nm^2 of MOTOR torque; iron_loss W s^2/rad^2 of
    joint speed squared, inverter_loss W/Nm of motor torque magnitude, gear_loss share of |joint
    torque x speed|, idle_loss W of an inverter that is on: none where not given.
    envelope_speed (n, K) rad/s, envelope_torque (n, K+1) Nm: the torque available is
    envelope_torque[:, 0] below the first speed, steps down to [:, 1] there, is linear between
    (speed[k], torque[k+1]) and stays at the last value. It bounds the total torque, rotor inertia
    and friction included.
    capsules: of the links, without tool. self_pairs: names of the robot's own capsules that can
    touch. reduced_distances: those of them that keep a distance of their own.
    load_self_capsules: robot capsules that every capsule of a load is checked against.
    machine_home (n,) rad: the posture of Table II. rated_payload kg: tool and part together.
    title: maker and model, for people. controller: its power figures. marks: how sure each figure
    is, H, M or L, by its place in the file; estimated: the places of those that a rule estimated.
    document: the robot file as text; "" for a bundled robot: its name is enough. motor_turns
    (n, n): what a radian of each joint turns each motor, seen at the motor's own joint; not the
    identity where the axes of a wrist are coupled.
    rail: the linear unit under the arm, which then is joint 1 and slides: m, m/s, m/s^2, m/s^3, and
    N, kg, N s/m, rad/m, W s^2/m^2 where the others have Nm, kg m^2, Nm s/rad, 1, W s^2/rad^2; None:
    the base stands.
    """

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
    counterbalance: Counterbalance | None
    capsules: tuple[Capsule, ...]
    self_pairs: tuple[tuple[str, str], ...]
    load_self_capsules: tuple[str, ...]
    machine_home: FloatArray
    rated_payload: float
    iron_loss: FloatArray = field(default_factory=lambda: np.zeros(0), repr=False)
    inverter_loss: FloatArray = field(default_factory=lambda: np.zeros(0), repr=False)
    gear_loss: FloatArray = field(default_factory=lambda: np.zeros(0), repr=False)
    idle_loss: FloatArray = field(default_factory=lambda: np.zeros(0), repr=False)
    title: str = field(default="", repr=False)
    controller: PowerData = field(default_factory=without_table, repr=False)
    marks: Mapping[str, str] = field(default_factory=dict, repr=False)
    estimated: frozenset[str] = field(default=frozenset(), repr=False)
    document: str = field(default="", repr=False)
    motor_turns: FloatArray = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    reduced_distances: tuple[ReducedDistance, ...] = field(default=(), repr=False)
    rail: Rail | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        n = len(self.joint_names)
        for name in _NOT_IN_DATA:
            if len(getattr(self, name)) == 0:
                object.__setattr__(self, name, np.zeros(n))
        if self.motor_turns.size == 0:
            object.__setattr__(self, "motor_turns", np.eye(n))
        shapes: dict[str, tuple[int | None, ...]] = {
            "joint_axis": (n, 3),
            "position_min": (n,),
            "position_max": (n,),
            "velocity_max": (n,),
            "acceleration_max": (n,),
            "jerk_max": (n,),
            "link_mass": (n + 1,),
            "link_com": (n + 1, 3),
            "gear_ratio": (n,),
            "reflected_inertia": (n,),
            "friction_viscous": (n,),
            "friction_coulomb": (n,),
            "copper_loss": (n,),
            "iron_loss": (n,),
            "inverter_loss": (n,),
            "gear_loss": (n,),
            "idle_loss": (n,),
            "envelope_speed": (n, None),
            "envelope_torque": (n, None),
            "machine_home": (n,),
            "motor_turns": (n, n),
        }
        for name, shape in shapes.items():
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name))
        origins = np.array(
            [frozen_pose(pose, f"joint_origin {i}") for i, pose in enumerate(self.joint_origin)]
        )
        object.__setattr__(self, "joint_origin", frozen(origins, (n, 4, 4), "joint_origin"))
        inertias = np.array(
            [frozen_inertia(J, f"link_inertia {i}") for i, J in enumerate(self.link_inertia)]
        )
        object.__setattr__(self, "link_inertia", frozen(inertias, (n + 1, 3, 3), "link_inertia"))
        self._check_signs()
        self._check_envelope()
        self._check_names(n)
        rests = self.controller.rest_table
        if rests is not None and rests.n != n:
            raise InvalidValueError(
                f"the table of rests of its controller has postures of {rests.n} joints, the robot "
                f"has {n}"
            )
        try:
            _ = self.coupling
        except KernelError as error:
            raise InvalidValueError(str(error)) from error

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def first_slides(self) -> bool:
        """Whether joint 1 is a rail."""
        return self.rail is not None

    @property
    def base(self) -> int:
        """The link that is the arm's base: 0, or 1 on a rail."""
        return int(self.first_slides)

    def in_people_units(self, q: FloatArray) -> FloatArray:
        """Joint values (..., n), their speeds or accelerations in degrees, of a rail in m."""
        return in_people_units(self.joint_names, q)

    def from_people_units(self, values: FloatArray) -> FloatArray:
        """What `in_people_units` gives, back in rad and m."""
        q = np.radians(values)
        if self.first_slides:
            q[..., 0] = values[..., 0]
        return np.asarray(q)

    def unit(self, joint: int) -> str:
        """In which `in_people_units` gives a joint's values: deg or m."""
        return "m" if joint < self.base else "deg"

    def shown(self, joint: int, value: float, digits: int = 6) -> str:
        """A value of a joint with its unit, as people read it."""
        scale = 1.0 if joint < self.base else math.degrees(1.0)
        return f"{scale * value:.{digits}g} {self.unit(joint)}"

    def shown_range(self, joint: int) -> str:
        """The range of a joint with its unit: [-185, 185] deg."""
        scale = 1.0 if joint < self.base else math.degrees(1.0)
        ends = f"{scale * self.position_min[joint]:g}, {scale * self.position_max[joint]:g}"
        return f"[{ends}] {self.unit(joint)}"

    def axis_label(self, joint: int) -> str:
        """What people call the axis of a joint: A1 to A6, of a rail its name."""
        return axis_labels(self.joint_names)[joint]

    @cached_property
    def coupled(self) -> bool:
        """Whether a motor turns with another joint than its own."""
        return self.coupling.coupled

    @cached_property
    def coupling(self) -> Coupling:
        """Of motors and joints."""
        return Coupling(self.motor_turns)

    @cached_property
    def peak_watts(self) -> float:
        """W of all drives together at peak torque and full speed: the size of a robot's powers."""
        return float((self.envelope_torque[:, 0] * self.velocity_max).sum())

    @cached_property
    def time_value(self) -> float:
        """W that a second is worth where a request does not say: a share of `peak_watts`, in two
        digits; 500 W for the KR 210 R2700 extra.
        """
        return float(f"{_TIME_SHARE * self.peak_watts:.2g}")

    def _check_signs(self) -> None:
        positive = ("velocity_max", "acceleration_max", "jerk_max", "link_mass", "gear_ratio")
        for name in positive:
            if (getattr(self, name) <= 0.0).any():
                raise InvalidValueError(f"{name} must be above 0 everywhere")
        losses = ("copper_loss", *_NOT_IN_DATA)
        for name in ("reflected_inertia", "friction_viscous", "friction_coulomb", *losses):
            if (getattr(self, name) < 0.0).any():
                raise InvalidValueError(f"{name} must not be negative")
        if (self.position_min >= self.position_max).any():
            raise InvalidValueError("position_min must be below position_max for every joint")
        if (
            (self.machine_home < self.position_min) | (self.machine_home > self.position_max)
        ).any():
            raise InvalidValueError("machine_home lies outside the position limits")
        if np.abs(np.linalg.norm(self.joint_axis, axis=1) - 1.0).max() > 1e-12:
            raise InvalidValueError("joint_axis must hold unit vectors")
        in_range(self.rated_payload, 0.0, 1e4, "kg", "rated_payload", open_low=True)

    def _check_envelope(self) -> None:
        speed = self.envelope_speed
        torque = self.envelope_torque
        if torque.shape[1] != speed.shape[1] + 1:
            raise InvalidValueError("envelope_torque must have one column more than envelope_speed")
        if (speed <= 0.0).any() or (np.diff(speed, axis=1) <= 0.0).any():
            raise InvalidValueError("envelope_speed must be positive and rising")
        if (torque <= 0.0).any() or (np.diff(torque, axis=1) > 0.0).any():
            raise InvalidValueError("envelope_torque must be positive and must not rise with speed")

    def _check_names(self, n: int) -> None:
        """Names of links and capsules fit each other and the n joints."""
        if len(self.link_names) != n + 1:
            raise InvalidValueError(
                f"{len(self.link_names)} link names for {n} joints, must be {n + 1}"
            )
        names = [capsule.name for capsule in self.capsules]
        if len(set(names)) != len(names):
            raise InvalidValueError("a capsule name is used twice")
        if any(capsule.link > n for capsule in self.capsules):
            raise InvalidValueError(f"a capsule stands on a link beyond {n}")
        for name in (
            *(name for pair in self.self_pairs for name in pair),
            *self.load_self_capsules,
        ):
            if name not in names:
                raise InvalidValueError(
                    f"self pairs name the capsule {name}, known are {', '.join(names)}"
                )
        pairs = {frozenset(pair) for pair in self.self_pairs}
        for reduced in self.reduced_distances:
            if frozenset(reduced[:2]) not in pairs:
                raise InvalidValueError(
                    f"{reduced.first} and {reduced.second} have a distance of their own and are no "
                    "self pair"
                )
        if self.counterbalance is not None and not 0 <= self.counterbalance.joint < n:
            raise InvalidValueError(
                f"counterbalance on joint {self.counterbalance.joint}, must be in [0, {n - 1}]"
            )


# A load of the flange: the tool, or a part that the tool holds.

LIMIT_TOLERANCE = 1e-4
"""rad beyond a position limit that count as at it: what encoders and held axes leave."""
OUTSIDE_MAX = 0.35
"""rad beyond a limit from where a way back in is planned and driven: twice what a stop leaves."""
MASS_MAX = 2000.0
"""Largest mass [kg] a load may claim; what the robot carries is limited by
RobotModel.rated_payload.
"""

LoadKind = Literal["tool", "part"]


TOOL_SPEED_MAX = 100.0  # m/s
TOOL_ACCELERATION_MAX = 1e4  # m/s^2


@dataclass(frozen=True)
class ToolLimits:
    """How fast the tcp may move [m/s] and change its speed [m/s^2], 0: as the axes allow. whole:
    holds for every point of the capsules of tool and part instead.
    """

    speed: float = 0.0
    acceleration: float = 0.0
    whole: bool = False

    def __post_init__(self) -> None:
        in_range(self.speed, 0.0, TOOL_SPEED_MAX, "m/s", "tool_speed")
        in_range(self.acceleration, 0.0, TOOL_ACCELERATION_MAX, "m/s^2", "tool_acceleration")

    @property
    def asked(self) -> bool:
        """Whether anything is limited."""
        return max(self.speed, self.acceleration) > 0.0


UNLIMITED = ToolLimits()
"""As fast as the axes allow."""


@dataclass(frozen=True, eq=False)
class Load:
    """What moves with the last link.

    A tool is mass data plus watts, a part is mass only. com (3,) [m] and the capsules stand in the
    frame of the last link for a tool, in the part's own frame for a part (see `placed`). inertia
    (3, 3) [kg m^2] is about com. limits: of every movement with it.
    """

    name: str
    kind: LoadKind
    mass: float
    com: FloatArray
    inertia: FloatArray
    capsules: tuple[Capsule, ...] = ()
    watts_always: float = 0.0
    watts_drive_bus: float = 0.0
    limits: ToolLimits = UNLIMITED

    def __post_init__(self) -> None:
        if self.kind not in ("tool", "part"):
            raise InvalidValueError(f"kind of load is {self.kind!r}, must be tool or part")
        set_ = object.__setattr__
        set_(self, "mass", in_range(self.mass, 0.0, MASS_MAX, "kg", "mass", open_low=True))
        set_(self, "com", frozen(self.com, (3,), "com"))
        set_(self, "inertia", frozen_inertia(self.inertia, "inertia"))
        set_(self, "watts_always", in_range(self.watts_always, 0.0, 1e5, "W", "watts_always"))
        set_(
            self,
            "watts_drive_bus",
            in_range(self.watts_drive_bus, 0.0, 1e5, "W", "watts_drive_bus"),
        )
        names = [capsule.name for capsule in self.capsules]
        if len(set(names)) != len(names):
            raise InvalidValueError(f"load {self.name} names a capsule twice")

    def watts(self, *, drive_bus: bool) -> float:
        """Electrical power [W], with the drive bus up or off."""
        return self.watts_always + (self.watts_drive_bus if drive_bus else 0.0)

    def placed(self, pose: FloatArray) -> Load:
        """Return the load with its geometry re-expressed by the pose (4, 4) of its frame in another
        frame.
        """
        pose = frozen_pose(pose, "pose")
        R = pose[:3, :3]
        inertia = portable.matmul(R, self.inertia, R.T)
        return replace(
            self,
            com=transformed(pose, self.com),
            inertia=(inertia + inertia.T) / 2.0,
            capsules=tuple(capsule.placed(pose) for capsule in self.capsules),
        )


VOLTAGE_SHARE = 0.9
"""Share of the largest sine voltage that the back-EMF takes at full speed (an estimate): the rest
drives the current.
"""


def torque_constants(robot: RobotModel, voltage: float) -> FloatArray:
    """Torque constants (n,) [Nm/A rms] for which the back-EMF at full speed needs VOLTAGE_SHARE of
    what an inverter makes of the DC voltage [V]: k_t = 3 E / w, E = share U / sqrt(6), both rms per
    phase.
    """
    speed = np.array(robot.velocity_max) * np.array(robot.gear_ratio)
    return 3.0 * VOLTAGE_SHARE * voltage / (math.sqrt(6.0) * speed)


def total_mass(loads: tuple[Load, ...]) -> float:
    """Return the sum of masses [kg]."""
    return float(np.sum([load.mass for load in loads]))


# The tree of frames from the cell to the tool centre point: which hangs on which, and where.

TOOL0 = np.array(
    [[0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""Pose (4, 4) of tool0 at the flange: its z points out."""


class FramePose(NamedTuple):
    """A frame and its pose (4, 4) [m] in its parent."""

    parent: str
    name: str
    pose: FloatArray


def fixed_frames(
    robot: RobotModel, loads: Iterable[Load], tcp: FloatArray, base_pose: FloatArray
) -> tuple[FramePose, ...]:
    """Frames that no joint moves: base in the cell, flange, tool0, tcp (4, 4) and loads at the
    flange.
    """
    at = np.eye(4)
    return (
        FramePose(WORLD_FRAME, robot.link_names[0], base_pose),
        FramePose(robot.link_names[-1], "flange", at),
        FramePose("flange", "tool0", TOOL0),
        FramePose("flange", "tcp", tcp),
        *(FramePose("flange", f"load_{load.name}", at) for load in loads),
    )


def moving_frames(robot: RobotModel, link_poses: FloatArray) -> tuple[FramePose, ...]:
    """Frames of the joints, from the poses (n+1, 4, 4) of the links in any one frame."""
    names = robot.link_names
    return tuple(
        FramePose(names[i], names[i + 1], portable.solve(link_poses[i], link_poses[i + 1]))
        for i in range(robot.n)
    )


__all__ = ["Capsule", "Counterbalance", "ReducedDistance", "RobotModel"]
