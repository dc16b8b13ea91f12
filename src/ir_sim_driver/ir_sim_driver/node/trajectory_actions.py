"""Trajectory actions: counting goals, watching their clients, feedback and results."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Awaitable, Callable, Sequence
from typing import Any, Protocol

from ir_msgs.msg import LoadCheck
from ir_msgs_py.checks import one_line
from ir_msgs_py.ros.plan_conversions import contact_to_msg
from ir_msgs_py.ros.rclpy_inside import part, participant_of
from ir_msgs_py.ros.serving import RecordedActionServer
from ir_sim_driver.controller import Driver
from ir_sim_driver.load_check import LoadFinding
from ir_sim_driver.motion import ErrorCode, Outcome
from ir_sim_driver.node.messages import fill_load_check, fill_points, goal_from_action


class ClientWatch:
    """Whether the client of a goal has been gone for `timeout` [s]; 0: never.

    participant: of who sent it, b"" where nobody knows: any subscriber to the feedback counts then,
    and also before the participant's own has been discovered.
    """

    def __init__(self, timeout: float, participant: bytes = b"") -> None:
        self._timeout = timeout
        self._participant = participant
        self._known = False
        self._seen = time.monotonic()

    def gone(self, subscribers: Sequence[bytes]) -> bool:
        """Look at the identities of those who subscribe to the feedback now."""
        now = time.monotonic()
        own = bool(self._participant) and any(
            each.startswith(self._participant) for each in subscribers
        )
        self._known = self._known or own
        if own or (subscribers and not self._known):
            self._seen = now
        return 0.0 < self._timeout < now - self._seen


# Goals that are counted before Python objects are made of them.
#
# rclpy converts a request while it holds the interpreter, some 10 us for each point: the plant's
# thread would wait a second for a goal of 100,000 points that is refused anyway. rclpy asks the
# message's class for the function that converts it; here it gets one that looks at the C message
# first, and leaves out the points where they are more than may be.

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

    left_out: points of the request that was converted last, 0 where it is whole. Where the class
    has no such function, it is the class itself: the driver then counts what was converted.
    """

    def __init__(self, request: Any, most: Callable[[], int]) -> None:
        kind = type(request)
        self.left_out = 0
        self.as_class: Any = request
        if part(kind, "_CONVERT_TO_PY") is None:
            kind.__import_type_support__()
        capsule = part(kind, "_CONVERT_TO_PY")
        if capsule is None:
            return
        address = _api.PyCapsule_GetPointer(capsule, _api.PyCapsule_GetName(capsule))
        convert = _Convert(address)

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
        self.as_class = type("CountedRequest", (), own)()


class BoundedActionServer(RecordedActionServer):
    """An action server of goals that begin with a trajectory; most: points that are converted at
    most.
    """

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

    def goal_class(self) -> Any:
        """The counting class."""
        return self._counted.as_class

    def goal_came(self, request_id: Any, request: Any) -> None:
        """Note who has sent the goal, and how many points were left out."""
        key = bytes(request.goal_id.uuid)
        while len(self._clients) >= _CLIENTS_KEPT:  # of goals that rclpy has not accepted
            del self._clients[next(iter(self._clients))]
        self._clients[key] = participant_of(request_id)
        if self._counted.left_out:
            self._points[key] = self._counted.left_out


# Execution of goals: given to the driver, followed with feedback, canceled, answered.


class Executing(Protocol):
    """What the node lends to an action: futures, timers and its clock."""

    def future(self) -> Any:
        """A future of the node's executor."""

    def wake(self) -> None:
        """Let the executor look at its futures."""

    def every(self, seconds: float, callback: Callable[[], None]) -> Callable[[], None]:
        """Call back again and again until the returned function is called."""

    def subscribers(self, topic: str) -> Sequence[bytes]:
        """Identities of the subscriptions to a topic in the graph."""

    def now_msg(self) -> Any:
        """Present time of the node's clock, as a message."""


FEEDBACK_PERIOD = 0.05  # s: 20 Hz, enough for a person or a progress bar


