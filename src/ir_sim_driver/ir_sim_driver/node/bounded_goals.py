"""Goals that are counted before Python objects are made of them.

rclpy converts a request while it holds the interpreter, some 10 us for each point: the plant's
thread, and a press of the emergency stop, would wait 0.2 s for a goal of 20,000 points, and a
second for one of 100,000 that is refused anyway. Here the C message is looked at first: the points
of what is refused are left out, and the others are converted one by one, so that other threads run
in between.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from itertools import takewhile
from typing import Any, NamedTuple

import numpy as np
from rclpy.serialization import deserialize_message
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from ir_msgs_py.ros.rclpy_inside import (
    Convert,
    CSequence,
    converter,
    lookalike,
    part,
    put,
)
from ir_msgs_py.ros.serving import RecordedActionServer
from ir_sim_driver.motion import ErrorCode

_NAMES_MAX = 100  # joints, tolerances and states of a goal: a robot has ten
_AT_ONCE = 50  # points that are converted without a pause for other threads, half a millisecond


class _Trajectory(ctypes.Structure):
    """A JointTrajectory, or a MultiDOFJointTrajectory."""

    _fields_ = (
        ("stamp", ctypes.c_int32 * 2),
        ("frame_id", CSequence),
        ("joint_names", CSequence),
        ("points", CSequence),
    )


_HEAD = (
    ("goal_id", ctypes.c_uint8 * 16),
    ("trajectory", _Trajectory),
    ("multi_dof", _Trajectory),
)


def _layout(goal: Any) -> Any:
    """Begin of a SendGoal request in C whose goal begins with the two trajectories: up to the last
    of the sequences that follow them, which are tolerances. control_msgs has four, ours has two.
    """
    fields = list(goal.get_fields_and_field_types().items())[2:]
    lists = [name for name, _ in takewhile(lambda each: each[1].startswith("sequence<"), fields)]
    own = {"_fields_": (*_HEAD, *((name, CSequence) for name in lists)), "lists": lists}
    return type("GoalRequest", (ctypes.Structure,), own)


class _Point(ctypes.Structure):
    """A JointTrajectoryPoint."""

    _fields_ = (
        ("positions", CSequence),
        ("velocities", CSequence),
        ("accelerations", CSequence),
        ("effort", CSequence),
        ("time_from_start", ctypes.c_int32 * 2),
    )


_WORDS = ctypes.sizeof(_Point) // 8  # of a point; every third of the first twelve is a size


def _bytes_of(points: CSequence) -> int:
    """Bytes of the numbers in a C sequence of points, which need not be six each."""
    if not points.size:
        return 0
    words = (ctypes.c_uint64 * (_WORDS * points.size)).from_address(points.data)
    table = np.frombuffer(words, np.uint64).reshape(points.size, _WORDS)
    return 8 * int(table[:, 1:12:3].sum())


def _converted(
    convert: Callable[[int], Any], message: int, points: CSequence
) -> tuple[Any, list[Any]]:
    """The message without its points, and the points, made one by one."""
    size = points.size
    points.size = 0
    whole = convert(message)
    points.size = size
    one = converter(JointTrajectoryPoint)
    assert one is not None  # its trajectory has one
    made = []
    for k in range(size):
        made.append(one(points.data + k * ctypes.sizeof(_Point)))
        if k % _AT_ONCE == _AT_ONCE - 1:
            time.sleep(0)  # lets another thread run
    return whole, made


class Admission(NamedTuple):
    """What the driver says of a goal before it is converted: its ticket, or why it is refused."""

    ticket: int = 0
    refusal: str = ""


Admit = Callable[[int, int, int], Admission]
"""Asked with points, bytes, and when it was sent [ns of the sender's clock; 0: unknown]."""


class _CountedRequest:
    """Looks like the class `request` to rclpy; sent [ns]: when the next one was written.

    admission: of the request that was converted last. Where it is refused its points are left out.
    known: whether there is a goal of this id already, which rclpy refuses. Where the class has no
    function that converts it, it is the class itself: the driver then counts what was converted.
    """

    def __init__(self, request: Any, admit: Admit, known: Callable[[bytes], bool]) -> None:
        kind = type(request)
        convert = converter(kind)
        self.admission = Admission()
        self.sent = 0
        self.as_class: Any = request
        if convert is None:
            return
        layout = _layout(request().goal)

        def counted(message: int) -> Any:
            head = layout.from_address(message)
            points = head.trajectory.points
            self.admission = Admission()
            if not known(bytes(head.goal_id)):
                self.admission = _judged(head, admit, self.sent)
            if not self.admission.ticket:
                _emptied(head)  # what is there is freed by its capacity, whatever its size
                return convert(message)
            whole, made = _converted(convert, message, points)
            put(whole.goal.trajectory, "points", made)
            return whole

        self._kept = Convert(counted)
        self.as_class = lookalike(kind, self._kept)


def _judged(head: Any, admit: Admit, sent: int) -> Admission:
    """What becomes of a goal by its counts alone."""
    trajectory = head.trajectory
    multi_dof = head.multi_dof
    if multi_dof.points.size or multi_dof.joint_names.size:
        return Admission(
            refusal=f"multi_dof_trajectory has {multi_dof.points.size} points: it must be empty, "
            "the robot has joints only"
        )
    counts = {"joint names": trajectory.joint_names.size}
    counts |= {_said(name): getattr(head, name).size for name in head.lists}
    for name, count in counts.items():
        if count > _NAMES_MAX:
            return Admission(refusal=f"the goal has {count} {name}: at most {_NAMES_MAX}")
    points = trajectory.points
    return admit(points.size, _bytes_of(points), sent)


def _said(field: str) -> str:
    """A list of tolerances by its name in a sentence."""
    return f"{field.replace('_', ' ').removesuffix('tolerance')}tolerances"


def _emptied(head: Any) -> None:
    """Leave out the points, and what else is too long."""
    head.trajectory.points.size = 0
    head.multi_dof.points.size = 0
    names = (head.trajectory.joint_names, head.multi_dof.joint_names)
    for each in (*names, *(getattr(head, name) for name in head.lists)):
        each.size = each.size if each.size <= _NAMES_MAX else 0


class BoundedActionServer(RecordedActionServer):
    """An action server of goals that begin with a trajectory; admit: asked before a goal is
    converted.
    """

    def __init__(self, node: Any, action_type: Any, *arguments: Any, admit: Admit, **options: Any):
        self._admissions: dict[bytes, Admission] = {}
        self._counted = _CountedRequest(
            action_type.Impl.SendGoalService.Request, admit, self._is_known
        )
        super().__init__(node, action_type, *arguments, **options)

    def _is_known(self, goal_id: bytes) -> bool:
        return goal_id in self._admissions or goal_id in (part(self, "_goal_handles") or ())

    def admission_of(self, goal_id: bytes) -> Admission:
        """Ticket or refusal of a goal. Asked once."""
        return self._admissions.pop(goal_id, Admission())

    def unknown_result(self, result: Any) -> None:
        """A code of 0 would be SUCCESSFUL."""
        result.error_code = int(ErrorCode.INVALID_GOAL)
        result.error_string = "there is no such goal, or its result is not kept any more"

    def goal_class(self) -> Any:
        """The counting class."""
        return self._counted.as_class

    def goal_sent(self, sent: int) -> None:
        """Note it for who admits the goal."""
        super().goal_sent(sent)
        self._counted.sent = sent

    def goal_came(self, request_id: Any, request: Any) -> None:
        """Note who has sent the goal, and what the driver said of it."""
        super().goal_came(request_id, request)
        key = bytes(request.goal_id.uuid)
        if self._counted.admission != Admission():
            self._admissions[key] = self._counted.admission


class TrajectoryReader:
    """Reads JointTrajectories from bytes, point by point, so that other threads run in between."""

    def __init__(self) -> None:
        convert = converter(JointTrajectory)
        self._class: Any = JointTrajectory
        if convert is None:
            return

        def parted(message: int) -> Any:
            points = _Trajectory.from_address(message).points
            whole, made = _converted(convert, message, points)
            put(whole, "points", made)
            return whole

        self._kept = Convert(parted)
        self._class = lookalike(JointTrajectory, self._kept)

    def read(self, data: bytes) -> Any:
        """The message. Raises what rclpy raises for bytes that are none."""
        return deserialize_message(data, self._class)
