"""What the simulated robot touches, and the states of the machines around it."""

from __future__ import annotations

from dataclasses import dataclass

from ir_msgs_py.checks import at_least, finite, set_field
from ir_msgs_py.report import DistancePair


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
