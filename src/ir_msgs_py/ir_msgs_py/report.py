"""Answers of planning as values that mirror messages: reports, movements, candidates.

A report says what a movement costs and how near it comes to its limits; a planning info says how
the answer came about.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from ir_msgs_py.modes import modes_of
from ir_msgs_py.options import NO_TILT
from ir_msgs_py.search_log import SearchLog
from ir_msgs_py.trajectory import JointTrajectory
from ir_values.arrays import FloatArray, at_least, finite, not_nan, one_of, read_only, set_field
from ir_values.errors import InvalidValueError


class PairKind(StrEnum):
    """Two kinds of collision."""

    ENVIRONMENT = "environment"
    SELF = "self"


class MovementKind(StrEnum):
    """What a step of a program is."""

    SERVICE_EXIT = "service_exit"
    SERVICE_ENTRY = "service_entry"
    REGIONAL = "regional"
    PAUSE = "pause"
    CARTESIAN = "cartesian"


_INTERVAL = ("energy_low", "energy_high")


def _zeros(shape: int) -> FloatArray:
    return np.zeros(shape)


@dataclass(frozen=True, eq=False)
class DistancePair:
    """Two bodies, their signed distance [m] (negative: penetration) and closest points (3,) [m,
    frame cell].

    allowed_contact: the pair has a safety distance of its own here.
    """

    kind: str
    body_a: str
    body_b: str
    distance: float
    point_a: FloatArray
    point_b: FloatArray
    allowed_contact: bool = False

    def __post_init__(self) -> None:
        set_field(self, "kind", PairKind(one_of(self.kind, list(PairKind), "kind of pair")))
        set_field(
            self,
            "distance",
            finite(self.distance, f"distance of {self.body_a} and {self.body_b}", "m"),
        )
        set_field(self, "point_a", read_only(self.point_a, "point_a", (3,)))
        set_field(self, "point_b", read_only(self.point_b, "point_b", (3,)))


@dataclass(frozen=True, eq=False, kw_only=True)
class TrajectoryReport:
    """What a trajectory costs and how near it comes to its limits.

    duration [s]; movement_cost: W of eq. (9), not joules; energy at the mains with its 90 %
    interval energy_low to energy_high (from the uncertainty of power_parameters), joint_energy (n,)
    at the DC link (signed), base_energy of controller, drives and tool, burnt_energy in the brake
    resistor [J]; peak_power [W]; min_clearance [m] over all pairs without an allowed contact (inf:
    no pair), closest: that pair at closest_time [s]; safety_distance: S_m [m] that it was planned
    or judged with, 0 where nobody said; *_ratio (n,): largest used share of each joint's limit;
    path_length of the tcp [m]; certified: clearance and limits proved for every instant, in the
    cell of cell_hash and with this load; contacts: pairs that were allowed their own safety
    distance. torque_reserve: share of the torque envelope that was left to the feedback.
    largest_tilt [rad]: a proved bound of how far the tool leans, -1 where nobody asked; inf where
    none is proved.
    tool_speed [m/s], tool_acceleration [m/s^2]: bounds at the tcp; of every point of tool and part
    where those are limited.
    """

    duration: float = 0.0
    movement_cost: float = 0.0
    energy: float = 0.0
    energy_low: float = 0.0
    energy_high: float = 0.0
    joint_energy: FloatArray = field(default_factory=lambda: _zeros(0))
    base_energy: float = 0.0
    burnt_energy: float = 0.0
    peak_power: float = 0.0
    min_clearance: float = float("inf")
    closest: DistancePair | None = None
    closest_time: float = 0.0
    safety_distance: float = 0.0
    velocity_ratio: FloatArray = field(default_factory=lambda: _zeros(0))
    acceleration_ratio: FloatArray = field(default_factory=lambda: _zeros(0))
    jerk_ratio: FloatArray = field(default_factory=lambda: _zeros(0))
    torque_ratio: FloatArray = field(default_factory=lambda: _zeros(0))
    path_length: float = 0.0
    certified: bool = False
    cell_hash: str = ""
    load: str = ""
    contacts: tuple[DistancePair, ...] = ()
    power_parameters: str = ""
    torque_reserve: float = 0.0
    largest_tilt: float = NO_TILT
    tool_speed: float = 0.0
    tool_acceleration: float = 0.0

    def __post_init__(self) -> None:
        for name in (
            "duration",
            "burnt_energy",
            "path_length",
            "torque_reserve",
            "tool_speed",
            "tool_acceleration",
        ):
            set_field(self, name, at_least(getattr(self, name), 0.0, name))
        for name in ("movement_cost", "energy", "base_energy", "peak_power", "closest_time"):
            set_field(self, name, finite(getattr(self, name), name))
        for name in ("safety_distance", *_INTERVAL):
            set_field(self, name, finite(getattr(self, name), name))
        set_field(self, "min_clearance", not_nan(self.min_clearance, "min_clearance", "m"))
        set_field(self, "largest_tilt", not_nan(self.largest_tilt, "largest_tilt", "rad"))
        joints = np.shape(self.joint_energy)[:1] or (0,)
        for name in (
            "joint_energy",
            "velocity_ratio",
            "acceleration_ratio",
            "jerk_ratio",
            "torque_ratio",
        ):
            values = read_only(getattr(self, name), name, (None,))
            if len(values) not in (0, *joints):
                raise InvalidValueError(
                    f"{name} has {len(values)} joints: joint_energy has {joints[0]}"
                )
            set_field(self, name, values)
        set_field(self, "contacts", tuple(self.contacts))


FIRST_PATH = "first feasible"
"""How the note of the stage begins that found the first free path."""


@dataclass(frozen=True)
class PlanningStage:
    """One stage of planning, for people who ask where the time went."""

    name: str
    seconds: float
    note: str = ""

    def __post_init__(self) -> None:
        set_field(self, "seconds", finite(self.seconds, f"seconds of stage {self.name}", "s"))

    @property
    def has_first_path(self) -> bool:
        """Whether the first free path of a request was found in it."""
        return self.note.startswith(FIRST_PATH)


@dataclass(frozen=True)
class Rejection:
    """How many candidates were dropped for one reason."""

    reason: str
    count: int

    def __post_init__(self) -> None:
        if not 0 <= self.count < 2**32:
            raise InvalidValueError(
                f"count of {self.reason!r} is {self.count}: it must be in 0 .. 4294967295"
            )


@dataclass(frozen=True, eq=False)
class PlanningInfo:
    """How an answer came about.

    start: joint values (n,) [rad] that were used, empty where there is no start; start_names: their
    joints.
    iterations: work done, in the unit of max_iterations; truncated: cut by planning_time [s].
    timing: which the answer is, "synchronous" or "asynchronous"; "" where nobody chose. searches:
    logs of the searches behind it, which answers on ROS hold in a field beside this one.
    """

    planner_id: str = ""
    seed: int = 0
    start: FloatArray = field(default_factory=lambda: _zeros(0))
    start_names: tuple[str, ...] = ()
    iterations: int = 0
    truncated: bool = False
    planning_time: float = 0.0
    stages: tuple[PlanningStage, ...] = ()
    rejected: tuple[Rejection, ...] = ()
    timing: str = ""
    searches: tuple[SearchLog, ...] = ()

    def __post_init__(self) -> None:
        for name in ("seed", "iterations"):
            if not 0 <= getattr(self, name) < 2**64:
                raise InvalidValueError(
                    f"{name} is {getattr(self, name)}: it must be in 0 .. 2^64 - 1"
                )
        set_field(self, "start", read_only(self.start, "start", (None,)))
        set_field(self, "start_names", tuple(self.start_names))
        if self.start_names and len(self.start_names) != len(self.start):
            raise InvalidValueError(
                f"start has {len(self.start)} values for {len(self.start_names)} joint names"
            )
        set_field(self, "planning_time", finite(self.planning_time, "planning_time", "s"))
        set_field(self, "stages", tuple(self.stages))
        set_field(self, "rejected", tuple(self.rejected))
        set_field(self, "searches", tuple(self.searches))


@dataclass(frozen=True, eq=False, kw_only=True)
class PlannedMovement:
    """One step of a program: a movement or a pause.

    kind: a MovementKind. trajectory_id: "" for a pause; trajectory: None where only the id is
    known. duration [s]. power_mode: the mode to rest in (pauses), "" = STAND_ON_MOTORS, several as
    in modes_of. attach, detach: load that is attached or detached when this step has ended; load:
    what is attached while it runs ("gripper+part", "none"). wait_for: signals of the machines to
    wait for before; set_signals: to set after, "name=0" clears; states: of machines that it relies
    on, "lathe=door_open". since: signal that a pause is for, "" for none: it ends as long after
    that was set as planned. passes: stops that it passes without standing still.
    """

    kind: str
    from_station: str = ""
    to_station: str = ""
    trajectory_id: str = ""
    trajectory: JointTrajectory | None = None
    report: TrajectoryReport = field(default_factory=TrajectoryReport)
    duration: float = 0.0
    power_mode: str = ""
    attach: str = ""
    detach: str = ""
    load: str = ""
    wait_for: tuple[str, ...] = ()
    set_signals: tuple[str, ...] = ()
    states: tuple[str, ...] = ()
    since: str = ""
    passes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        kind = MovementKind(one_of(self.kind, list(MovementKind), "kind of movement"))
        set_field(self, "kind", kind)
        set_field(self, "duration", at_least(self.duration, 0.0, "duration of the movement", "s"))
        for name in ("wait_for", "set_signals", "states", "passes"):
            set_field(self, name, tuple(getattr(self, name)))
        modes_of(self.power_mode)
        if kind is MovementKind.PAUSE:
            if self.trajectory is not None or self.trajectory_id:
                raise InvalidValueError("a pause has no trajectory")
        elif self.power_mode:
            raise InvalidValueError(f"power_mode is {self.power_mode}: only a pause has one")
        if self.since and kind is not MovementKind.PAUSE:
            raise InvalidValueError(f"since is {self.since}: only a pause ends after a signal")

    @property
    def is_pause(self) -> bool:
        """Whether the robot stands still in this step."""
        return self.kind == MovementKind.PAUSE


# Configurations that reach a pose, and withdrawals and entries.


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
