"""A load of the flange: the tool, or a part held by it. Mass, centre of mass, inertia, watts and
capsules.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ir_description.arrays import frozen, frozen_inertia, frozen_pose, in_range, transformed
from ir_description.shapes import Capsule
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.errors import InvalidValueError

MASS_MAX = 2000.0
"""Largest mass [kg] a load may claim; what the robot carries is limited by
RobotModel.rated_payload.
"""

LoadKind = Literal["tool", "part"]


@dataclass(frozen=True, eq=False)
class Load:
    """What moves with the last link.

    A tool is mass data plus watts, a part is mass only. com (3,) [m] and the capsules stand in the
    frame of the last link for a tool, in the part's own frame for a part (see `placed`). inertia
    (3, 3) [kg m^2] is about com.
    """

    name: str
    kind: LoadKind
    mass: float
    com: FloatArray
    inertia: FloatArray
    capsules: tuple[Capsule, ...] = ()
    watts_always: float = 0.0
    watts_drive_bus: float = 0.0

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

    def placed(self, pose: FloatArray) -> Load:
        """Return the load with its geometry re-expressed by the pose (4, 4) of its frame in another
        frame.
        """
        pose = frozen_pose(pose, "pose")
        R = pose[:3, :3]
        inertia = R @ self.inertia @ R.T
        return replace(
            self,
            com=transformed(pose, self.com),
            inertia=(inertia + inertia.T) / 2.0,
            capsules=tuple(capsule.placed(pose) for capsule in self.capsules),
        )


def total_mass(loads: tuple[Load, ...]) -> float:
    """Return the sum of masses [kg]."""
    return float(np.sum([load.mass for load in loads]))