class Executions:
    """Goals of one kind of action, ExecuteTrajectory or FollowJointTrajectory, called `name`, on
    `driver`.

    client_timeout [s]: how long a movement goes on when its client is gone; 0: to its end.
    """

    def __init__(
        self, driver: Driver, node: Executing, action_type: Any, name: str, client_timeout: float
    ) -> None:
        self._driver = driver
        self._node = node
        self._type = action_type
        self._feedback_topic = f"{name}/_action/feedback"  # every client subscribes to it
        self._client_timeout = client_timeout
        self._tickets: dict[bytes, int] = {}
        self._canceled: set[bytes] = set()
        self.points_of: Callable[[bytes], int] = lambda goal_id: 0  # that the server has left out
        self.client_of: Callable[[bytes], bytes] = lambda goal_id: b""  # its participant

    async def execute(self, handle: Any) -> Any:
        """Carry a goal out; the action's result."""
        key = bytes(handle.goal_id.uuid)
        request = handle.request
        limit = self._driver.max_points
        done = self._node.future()

        def ended(outcome: Outcome) -> None:
            done.set_result(outcome)
            self._node.wake()

        points = self.points_of(key) or len(request.trajectory.points)
        ticket = self._driver.submit(points, lambda: goal_from_action(request, limit), ended)
        self._tickets[key] = ticket
        if key in self._canceled:  # before it was submitted
            self._driver.cancel(ticket)
        watch = ClientWatch(self._client_timeout, self.client_of(key))

        def report() -> None:
            self._publish_feedback(handle, ticket)
            if watch.gone(self._node.subscribers(self._feedback_topic)):
                seconds = self._client_timeout
                self._driver.abandon(ticket, f"the goal has had no client for {seconds:g} s")

        end_feedback = self._node.every(FEEDBACK_PERIOD, report)
        outcome: Outcome = await _awaitable(done)
        end_feedback()
        self._tickets.pop(key, None)
        self._canceled.discard(key)
        request.trajectory.points = []  # the action keeps the request as long as the result
        return self._result(handle, outcome)

    def cancel(self, handle: Any) -> None:
        """Stop a goal along its path."""
        key = bytes(handle.goal_id.uuid)
        self._canceled.add(key)
        ticket = self._tickets.get(key)
        if ticket is not None:
            self._driver.cancel(ticket)

    def _result(self, handle: Any, outcome: Outcome) -> Any:
        result = self._type.Result()
        result.error_code = int(outcome.code)
        result.error_string = one_line(outcome.sentence)
        if hasattr(result, "max_tool_deviation"):  # ours; FollowJointTrajectory knows neither
            result.max_tool_deviation = outcome.max_tool_deviation
            result.energy = outcome.energy
            result.max_tracking_error = list(outcome.max_tracking_error)
            result.settling_time = outcome.settling_time
            result.plant = self._driver.plant.name
            result.load_check = _load_checks(outcome.load_check, self._driver.stamp_ns)
            result.contacts = [] if outcome.contact is None else [contact_to_msg(outcome.contact)]
        if outcome.canceled or (
            handle.is_cancel_requested and outcome.code is ErrorCode.SUCCESSFUL
        ):
            handle.canceled()
        elif outcome.code is ErrorCode.SUCCESSFUL:
            handle.succeed()
        else:
            handle.abort()
        return result

    def _publish_feedback(self, handle: Any, ticket: int) -> None:
        following = self._driver.following(ticket)
        if following is None:
            return
        feedback = self._type.Feedback(joint_names=list(self._driver.joint_names))
        feedback.header.stamp = self._node.now_msg()
        fill_points(feedback.desired, feedback.actual, feedback.error, following)
        handle.publish_feedback(feedback)


def _load_checks(finding: LoadFinding | None, stamp_ns: int) -> list[LoadCheck]:
    if finding is None:
        return []
    msg = LoadCheck()
    fill_load_check(msg, stamp_ns, finding)
    return [msg]


def _awaitable(future: Any) -> Awaitable[Outcome]:
    awaitable: Awaitable[Outcome] = future
    return awaitable
