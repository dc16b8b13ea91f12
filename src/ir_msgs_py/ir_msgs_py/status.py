"""Status of a request: a code, a sentence and its source.

The numbers are those of moveit_msgs/MoveItErrorCodes, so that a client of MoveIt reads them without
a table; INPUT_IGNORED is this project's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class StatusCode(IntEnum):
    """Numbers of moveit_msgs/MoveItErrorCodes that occur here, and one more."""

    SUCCESS = 1
    INPUT_IGNORED = 2
    FAILURE = 99999
    PLANNING_FAILED = -1
    INVALID_MOTION_PLAN = -2
    TIMED_OUT = -6
    PREEMPTED = -7
    START_STATE_IN_COLLISION = -10
    START_STATE_VIOLATES_PATH_CONSTRAINTS = -11
    GOAL_IN_COLLISION = -12
    GOAL_VIOLATES_PATH_CONSTRAINTS = -13
    INVALID_GROUP_NAME = -15
    INVALID_GOAL_CONSTRAINTS = -16
    INVALID_ROBOT_STATE = -17
    INVALID_LINK_NAME = -18
    INVALID_OBJECT_NAME = -19
    FRAME_TRANSFORM_FAILURE = -21
    ROBOT_STATE_STALE = -23
    COMMUNICATION_FAILURE = -25
    START_STATE_INVALID = -26
    GOAL_STATE_INVALID = -27
    NO_IK_SOLUTION = -31


@dataclass(frozen=True)
class Status:
    """An answer's outcome.

    code: a StatusCode where it is one of ours, else the bare number of another node.
    message: one sentence with the value, its bound and the unit; may be empty for SUCCESS.
    source: the node that answered.
    """

    code: int
    message: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        if self.code in set(StatusCode):
            object.__setattr__(self, "code", StatusCode(self.code))

    @classmethod
    def success(cls, message: str = "") -> Status:
        """SUCCESS, with a remark if there is one."""
        return cls(StatusCode.SUCCESS, message)

    @property
    def ok(self) -> bool:
        """Whether the request did what it asked for."""
        return self.code == StatusCode.SUCCESS

    @property
    def code_name(self) -> str:
        """The code as a word: "NO_IK_SOLUTION"; "CODE 7" for a number that is not ours."""
        return self.code.name if isinstance(self.code, StatusCode) else f"CODE {self.code}"

    def __str__(self) -> str:
        name = f"{self.code_name} ({int(self.code)})"
        return f"{name}: {self.message}" if self.message else name
