"""Configurations that reach a pose, and withdrawals and entries: values mirrored by messages."""

from __future__ import annotations

from dataclasses import dataclass, field

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.checks import finite, not_nan, read_only, set_field
from ir_msgs_py.errors import InvalidValueError
from ir_msgs_py.report import DistancePair, TrajectoryReport
from ir_msgs_py.trajectory import JointTrajectory


@dataclass(frozen=True, eq=False, kw_only=True)
class IkSolution:
    """A configuration q (n,) [rad] that reaches a pose.

    position_error [m], rotation_error [rad]. branch: bit 0 shoulder, bit 1 elbow, bit 2 wrist.
    turns: whole turns per joint relative to (-pi, pi]. clearance [m] with its pair; movement_cost:
    W of eq. (9).
    """

    joint_names: tuple[str, ...]
    q: FloatArray
    position_error: float = 0.0
    rotation_error: float = 0.0
    branch: int = 0
    turns: tuple[int, ...] = ()
    clearance: float = float("inf")
    movement_cost: float = 0.0
    closest: DistancePair | None = None

    def __post_init__(self) -> None:
        set_field(self, "joint_names", tuple(self.joint_names))
        set_field(self, "q", read_only(self.q, "q", (len(self.joint_names),)))
        for name in ("position_error", "rotation_error", "movement_cost"):
            set_field(self, name, finite(getattr(self, name), name))
        set_field(self, "clearance", not_nan(self.clearance, "clearance", "m"))
        set_field(self, "turns", tuple(int(turn) for turn in self.turns))
        if not 0 <= self.branch <= 7:
            raise InvalidValueError(f"branch is {self.branch}: it must be in 0 .. 7")
        for turn in self.turns:
            if not -128 <= turn <= 127:
                raise InvalidValueError(f"turns has {turn}: it must be in -128 .. 127")


@dataclass(frozen=True, eq=False, kw_only=True)
class ServiceCandidate:
    """One withdrawal from (or entry to) a machine's work area.

    method: which search found it. work, outside (n,): configurations at the two ends [rad].
    trajectory: None where only the id is known.
    """

    method: str
    joint_names: tuple[str, ...]
    work: FloatArray
    outside: FloatArray
    trajectory_id: str
    trajectory: JointTrajectory | None = None
    report: TrajectoryReport = field(default_factory=TrajectoryReport)

    def __post_init__(self) -> None:
        set_field(self, "joint_names", tuple(self.joint_names))
        shape = (len(self.joint_names),)
        set_field(self, "work", read_only(self.work, "work configuration", shape))
        set_field(self, "outside", read_only(self.outside, "outside configuration", shape))
