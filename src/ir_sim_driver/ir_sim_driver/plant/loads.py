"""Loads at the flange: named loads of the cell, custom ones, and the wrist's load diagram."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ir_description import Cell, Load, RobotModel
from ir_msgs_py.names import LOAD_SEPARATOR, NO_LOAD
from ir_msgs_py.status import StatusCode
from ir_sim_driver.errors import RequestRefusedError
from ir_values.arrays import FloatArray

# Load diagram: moment and inertia of a load, bounded by the robot's own drives.
#
# The static moment of the load about the wrist's axes may not exceed the torque that their motors
# have at full speed, in any posture: for the KR210 that allows 210 kg at 0.27 m from A6 and 0.24
# m in front of the flange, which is an estimate until it is held against a data sheet. The
# inertia may be such that the motors still reach a share of the acceleration limit.

_GRAVITY = 9.80665
_ACCELERATION = 1.0 / 3.0
"""Share of the acceleration limit that must be left: at that load point, with 105 kg m^2, it just
is.
"""


class LoadDiagram:
    """Bounds of moment [Nm] and inertia [kg m^2] about the wrist's centre and about the last
    axis.
    """

    def __init__(self, robot: RobotModel) -> None:
        origin = np.array(robot.joint_origin[-1])
        axis = np.array(robot.joint_axis[-1])
        self._mass = float(robot.rated_payload)
        # of the wrist, in the last link's frame
        self._centre: FloatArray = -origin[:3, :3].T @ origin[:3, 3]
        self._axis: FloatArray = axis
        torque = np.array(robot.envelope_torque)[-2:]
        self._moments = torque[:, -1]
        free = torque[:, 0] - np.array(robot.friction_coulomb)[-2:]
        needed = _ACCELERATION * np.array(robot.acceleration_max)[-2:]
        self._inertias: FloatArray = free / needed - np.array(robot.reflected_inertia)[-2:]

    def excess(self, text: str, loads: Sequence[Load]) -> str:
        """What loads in the last link's frame exceed, with value and bound; "" if nothing."""
        mass = float(sum(load.mass for load in loads))
        if mass > self._mass:
            return f"{text} weighs {mass:g} kg: the robot carries at most {self._mass:g} kg"
        if not loads:
            return ""
        com = sum((load.mass * load.com for load in loads), np.zeros(3)) / mass
        off_axis = com - (com @ self._axis) * self._axis
        about_centre = np.zeros((3, 3))
        about_flange = np.zeros((3, 3))
        for load in loads:
            about_centre = about_centre + _about(load, self._centre)
            about_flange = about_flange + _about(load, np.zeros(3))
        arms = np.linalg.norm(com - self._centre), np.linalg.norm(off_axis)
        inertias = np.linalg.eigvalsh(about_centre)[-1], self._axis @ about_flange @ self._axis
        for k, where in enumerate(("the wrist's centre", "the last axis")):
            moment = mass * _GRAVITY * float(arms[k])
            if not moment <= self._moments[k]:
                bound = f"the robot carries at most {self._moments[k]:.4g} Nm"
                return f"{text} has a moment of {moment:.4g} Nm about {where}: {bound}"
            if not inertias[k] <= self._inertias[k]:
                bound = f"the robot carries at most {self._inertias[k]:.4g} kg m^2"
                return f"{text} has an inertia of {inertias[k]:.4g} kg m^2 about {where}: {bound}"
        return ""


def _about(load: Load, point: FloatArray) -> FloatArray:
    """Inertia (3, 3) [kg m^2] of a load about a point (3,)."""
    r = load.com - point
    return np.asarray(load.inertia + load.mass * ((r @ r) * np.eye(3) - np.outer(r, r)))


# Carried loads: named ones of the cell joined by "+", or one that is described by numbers.

CUSTOM = "custom"
# m, kg m^2: beyond what any robot carries; the load diagram is what bounds a load
_FAR = 100.0
_BIG = 1e6
_PAYLOAD_CODE = StatusCode.PLANNING_FAILED  # -1, as controllers answer an impossible payload


@dataclass(frozen=True, eq=False)
class Carried:
    """Loads in the frame of the last link, and the text that names them."""

    text: str
    loads: tuple[Load, ...]

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return float(sum(load.mass for load in self.loads))

    @property
    def watts_always(self) -> float:
        """Electrical power [W] whatever the mode."""
        return float(sum(load.watts_always for load in self.loads))

    @property
    def watts_drive_bus(self) -> float:
        """Electrical power [W] more while the drive bus is up."""
        return float(sum(load.watts_drive_bus for load in self.loads))


def carried(cell: Cell, text: str) -> Carried:
    """Loads that `text` names: "gripper+part", or "none". Raises RequestRefusedError."""
    if text in ("", NO_LOAD):
        return Carried(NO_LOAD, ())
    known = {part.name: part.held(cell.tcp) for part in cell.parts}
    if cell.tool is not None:
        known[cell.tool.name] = cell.tool
    names = text.split(LOAD_SEPARATOR)
    for name in names:
        if name not in known:
            raise RequestRefusedError(
                StatusCode.INVALID_OBJECT_NAME,
                f"load {name[:80]!r} is unknown: known are "
                f"{', '.join((*sorted(known), NO_LOAD, CUSTOM))}",
            )
        if names.count(name) > 1:
            raise RequestRefusedError(
                StatusCode.INVALID_OBJECT_NAME, f"load {name!r} is named more than once"
            )
    return _within_payload(Carried(text, tuple(known[name] for name in names)), cell.robot)


def custom_load(
    cell: Cell, mass: float, com: FloatArray, inertia: FloatArray, always: float, drive_bus: float
) -> Carried:
    """A load from numbers [kg, m, kg m^2, W], com (3,), inertia (6,) (ixx ixy ixz iyy iyz izz) or
    none. Raises RequestRefusedError.
    """
    limit = cell.robot.rated_payload
    if not (math.isfinite(mass) and 0.0 <= mass <= limit):
        raise RequestRefusedError(
            _PAYLOAD_CODE, f"mass is {mass:g} kg: it must be in [0, {limit:g}] kg"
        )
    if inertia.size not in (0, 6):
        raise RequestRefusedError(
            _PAYLOAD_CODE, f"inertia has {inertia.size} values: it must have 6, or none"
        )
    for name, values, bound, unit in (
        ("center_of_mass", com, _FAR, "m"),
        ("inertia", inertia, _BIG, "kg m^2"),
    ):
        if not (np.abs(values) <= bound).all():  # NaN is refused too, and nothing overflows below
            raise RequestRefusedError(
                _PAYLOAD_CODE, f"{name} is {values}: at most {bound:g} {unit} each"
            )
    if mass == 0.0:
        return Carried(CUSTOM, ())
    matrix = np.zeros((3, 3))
    if inertia.size:
        matrix[np.triu_indices(3)] = inertia
        matrix = matrix + np.triu(matrix, 1).T
    else:
        matrix = np.eye(3) * (1e-6 * mass)  # a point; exactly zero is no rigid body
    try:
        load = Load(CUSTOM, "tool", mass, com, matrix, (), always, drive_bus)
    except ValueError as error:
        raise RequestRefusedError(_PAYLOAD_CODE, str(error)) from error
    return _within_payload(Carried(CUSTOM, (load,)), cell.robot)


def _within_payload(what: Carried, robot: RobotModel) -> Carried:
    excess = LoadDiagram(robot).excess(what.text, what.loads)
    if excess:
        raise RequestRefusedError(_PAYLOAD_CODE, excess)
    return what
