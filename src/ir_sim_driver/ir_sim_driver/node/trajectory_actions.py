"""Trajectory actions: counting goals, watching their clients, feedback and results."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Awaitable, Callable, Sequence
from itertools import takewhile
from typing import Any, NamedTuple, Protocol

import numpy as np
from rclpy.serialization import deserialize_message
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from ir_msgs.msg import LoadCheck
from ir_msgs_py.ros.plan_conversions import contact_to_msg
from ir_msgs_py.ros.rclpy_inside import part, participant_of
from ir_msgs_py.ros.serving import RecordedActionServer
from ir_sim_driver.controller import Driver, refused
from ir_sim_driver.load_check import LoadFinding
from ir_sim_driver.motion import ErrorCode, GoalOutcome, TrajectoryGoal
from ir_sim_driver.node.messages import fill_load_check, fill_points, goal_from_action
from ir_values.errors import one_line

_DISCOVERY = 10.0  # s in which the client of a goal shows in the graph, on a busy machine too


class ClientWatch:
    """Whether the client of a goal has been gone for `timeout` [s]; 0: never.

    participant: of who sent it. b"" where nobody knows: any client of the action counts then. One
    that does not show in the graph within `discovery` [s] can't be watched and counts as gone;
    until then any client counts.
    """

    def __init__(
        self, timeout: float, participant: bytes = b"", discovery: float = _DISCOVERY
    ) -> None:
        self._timeout = timeout
        self._participant = participant
        self._known = False
        self._seen = time.monotonic()
        self._until = self._seen + discovery

    def gone(self, clients: Sequence[bytes]) -> bool:
        """Look at the identities of those who are clients of the action now."""
        now = time.monotonic()
        own = any(each.startswith(self._participant) for each in clients)
        self._known = self._known or (own and bool(self._participant))
        discovering = bool(clients) and not self._known and now < self._until
        if own or discovering:
            self._seen = now
        return 0.0 < self._timeout < now - self._seen


# Goals that are counted before Python objects are made of them.
#
# rclpy converts a request while it holds the interpreter, some 10 us for each point: the plant's
# thread, and a press of the emergency stop, would wait 0.2 s for a goal of 20,000 points, and a
# second for one of 100,000 that is refused anyway. rclpy asks the message's class for the
# function that converts it; here it gets one that looks at the C message first, leaves out the
# points of what is refused, and converts the others one by one, so that other threads run in
# between.

_CLIENTS_KEPT = 1000
_NAMES_MAX = 100  # joints, tolerances and states of a goal: a robot has ten
_AT_ONCE = 50  # points that are converted without a pause for other threads, half a millisecond
_Convert = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)
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
    own = {"_fields_": (*_HEAD, *((name, _Sequence) for name in lists)), "lists": lists}
    return type("GoalRequest", (ctypes.Structure,), own)


class _Point(ctypes.Structure):
    """A JointTrajectoryPoint."""

    _fields_ = (
        ("positions", _Sequence),
        ("velocities", _Sequence),
        ("accelerations", _Sequence),
        ("effort", _Sequence),
        ("time_from_start", ctypes.c_int32 * 2),
    )


_WORDS = ctypes.sizeof(_Point) // 8  # of a point; every third of the first twelve is a size


def _converter(kind: Any) -> Callable[[int], Any] | None:
    """The function that makes an object of a C message of this class; None where it has none."""
    if part(kind, "_CONVERT_TO_PY") is None:
        kind.__import_type_support__()
    capsule = part(kind, "_CONVERT_TO_PY")
    if capsule is None:
        return None
    return _Convert(_api.PyCapsule_GetPointer(capsule, _api.PyCapsule_GetName(capsule)))


def _bytes_of(points: _Sequence) -> int:
    """Bytes of the numbers in a C sequence of points, which need not be six each."""
    if not points.size:
        return 0
    words = (ctypes.c_uint64 * (_WORDS * points.size)).from_address(points.data)
    table = np.frombuffer(words, np.uint64).reshape(points.size, _WORDS)
    return 8 * int(table[:, 1:12:3].sum())


def _converted(
    convert: Callable[[int], Any], message: int, points: _Sequence
) -> tuple[Any, list[Any]]:
    """The message without its points, and the points, made one by one."""
    size = points.size
    points.size = 0
    whole = convert(message)
    points.size = size
    one = _converter(JointTrajectoryPoint)
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


Admit = Callable[[int, int], Admission]


class _CountedRequest:
    """Looks like the class `request` to rclpy; admit: from points and bytes.

    admission: of the request that was converted last. Where it is refused its points are left out.
    known: whether there is a goal of this id already, which rclpy refuses. Where the class has no
    function that converts it, it is the class itself: the driver then counts what was converted.
    """

    def __init__(self, request: Any, admit: Admit, known: Callable[[bytes], bool]) -> None:
        kind = type(request)
        convert = _converter(kind)
        self.admission = Admission()
        self.as_class: Any = request
        if convert is None:
            return
        layout = _layout(request().goal)

        def counted(message: int) -> Any:
            head = layout.from_address(message)
            points = head.trajectory.points
            self.admission = Admission()
            if not known(bytes(head.goal_id)):
                self.admission = _judged(head, admit)
            if not self.admission.ticket:
                _emptied(head)  # what is there is freed by its capacity, whatever its size
                return convert(message)
            whole, made = _converted(convert, message, points)
            whole.goal.trajectory._points = made
            return whole

        self._kept = _Convert(counted)
        self.as_class = _lookalike(kind, self._kept)


def _judged(head: Any, admit: Admit) -> Admission:
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
    return admit(points.size, _bytes_of(points))


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


def _lookalike(kind: Any, convert: Any) -> Any:
    """A class that rclpy takes for `kind`, whose messages `convert` makes."""
    pointer = ctypes.cast(convert, ctypes.c_void_p)
    own = {
        "_TYPE_SUPPORT": kind._TYPE_SUPPORT,
        "_CREATE_ROS_MESSAGE": kind._CREATE_ROS_MESSAGE,
        "_DESTROY_ROS_MESSAGE": kind._DESTROY_ROS_MESSAGE,
        "_CONVERT_TO_PY": _api.PyCapsule_New(pointer, None, None),
    }
    return type("Lookalike", (), own)()


class BoundedActionServer(RecordedActionServer):
    """An action server of goals that begin with a trajectory; admit: asked before a goal is
    converted.
    """

    def __init__(self, node: Any, action_type: Any, *arguments: Any, admit: Admit, **options: Any):
        self._admissions: dict[bytes, Admission] = {}
        self._clients: dict[bytes, bytes] = {}
        self._counted = _CountedRequest(
            action_type.Impl.SendGoalService.Request, admit, self._is_known
        )
        super().__init__(node, action_type, *arguments, **options)

    def _is_known(self, goal_id: bytes) -> bool:
        return goal_id in self._admissions or goal_id in (part(self, "_goal_handles") or ())

    def admission_of(self, goal_id: bytes) -> Admission:
        """Ticket or refusal of a goal. Asked once."""
        return self._admissions.pop(goal_id, Admission())

    def client_of(self, goal_id: bytes) -> bytes:
        """Participant of who has sent a goal; b"" where it is not known. Asked once."""
        return self._clients.pop(goal_id, b"")

    def goal_class(self) -> Any:
        """The counting class."""
        return self._counted.as_class

    def goal_came(self, request_id: Any, request: Any) -> None:
        """Note who has sent the goal, and what the driver said of it."""
        key = bytes(request.goal_id.uuid)
        while len(self._clients) >= _CLIENTS_KEPT:  # of goals that rclpy has not accepted
            self._clients.pop(next(iter(self._clients)), None)
        self._clients[key] = participant_of(request_id)
        if self._counted.admission != Admission():
            self._admissions[key] = self._counted.admission


class TrajectoryReader:
    """Reads JointTrajectories from bytes, point by point, so that other threads run in between."""

    def __init__(self) -> None:
        convert = _converter(JointTrajectory)
        self._class: Any = JointTrajectory
        if convert is None:
            return

        def parted(message: int) -> Any:
            points = _Trajectory.from_address(message).points
            whole, made = _converted(convert, message, points)
            whole._points = made
            return whole

        self._kept = _Convert(parted)
        self._class = _lookalike(JointTrajectory, self._kept)

    def read(self, data: bytes) -> Any:
        """The message. Raises what rclpy raises for bytes that are none."""
        return deserialize_message(data, self._class)


# Execution of goals: given to the driver, followed with feedback, canceled, answered.


class Executing(Protocol):
    """What the node lends to an action: futures, timers and its clock."""

    def future(self) -> Any:
        """A future of the node's executor."""

    def wake(self) -> None:
        """Let the executor look at its futures."""

    def every(self, seconds: float, callback: Callable[[], None]) -> Callable[[], None]:
        """Call back again and again until the returned function is called."""

    def clients_of(self, action: str) -> Sequence[bytes]:
        """Identities of the clients of an action in the graph."""

    def now_msg(self) -> Any:
        """Time of the plant, as a message."""


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
        self._name = name
        self._client_timeout = client_timeout
        self._tickets: dict[bytes, int] = {}
        self._canceled: set[bytes] = set()
        self.admission_of: Callable[[bytes], Admission] = lambda goal_id: Admission()
        self.client_of: Callable[[bytes], bytes] = lambda goal_id: b""  # its participant

    async def execute(self, handle: Any) -> Any:
        """Carry a goal out; the action's result."""
        key = bytes(handle.goal_id.uuid)
        request = handle.request
        limit = self._driver.max_points
        done = self._node.future()

        def ended(outcome: GoalOutcome) -> None:
            done.set_result(outcome)
            self._node.wake()

        def read() -> TrajectoryGoal:
            goal = goal_from_action(request, limit)
            request.trajectory.points = []  # the arrays of the goal are all that is needed
            return goal

        admission = self.admission_of(key)
        client = self.client_of(key)
        if admission.refusal:
            return self._result(handle, refused(admission.refusal))
        points = len(request.trajectory.points)
        ticket = self._driver.submit(points, read, ended, admission.ticket)
        self._tickets[key] = ticket
        if key in self._canceled:  # before it was submitted
            self._driver.cancel(ticket)
        watch = ClientWatch(self._client_timeout, client)

        def report() -> None:
            self._publish_feedback(handle, ticket)
            if watch.gone(self._node.clients_of(self._name)):
                seconds = self._client_timeout
                self._driver.abandon(ticket, f"the goal has had no client for {seconds:g} s")

        end_feedback = self._node.every(FEEDBACK_PERIOD, report)
        outcome: GoalOutcome = await _awaitable(done)
        end_feedback()
        self._tickets.pop(key, None)
        self._canceled.discard(key)
        request.trajectory.points = []  # of a goal that was not read; rclpy keeps it for a minute
        return self._result(handle, outcome)

    def cancel(self, handle: Any) -> None:
        """Stop a goal along its path."""
        key = bytes(handle.goal_id.uuid)
        self._canceled.add(key)
        ticket = self._tickets.get(key)
        if ticket is not None:
            self._driver.cancel(ticket)

    def _result(self, handle: Any, outcome: GoalOutcome) -> Any:
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


def _awaitable(future: Any) -> Awaitable[GoalOutcome]:
    awaitable: Awaitable[GoalOutcome] = future
    return awaitable
