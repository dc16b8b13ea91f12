"""Action goals that are counted before Python objects are made of them.

rclpy converts a request while it holds the interpreter, some 10 us for each point: the plant's
thread would wait a second for a goal of 100,000 points that is refused anyway. rclpy asks the
message's class for the function that converts it; here it gets one that looks at the C message
first, and leaves out the points where they are more than may be.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

from ir_msgs_py.ros.serving import RecordedActionServer
from ir_sim_driver.node.goal_clients import participant_of

_CLIENTS_KEPT = 1000
_Convert = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p)
_api = ctypes.pythonapi
_api.PyCapsule_GetName.restype = ctypes.c_char_p
_api.PyCapsule_GetName.argtypes = [ctypes.py_object]
_api.PyCapsule_GetPointer.restype = ctypes.c_void_p
_api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
_api.PyCapsule_New.restype = ctypes.py_object
_api.PyCapsule_New.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]


class _Sequence(ctypes.Structure):
    """Of rosidl_runtime_c; a string has the same layout."""

    _fields_ = (("data", ctypes.c_void_p), ("size", ctypes.c_size_t), ("capacity", ctypes.c_size_t))


class _Trajectory(ctypes.Structure):
    """A JointTrajectory, or a MultiDOFJointTrajectory."""

    _fields_ = (
        ("stamp", ctypes.c_int32 * 2),
        ("frame_id", _Sequence),
        ("joint_names", _Sequence),
        ("points", _Sequence),
    )


class _GoalRequest(ctypes.Structure):
    """The begin of a SendGoal request whose goal begins with the two trajectories."""

    _fields_ = (
        ("goal_id", ctypes.c_uint8 * 16),
        ("trajectory", _Trajectory),
        ("multi_dof", _Trajectory),
    )


class _CountedRequest:
    """Looks like the class `request` to rclpy, and leaves points out where there are more than
    most().

    left_out: points of the request that was converted last, 0 where it is whole.
    """

    def __init__(self, request: Any, most: Callable[[], int]) -> None:
        kind = type(request)
        if kind._CONVERT_TO_PY is None:
            kind.__import_type_support__()
        capsule = kind._CONVERT_TO_PY
        address = _api.PyCapsule_GetPointer(capsule, _api.PyCapsule_GetName(capsule))
        convert = _Convert(address)
        self.left_out = 0

        def counted(message: int) -> int | None:
            head = _GoalRequest.from_address(message)
            points = max(head.trajectory.points.size, head.multi_dof.points.size)
            self.left_out = points if points > most() else 0
            if self.left_out:  # what is there is freed by its capacity, whatever its size
                head.trajectory.points.size = head.multi_dof.points.size = 0
            return convert(message)  # type: ignore[no-any-return]

        self._kept = _Convert(counted)
        pointer = ctypes.cast(self._kept, ctypes.c_void_p)
        own = {
            "_TYPE_SUPPORT": kind._TYPE_SUPPORT,
            "_CREATE_ROS_MESSAGE": kind._CREATE_ROS_MESSAGE,
            "_DESTROY_ROS_MESSAGE": kind._DESTROY_ROS_MESSAGE,
            "_CONVERT_TO_PY": _api.PyCapsule_New(pointer, None, None),
        }
        self.as_class: Any = type("CountedRequest", (), own)()


class BoundedActionServer(RecordedActionServer):
    """An action server of goals that begin with a trajectory; most: points that are converted at
    most.
    """

    _is_goal_request_ready: bool

    def __init__(
        self, node: Any, action_type: Any, *arguments: Any, most: Callable[[], int], **options: Any
    ):
        self._counted = _CountedRequest(action_type.Impl.SendGoalService.Request, most)
        self._points: dict[bytes, int] = {}
        self._clients: dict[bytes, bytes] = {}
        super().__init__(node, action_type, *arguments, **options)

    def points_of(self, goal_id: bytes) -> int:
        """How many points a goal had that were left out; 0 for one that is whole. Asked once."""
        return self._points.pop(goal_id, 0)

    def client_of(self, goal_id: bytes) -> bytes:
        """Participant of who has sent a goal; b"" where it is not known. Asked once."""
        return self._clients.pop(goal_id, b"")

    def take_data(self) -> dict[str, Any]:
        """Take what has come, goals by the counting class."""
        goal = None
        if self._is_goal_request_ready:
            self._is_goal_request_ready = False
            with self._lock:
                goal = self._handle.take_goal_request(self._counted.as_class)
        data: dict[str, Any] = super().take_data()
        if goal is not None and all(goal):
            data["goal"] = goal
            while len(self._clients) >= _CLIENTS_KEPT:  # of goals that rclpy has not accepted
                del self._clients[next(iter(self._clients))]
            self._clients[bytes(goal[1].goal_id.uuid)] = participant_of(goal[0])
            if self._counted.left_out:
                self._points[bytes(goal[1].goal_id.uuid)] = self._counted.left_out
        return data
