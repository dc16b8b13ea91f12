"""A linear unit under the arm: external axis E1, which carries the robot's base along a straight
line and moves together with the arm.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ir_description.shapes import Capsule
from ir_msgs_py.names import EXTERNAL_AXES
from ir_values.arrays import FloatArray, frozen, in_range
from ir_values.errors import InvalidValueError, UnknownNameError

TRAVEL_MAX = 100.0
"""Farthest from E1 = 0 [m]."""
_ROUNDED = 1e-14  # of a length of 1


@dataclass(frozen=True, eq=False)
class Rail:
    """axis (3,): its direction in the frame of the robot's base_link, of length 1. low, high [m]:
    the travel of E1, 0 where base_link stands at the cell's `base`. home [m]: E1 of machine home.
    velocity [m/s], acceleration [m/s^2], jerk [m/s^3] (0: full acceleration in 0.1 s).
    carriage_mass [kg]: what moves besides the robot. capsules: of the carriage, in the frame of
    base_link (link 1). Estimated where 0: force [N] at most, reflected_mass [kg] of rotor and gear,
    friction_coulomb [N], friction_viscous [N s/m], gear_ratio [rad/m] of the motor. power [W]: of
    the motor at the carriage, 0 where it is not known.
    """

    axis: FloatArray
    low: float
    high: float
    velocity: float
    acceleration: float
    carriage_mass: float
    home: float = 0.0
    name: str = "E1"
    title: str = ""
    jerk: float = 0.0
    force: float = 0.0
    power: float = 0.0
    reflected_mass: float = 0.0
    friction_coulomb: float = 0.0
    friction_viscous: float = 0.0
    gear_ratio: float = 0.0
    capsules: tuple[Capsule, ...] = field(default=())

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        if self.name not in EXTERNAL_AXES:
            raise UnknownNameError("name of a rail", self.name, EXTERNAL_AXES)
        direction = frozen(self.axis, (3,), "rail axis")
        length = float(np.sqrt(np.square(direction).sum()))
        if abs(length - 1.0) > 1e-3:
            raise InvalidValueError(f"rail axis has the length {length:g}, must be 1")
        if abs(length - 1.0) > _ROUNDED:  # what is rounded only stays, bit for bit
            direction = frozen(direction / length, (3,), "rail axis")
        set_(self, "axis", direction)
        for name in ("low", "high", "home"):
            value = in_range(getattr(self, name), -TRAVEL_MAX, TRAVEL_MAX, "m", f"rail {name}")
            set_(self, name, value)
        if not self.low < self.high:
            raise InvalidValueError(
                f"rail travel is [{self.low:g}, {self.high:g}] m: its first end must be below the "
                "second"
            )
        if not self.low <= self.home <= self.high:
            raise InvalidValueError(
                f"rail home is {self.home:g} m, must be in [{self.low:g}, {self.high:g}] m"
            )
        for name, high, unit, needed in (
            ("velocity", 20.0, "m/s", True),
            ("acceleration", 50.0, "m/s^2", True),
            ("carriage_mass", 1e5, "kg", True),
            ("jerk", 1e4, "m/s^3", False),
            ("force", 1e6, "N", False),
            ("power", 1e6, "W", False),
            ("reflected_mass", 1e5, "kg", False),
            ("friction_coulomb", 1e5, "N", False),
            ("friction_viscous", 1e5, "N s/m", False),
            ("gear_ratio", 1e5, "rad/m", False),
        ):
            value = getattr(self, name)
            set_(self, name, in_range(value, 0.0, high, unit, f"rail {name}", open_low=needed))
        if any(capsule.link != 1 for capsule in self.capsules):
            raise InvalidValueError("a capsule of the carriage must stand on link 1, its own")
