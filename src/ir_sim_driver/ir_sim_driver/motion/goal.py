"""What is asked of the executor and how it ended; codes of control_msgs/FollowJointTrajectory."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

from ir_msgs_py.contact import Contact
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.load_check import LoadFinding


class ErrorCode(IntEnum):
    """How a trajectory ended."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5
    CONTACT = -6


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
    the goal tolerance after the end, 0 = the default. has_effort: points carry effort. multi_dof:
    number of multi-dof points. cell_hash, load: the cell and the load that it was planned with, "":
    not compared. station: whose contacts are allowed, "": none. states: of machines that it relies
    on ("lathe=door_open").
    allow_collision: start it although it is known to collide.
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


@dataclass(frozen=True)
class Outcome:
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

    def weighed(self, finding: LoadFinding | None) -> Outcome:
        """With what was found of the load, and its sentence where something was noticed."""
        if finding is None:
            return self
        sentence = "; ".join(text for text in (self.sentence, finding.sentence) if text)
        return replace(self, sentence=sentence, load_check=finding)
