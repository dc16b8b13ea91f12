"""Trajectory goals: tolerances, bounds, and outcomes with the codes of FollowJointTrajectory."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from ir_description.robot import LIMIT_TOLERANCE
from ir_msgs_py.announcements import Contact
from ir_msgs_py.names import joint_unit
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.load_check import LoadFinding
from ir_values.arrays import FloatArray
from ir_values.settings import check_settings, setting

# Goals and outcomes; codes of control_msgs/FollowJointTrajectory.


class ErrorCode(IntEnum):
    """How a trajectory ended."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5
    CONTACT = -6


FOR_EVER = -1.0
"""As the longest wait for the goal tolerance."""


@dataclass(frozen=True)
class JointTolerance:
    """Tolerance of one joint [rad, rad/s, rad/s^2]; 0: the default, -1: unbounded."""

    name: str
    position: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0


@dataclass(frozen=True, eq=False)
class TrajectoryGoal:
    """A trajectory with what the sender allows.

    stamp_ns: node clock at which the trajectory starts, 0 = now. goal_time [s]: longest wait for
    the goal tolerance after the end, 0 = the default, -1 = for ever. has_effort: points carry
    effort. multi_dof: number of multi-dof points. cell_hash, load: the cell and the load that it
    was planned with, "": not compared. station: whose contacts are allowed, "": none. states: of
    machines that it relies on ("lathe=door_open").
    allow_collision: start it although it is known to collide. after_stop: number of the last stop
    that the sender knows; a later one makes the goal void. None: not compared. note: what its
    outcome says beside how it ended.
    """

    trajectory: JointTrajectory
    stamp_ns: int = 0
    path_tolerance: tuple[JointTolerance, ...] = ()
    goal_tolerance: tuple[JointTolerance, ...] = ()
    goal_time: float = 0.0
    has_effort: bool = False
    multi_dof: int = 0
    label: str = ""
    cell_hash: str = ""
    load: str = ""
    station: str = ""
    states: tuple[str, ...] = ()
    allow_collision: bool = False
    after_stop: int | None = None
    note: str = ""

    def settling_time(self, settings: ExecutionSettings) -> float:
        """Longest wait for the goal tolerance [s]."""
        if self.goal_time == FOR_EVER:
            return math.inf
        return self.goal_time or settings.goal_time

    def noted(self, note: str) -> TrajectoryGoal:
        """The goal with one more note; "" for none."""
        return replace(self, note="; ".join(text for text in (self.note, note) if text))


@dataclass(frozen=True)
class GoalOutcome:
    """How goal `goal_id` ended.

    canceled: on request of its sender. max_tool_deviation [m] between commanded and simulated tcp;
    energy [J] at the mains while it ran; max_tracking_error: largest error of each joint [rad];
    settling_time [s] from the end of the command until the robot was within the goal tolerance.
    label: of the goal. load_check: what its torques say of the load, None where nothing; contact:
    the one that ended it.
    """

    goal_id: int
    code: ErrorCode
    sentence: str
    canceled: bool = False
    max_tool_deviation: float = 0.0
    energy: float = 0.0
    max_tracking_error: tuple[float, ...] = ()
    settling_time: float = 0.0
    label: str = ""
    load_check: LoadFinding | None = None
    contact: Contact | None = None

    def weighed(self, finding: LoadFinding | None) -> GoalOutcome:
        """With what was found of the load, and its sentence where something was noticed."""
        if finding is None:
            return self
        sentence = "; ".join(text for text in (self.sentence, finding.sentence) if text)
        return replace(self, sentence=sentence, load_check=finding)


# Tolerances of a goal as arrays, and the sentence for the joint that broke one.


