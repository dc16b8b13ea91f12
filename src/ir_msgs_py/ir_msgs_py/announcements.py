"""Announcements of planner, driver and program runner on their topics, as values.

Timers, load and cell (latched), contacts of the robot and states of the machines, the state of a
program.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from ir_msgs_py.modes import TransitionTimes
from ir_msgs_py.report import DistancePair, PlannedMovement
from ir_values.arrays import FloatArray, at_least, finite, one_of, read_only, set_field
from ir_values.errors import InvalidValueError

# Latched announcements of driver and planner to each other: timers, load and cell.

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


# Contacts of the simulated robot, and the states of the machines around it.


@dataclass(frozen=True, eq=False, kw_only=True)
class Contact:
    """A contact that the station does not allow. stamp_ns: node clock [ns] at the first touch.

    depth [m]: deepest until the robot stood; speed [m/s] towards each other at the first touch, of
    the robot alone; force [N]: largest, estimated; stopped_after [s]: from the first touch until
    the robot stood; path_time [s] along the trajectory of this id.
    """

    pair: DistancePair
    depth: float
    speed: float
    force: float
    stopped_after: float
    stamp_ns: int = 0
    trajectory_id: str = ""
    path_time: float = 0.0

    def __post_init__(self) -> None:
        for name, unit in (("depth", "m"), ("force", "N"), ("stopped_after", "s")):
            set_field(self, name, at_least(getattr(self, name), 0.0, name, unit))
        for name, unit in (("speed", "m/s"), ("path_time", "s")):
            set_field(self, name, finite(getattr(self, name), name, unit))

    @property
    def sentence(self) -> str:
        """For people."""
        where = f" at {self.path_time:.3f} s of {self.trajectory_id}" if self.trajectory_id else ""
        return (
            f"{self.pair.body_a} touched {self.pair.body_b} ({self.pair.kind}){where}, which is "
            f"not allowed: {self.speed:.2f} m/s, {self.depth * 1e3:.1f} mm deep, about "
            f"{self.force:.0f} N (simulated), stood after {self.stopped_after * 1e3:.0f} ms"
        )


@dataclass(frozen=True)
class MachineState:
    """The state of a machine ("": it has none); next: the one it changes to, in so many seconds."""

    equipment: str
    state: str
    next: str = ""
    remaining: float = 0.0

    def __post_init__(self) -> None:
        set_field(self, "remaining", at_least(self.remaining, 0.0, "remaining", "s"))


class Event(StrEnum):
    """What happened to a movement or a pause."""

    STARTED = "started"
    ENDED = "ended"
    FAILED = "failed"
    CANCELED = "canceled"


@dataclass(frozen=True, eq=False, kw_only=True)
class ProgramState:
    """An event of movement `index` (0-based) of `total`; stamp_ns: node clock [ns]."""

    stamp_ns: int
    program_id: str
    index: int
    total: int
    event: str
    movement: PlannedMovement
    note: str = ""

    def __post_init__(self) -> None:
        set_field(self, "event", Event(one_of(self.event, list(Event), "event of a program")))
        if not 0 <= self.index < self.total:
            raise InvalidValueError(
                f"index of the movement is {self.index}: it must be in 0 .. {self.total - 1}"
            )
