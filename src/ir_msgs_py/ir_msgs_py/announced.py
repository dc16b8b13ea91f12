"""What driver and planner announce to each other: timers, load and cell; on latched topics."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.checks import at_least, finite, read_only, set_field
from ir_msgs_py.transitions import TransitionTimes

DRIVER = "driver"
DATA = "data"
"""Where timers and transition times are from: the driver's controller, or the data file and the
settings.
"""


@dataclass(frozen=True)
class ControllerTimers:
    """What a controller does by itself: its brakes close brakes_after [s] on motors; its transition
    times.
    """

    brakes_after: float
    transitions: TransitionTimes = field(default_factory=TransitionTimes)

    def __post_init__(self) -> None:
        set_field(self, "brakes_after", at_least(self.brakes_after, 0.0, "brakes_after", "s"))


@dataclass(frozen=True, eq=False)
class CarriedLoad:
    """What the robot carries: text names loads of the cell ("gripper+part", "none") or is "custom".

    mass [kg], center_of_mass (3,) [m] in the last link's frame and inertia (3, 3) [kg m^2] about
    it, in all; watts_always, watts_drive_bus [W].
    """

    text: str
    mass: float = 0.0
    center_of_mass: FloatArray = field(default_factory=lambda: np.zeros(3))
    inertia: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    watts_always: float = 0.0
    watts_drive_bus: float = 0.0

    def __post_init__(self) -> None:
        set_field(self, "mass", at_least(self.mass, 0.0, "mass of the load", "kg"))
        set_field(self, "center_of_mass", read_only(self.center_of_mass, "center_of_mass", (3,)))
        set_field(self, "inertia", read_only(self.inertia, "inertia", (3, 3)))
        for name in ("watts_always", "watts_drive_bus"):
            set_field(self, name, finite(getattr(self, name), name, "W"))


@dataclass(frozen=True, eq=False)
class CellState:
    """The planner's cell: name, hash of all that a plan depends on, its machines, and the text of
    its file.

    Of machine k: equipment[k] its name, poses[k] (4, 4) in the cell, enabled[k], states[k] ("": it
    has none).
    """

    name: str
    hash: str
    cell_yaml: str
    equipment: tuple[str, ...] = ()
    poses: tuple[FloatArray, ...] = ()
    enabled: tuple[bool, ...] = ()
    states: tuple[str, ...] = ()