@dataclass(frozen=True, eq=False)
class GoalTolerances:
    """Largest errors (n,) of position [rad] and speed [rad/s]; infinite where unbounded."""

    position: FloatArray
    velocity: FloatArray
    has_velocity: bool

    @classmethod
    def of(
        cls, joint_names: Sequence[str], given: Sequence[JointTolerance], default: float
    ) -> GoalTolerances:
        """Arrays in the robot's joint order; 0 means the default [rad] (speed: unbounded), -1
        unbounded. Joints that the robot doesn't have are left out.
        """
        position = np.full(len(joint_names), default)
        velocity = np.full(len(joint_names), np.inf)
        for tolerance in given:
            if tolerance.name not in joint_names:
                continue
            j = joint_names.index(tolerance.name)
            if tolerance.position != 0.0:
                position[j] = tolerance.position if tolerance.position > 0.0 else np.inf
            if tolerance.velocity > 0.0:
                velocity[j] = tolerance.velocity
        return cls(position, velocity, bool(np.isfinite(velocity).any()))

    def broken_position(self, joint_names: Sequence[str], error: FloatArray) -> str:
        """Sentence about the worst position error (n,) [rad]; "" when all are within."""
        return _worst(joint_names, error, self.position, "position", "rad")

    def broken_velocity(self, joint_names: Sequence[str], error: FloatArray) -> str:
        """Sentence about the worst speed error (n,) [rad/s]; "" when all are within."""
        return (
            _worst(joint_names, error, self.velocity, "velocity", "rad/s")
            if self.has_velocity
            else ""
        )


def _worst(names: Sequence[str], error: FloatArray, bound: FloatArray, what: str, unit: str) -> str:
    size = np.abs(error)
    if (size <= bound).all():
        return ""
    j = int((size - bound).argmax())
    unit = joint_unit(names[j], unit)
    return (
        f"{names[j]} {what} error is {error[j]:+.6g} {unit}: the tolerance is {bound[j]:g} {unit}"
    )


# Bounds of trajectories.


@dataclass(frozen=True)
class ExecutionSettings:
    """Bounds of trajectories and of their execution."""

    start_tolerance: float = setting(
        0.01,
        "How far the first point of a trajectory that starts at 0 may lie from the command, per "
        "joint.",
        unit="rad",
        minimum=1e-6,
        maximum=0.1,
    )
    path_tolerance: float = setting(
        0.05, "Default tolerance per joint while moving.", unit="rad", minimum=1e-6, maximum=1.0
    )
    goal_tolerance: float = setting(
        0.005, "Default tolerance per joint at the end.", unit="rad", minimum=1e-6, maximum=1.0
    )
    goal_time: float = setting(
        2.0,
        "How long the robot may take to come within the goal tolerance.",
        unit="s",
        minimum=0.001,
        maximum=60.0,
    )
    tube: float = setting(
        0.005,
        "Largest distance of the tool from its commanded place.",
        unit="m",
        minimum=1e-4,
        maximum=0.1,
    )
    stop_time: float = setting(
        0.3,
        "Shortest stop along the path from full speed; the limits may make it longer.",
        unit="s",
        minimum=0.05,
        maximum=5.0,
    )
    blend_time: float = setting(
        0.02,
        "Corners of positions alone are rounded over at least this time; a first velocity that "
        "jumps by more than the acceleration limit times it is refused.",
        unit="s",
        minimum=0.001,
        maximum=0.1,
    )
    corner_tolerance: float = setting(
        0.02,
        "How far points of positions alone may be passed by where their corners are rounded, per "
        "joint; beyond it the trajectory is slowed.",
        unit="rad",
        minimum=1e-4,
        maximum=0.5,
    )
    bridge_time: float = setting(
        0.25,
        "Shortest bridge from a running movement onto a trajectory that starts at 0.",
        unit="s",
        minimum=0.05,
        maximum=5.0,
    )
    join_late: bool = setting(
        False,
        "Whether a trajectory whose header stamp has passed is joined in the middle; otherwise it "
        "starts from its beginning, later.",
    )
    max_points: int = setting(
        20_000, "Longest trajectory, in points.", minimum=1, maximum=1_000_000
    )
    goal_memory: float = setting(
        64.0,
        "Memory of all trajectories that wait to be checked; what comes beyond is refused before "
        "it is converted.",
        unit="MB",
        minimum=1.0,
        maximum=4096.0,
    )
    max_duration: float = setting(3600.0, "Longest trajectory.", unit="s", minimum=1.0, maximum=1e5)
    max_delay: float = setting(
        10.0, "How far in the future a header stamp may lie.", unit="s", minimum=0.0, maximum=3600.0
    )
    position_slack: float = setting(
        LIMIT_TOLERANCE,
        "By how much a position limit may be exceeded.",
        unit="rad",
        minimum=0.0,
        maximum=0.01,
    )
    limit_slack: float = setting(
        1e-3,
        "By what share limits of velocity, acceleration and torque may be exceeded.",
        minimum=0.0,
        maximum=0.1,
    )

    def __post_init__(self) -> None:
        check_settings(self)
