"""What the wrist can carry: moment and inertia of a load, bounded by the robot's own drives.

The static moment of the load about the wrist's axes may not exceed the torque that their motors
have at full
speed, in any posture: for the KR210 that allows 210 kg at 0.27 m from A6 and 0.24 m in front of the
flange, which is an estimate until it is held against a data sheet. The inertia may be such that the
motors still reach a share of the acceleration limit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ir_description import Load, RobotModel
from ir_msgs_py.arrays import FloatArray

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
        self._centre: FloatArray = (
            -origin[:3, :3].T @ origin[:3, 3]
        )  # of the wrist, in the last link's frame
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
        distances = np.linalg.norm(com - self._centre), np.linalg.norm(off_axis)
        about_centre = sum((_about(load, self._centre) for load in loads), np.zeros((3, 3)))
        about_flange = sum((_about(load, np.zeros(3)) for load in loads), np.zeros((3, 3)))
        inertias = np.linalg.eigvalsh(about_centre)[-1], self._axis @ about_flange @ self._axis
        for k, where in enumerate(("the wrist's centre", "the last axis")):
            moment = mass * _GRAVITY * float(distances[k])
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
