"""The insides of rclpy that this project uses, in this file only.

rclpy documents no way to take a message when it is wanted, to send a response again, to read who
wrote a request, or to drop a request that was answered. Each function here says what happens where
an rclpy has no such part: then the node behaves as plain rclpy does. `part` finds them all, so that
a test can hide them.
"""

from __future__ import annotations

import ctypes
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple

from action_msgs.msg import GoalStatus
from rclpy.action import ActionServer
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.logging import get_logger
from rclpy.node import Node
from rosgraph_msgs.msg import Clock


def part(owner: Any, name: str) -> Any:
    """An attribute that rclpy does not document; None where this rclpy has none."""
    return getattr(owner, name, None)


def given_names(node: Node) -> tuple[str, ...]:
    """Names of the parameters that the node was started with, on the command line and in files;
    none where this rclpy doesn't tell: then a misspelt one is ignored, as by plain rclpy.
    """
    return tuple(part(node, "_parameter_overrides") or ())


def put(message: Any, name: str, value: Any) -> None:
    """Set a field of a message without its checks, which look at each element of a long list; with
    them where messages keep the field elsewhere.
    """
    inside = f"_{name}"
    setattr(message, inside if hasattr(message, inside) else name, value)


class _NeverRaisedError(Exception):
    """Stands for an exception that this rclpy does not have."""


RCLError: type[Exception] = getattr(_rclpy, "RCLError", _NeverRaisedError)
InvalidHandle: type[Exception] = getattr(_rclpy, "InvalidHandle", _NeverRaisedError)
UNREADABLE_ARGUMENTS: tuple[type[Exception], ...] = (
    RCLError,
    getattr(_rclpy, "RCLInvalidROSArgsError", _NeverRaisedError),
    getattr(_rclpy, "UnknownROSArgsError", _NeverRaisedError),
)
"""Raised by rclpy.init for words that it can't read."""

UNSENT = (RCLError, InvalidHandle)
"""Raised by a response that can't be sent: its client has gone, or its server is being
destroyed.
"""

_SAID_AGAIN = 60.0  # s between two warnings of one kind


def send(attempt: Callable[[], object]) -> None:
    """Call `attempt`, and let a warning of it be a warning.

    rclpy warns of a client that it has not discovered from its C code. Where a filter makes
    exceptions of warnings, that is a SystemError.
    """
    try:
        attempt()
    except SystemError as error:
        if not isinstance(error.__cause__, Warning):
            raise
        _warn(f"{error.__cause__}")


def send_to_whoever_is_left(attempt: Callable[[], object]) -> None:
    """Call `attempt`; a client that has gone is a warning, and what else is raised stays raised."""
    try:
        send(attempt)
    except UNSENT as error:
        _warn(f"a response was not sent, its client may have gone away: {error}")


def _warn(sentence: str) -> None:
    get_logger("ir_msgs_py").warning(sentence, throttle_duration_sec=_SAID_AGAIN)


def heed_times_only(node: Node) -> None:
    """Let the node ignore times before 1970 on /clock, whenever it begins to listen to one.

    rclpy raises at each of them, and a node that only fails ends. Without that inside each such
    time is a callback that failed.
    """
    source = part(node, "_time_source")
    take = part(source, "clock_callback")
    if take is None:
        return

    def heed(message: Clock) -> None:
        if message.clock.sec >= 0:
            take(message)
            return
        seconds = message.clock.sec
        node.get_logger().warning(
            f"/clock says {seconds} s, which is no time: ignored", throttle_duration_sec=_SAID_AGAIN
        )

    source.clock_callback = heed
    subscription = part(source, "_clock_sub")
    if subscription is not None:
        subscription.callback = heed


def can_take_messages(subscription: Any) -> bool:
    """Whether `take_message` works; otherwise the executor has to call back."""
    return part(part(subscription, "handle"), "take_message") is not None


def take_message(subscription: Any) -> tuple[Any, dict[str, int]] | None:
    """The next message of a subscription that no executor waits for, with its times [ns].

    Its bytes, where the subscription is a raw one.
    """
    with subscription.handle:
        taken: tuple[Any, dict[str, int]] | None = subscription.handle.take_message(
            subscription.msg_type, subscription.raw
        )
    return taken


def take_bytes(subscription: Any) -> tuple[bytes, dict[str, int]] | None:
    """As `take_message`, without making an object of the message."""
    with subscription.handle:
        taken = subscription.handle.take_message(subscription.msg_type, True)
    return None if taken is None else (bytes(taken[0]), taken[1])


def can_take_requests(service: Any) -> bool:
    """Whether `take_request` works; otherwise the executor has to call the service's handler."""
    return part(part(service, "handle"), "service_take_request") is not None


def take_request(service: Any) -> tuple[Any, Any] | None:
    """The next request of a service that no executor waits for, with its header."""
    with service.handle:
        taken = service.handle.service_take_request(service.srv_type.Request)
    return None if taken is None or taken[1] is None else taken


def can_poll() -> bool:
    """Whether `take_bytes` and `take_request` work with what this rclpy makes."""
    subscriptions = part(part(_rclpy, "Subscription"), "take_message")
    return None not in (subscriptions, part(part(_rclpy, "Service"), "service_take_request"))


# more than rcl_subscription_content_filter_options_t has; all 0 is its beginning
_FILTER_BYTES = 256


def keep_only(subscription: Any, expression: str) -> bool:
    """Let the subscription hear only messages for which this SQL expression of DDS holds: their
    publishers leave out the others. False where rclpy or the middleware can't, and all are heard.
    """
    pointer = part(part(subscription, "handle"), "pointer")
    if pointer is None:
        return False
    try:
        rcl = ctypes.CDLL("librcl.so")
        begin = rcl.rcl_subscription_content_filter_options_init
        use = rcl.rcl_subscription_set_content_filter
        end = rcl.rcl_subscription_content_filter_options_fini
    except (OSError, AttributeError):
        return False
    handle = ctypes.c_void_p(pointer)
    options = ctypes.create_string_buffer(_FILTER_BYTES)
    words = expression.encode()
    if begin(handle, words, ctypes.c_size_t(0), None, options) != 0:
        return False
    try:
        return bool(use(handle, options) == 0)
    finally:
        end(handle, options)


_PARTICIPANT = 12  # bytes of an endpoint's identity that all endpoints of a participant share
_VALUE = 2 * ctypes.sizeof(ctypes.c_void_p)  # where an object of pybind11 points to what it wraps


class _RequestId(ctypes.Structure):
    """rmw_request_id_t."""

    _fields_ = (("writer", ctypes.c_uint8 * 16), ("sequence_number", ctypes.c_int64))


class WrittenRequest(NamedTuple):
    """Identity of a request for a goal: its writer (16 bytes), the number that it has there, and
    `sent` [ns], when it was written by the clock of its writer's host, 0 where the middleware does
    not say.
    """

    writer: bytes
    sequence_number: int
    sent: int


def participant_of(request_id: Any) -> bytes:
    """Participant of who wrote a request; b"" where it is not known.

    A request carries the identity of the endpoint that wrote it, which rclpy keeps for itself; its
    first bytes are those of the process's participant.
    """
    if isinstance(request_id, WrittenRequest):
        return request_id.writer[:_PARTICIPANT]
    if part(_rclpy, "rmw_request_id_t") is not type(request_id):
        return b""
    value = ctypes.c_void_p.from_address(id(request_id) + _VALUE).value
    if not value:
        return b""
    found = _RequestId.from_address(value)
    same = found.sequence_number == request_id.sequence_number
    return bytes(found.writer)[:_PARTICIPANT] if same else b""


def client_of(header: Any) -> str:
    """Client that sent a service's request, by the identity of its endpoint; "" where it is not
    known, and all clients are one.
    """
    if part(_rclpy, "rmw_service_info_t") is not type(header):
        return ""
    value = ctypes.c_void_p.from_address(id(header) + _VALUE).value
    if not value:
        return ""
    found = _RequestId.from_address(value + _INFO)
    same = found.sequence_number == header.request_id.sequence_number
    return bytes(found.writer).hex() if same else ""


def readers(node: Node, topic: str) -> set[str]:
    """Identities of the endpoints that hear a topic of DDS, "rr/name/of/serviceReply" where a
    service's clients hear its answers: those that `client_of` tells. None of a node that is being
    destroyed.
    """
    try:
        found = node.get_subscriptions_info_by_topic(topic, no_mangle=True)
    except InvalidHandle:
        return set()
    return {bytes(each.endpoint_gid).hex() for each in found}


def forget_request(goal: Any) -> None:
    """Drop what a goal asked for: rclpy keeps it as long as the result, a quarter of an hour.

    Without that inside it is kept so long.
    """
    if part(goal, "_goal_request") is not None:
        goal._goal_request = type(goal.request)()


_NOTHING = 601  # RCL_RET_SERVICE_TAKE_FAILED: no request waits
_TIMEOUT = 2  # RCL_RET_TIMEOUT: the client was not discovered in time
_INFO = 16  # bytes of the times in front of a request's identity in rmw_service_info_t
_Create = ctypes.PYFUNCTYPE(ctypes.c_void_p)
_Fill = ctypes.PYFUNCTYPE(ctypes.c_bool, ctypes.py_object, ctypes.c_void_p)
_Destroy = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)
_api = ctypes.pythonapi
_api.PyCapsule_GetName.restype = ctypes.c_char_p
_api.PyCapsule_GetName.argtypes = [ctypes.py_object]
_api.PyCapsule_GetPointer.restype = ctypes.c_void_p
_api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]


def _address(capsule: Any) -> int:
    """What a capsule of Python points to."""
    return int(_api.PyCapsule_GetPointer(capsule, _api.PyCapsule_GetName(capsule)))


def aside_sender(service: Any) -> Callable[[Any, Any], None]:
    """What sends a response of this service while other threads of Python run.

    rclpy holds all of them up meanwhile: 0.1 s for a client that has died, a millisecond each where
    clients don't keep up. Where an inside is missing, it is rclpy's own.
    """
    plain: Callable[[Any, Any], None] = service.send_response
    kind = type(service.srv_type.Response)
    capsules = [part(kind, f"_{name}") for name in ("CREATE_ROS_MESSAGE", "CONVERT_FROM_PY")]
    capsules.append(part(kind, "_DESTROY_ROS_MESSAGE"))
    pointer = part(part(service, "handle"), "pointer")
    info = part(_rclpy, "rmw_service_info_t")
    try:
        rcl_send = ctypes.CDLL("librcl.so").rcl_send_response
        forget = ctypes.CDLL("librcutils.so").rcutils_reset_error
    except (OSError, AttributeError):
        return plain
    if None in (*capsules, pointer, info):
        return plain
    create = _Create(_address(capsules[0]))
    fill = _Fill(_address(capsules[1]))
    destroy = _Destroy(_address(capsules[2]))

    def send_aside(response: Any, header: Any) -> None:
        value = ctypes.c_void_p.from_address(id(header) + _VALUE).value
        if (
            type(header) is not info
            or not value
            or not isinstance(response, service.srv_type.Response)
        ):
            plain(response, header)
            return
        message = create()
        try:
            if not fill(response, message):
                raise RCLError(f"a response of {service.service_name} can't be converted")
            with service.handle:
                at = ctypes.c_void_p(service.handle.pointer)
                code = rcl_send(at, ctypes.c_void_p(value + _INFO), ctypes.c_void_p(message))
            if code != 0:
                forget()
            if code not in (0, _TIMEOUT):
                raise RCLError(f"failed to send a response of {service.service_name}: {code}")
        finally:
            destroy(message)

    return send_aside


UNDISCOVERED = 0.09
"""Seconds that the middleware waits, less a tenth, for a client that it has not discovered
(0.1 s).
"""

SENDS = 50
"""Five seconds: more than a busy machine takes to discover a client. One that dies undiscovered
holds up the others once for so long.
"""

LATE = 600
"""Attempts after that, beside everything else: a minute, as long as a client of this project waits.
The middleware forgets a client that died before, and takes its answer then.
"""
_LATE_MOST = 1000  # answers that wait for their clients


class PatientSender:
    """Sends a response again where the server has not discovered its client yet.

    A client may see the server before the server sees it. The middleware then waits UNDISCOVERED,
    drops the response and warns; only the time it took shows it. A client ignores an answer that it
    has already. One that is not discovered in `sends` attempts may have died: what follows is sent
    once, until a client takes its answer at once. late: attempts after those, by a thread of its
    own, so that neither the answer is lost nor anybody waits; 0 where attempts hold Python up.
    """

    def __init__(
        self,
        send: Callable[[Any, Any], None],
        clock: Callable[[], float] = time.monotonic,
        sends: int = SENDS,
        late: int = 0,
    ) -> None:
        self._send = send
        self._sends = sends
        self._clock = clock
        self._patient = True
        self._late = late
        self._left: deque[tuple[Any, Any, int]] = deque()
        self._lock = threading.Lock()
        self._busy = False

    def send(self, response: Any, header: Any) -> None:
        """Send it, for about five seconds at most before others get their turn; raises what the
        last attempt raised.
        """
        for _ in range(self._sends if self._patient else 1):
            begun = self._clock()
            failure: Exception | None = None
            try:
                send(lambda: self._send(response, header))
            except UNSENT as error:
                failure = error
            if self._clock() - begun < UNDISCOVERED:
                self._patient = True
                break
        else:
            self._patient = False
            if failure is None:
                self._go_on(response, header)
        if failure is not None:
            raise failure

    def _go_on(self, response: Any, header: Any) -> None:
        """Let a thread send it again and again."""
        if not self._late:
            return
        with self._lock:
            if len(self._left) >= _LATE_MOST:
                _warn(f"{_LATE_MOST} answers wait for clients that are not discovered: one is lost")
                return
            self._left.append((response, header, self._late))
            begin = not self._busy
            self._busy = True
        if begin:
            threading.Thread(target=self._send_late, name="late answers", daemon=True).start()

    def _send_late(self) -> None:
        """Send what is left in turns, until it is taken, its client has gone or it is too late."""
        while True:
            with self._lock:
                if not self._left:
                    self._busy = False
                    return
                response, header, attempts = self._left.popleft()
            begun = self._clock()
            try:
                self._send(response, header)
            except UNSENT:
                continue
            if self._clock() - begun < UNDISCOVERED:
                self._patient = True
            elif attempts > 1:
                with self._lock:
                    self._left.append((response, header, attempts - 1))


def patient_sender(service: Any, sends: int = SENDS) -> PatientSender:
    """What sends the responses of a service, to clients that are discovered late too."""
    aside = aside_sender(service)
    return PatientSender(aside, sends=sends, late=LATE if aside != service.send_response else 0)


def survive_clients(node: Node) -> None:
    """Let no client of the node's plain services end its executor by going away, and answer those
    that are discovered late.

    rclpy sends the responses of its own services once and unguarded: of parameters, of types.
    """
    for service in node.services:
        plain = part(service, "send_response")
        if plain is None or hasattr(service, "survives"):
            continue
        sender = PatientSender(plain)

        def answer(response: Any, header: Any, sender: PatientSender = sender) -> None:
            send_to_whoever_is_left(lambda: sender.send(response, header))

        with suppress(AttributeError):  # a service that takes no attributes is left as it is
            service.send_response = answer
            service.survives = True


class _ServiceInfo(ctypes.Structure):
    """rmw_service_info_t."""

    _fields_ = (
        ("sent", ctypes.c_int64),
        ("received", ctypes.c_int64),
        ("request_id", _RequestId),
    )


class GoalRequests:
    """Requests for goals of an action server's handle, with the times at which they were written.

    rclpy takes them without these times. A request that was lost on its way comes late, as its
    client's middleware sends it again: only its time tells that it is older than a stop.
    """

    def __init__(self, handle: Any, action_type: Any) -> None:
        """Raises LookupError where an inside is missing."""
        request = type(action_type.Impl.SendGoalService.Request)
        response = type(action_type.Impl.SendGoalService.Response)
        for kind in (request, response):
            if part(kind, "_CONVERT_FROM_PY") is None:
                kind.__import_type_support__()
        names = ("_CREATE_ROS_MESSAGE", "_CONVERT_FROM_PY", "_DESTROY_ROS_MESSAGE")
        capsules = [part(response, name) for name in names]
        try:
            rcl = ctypes.CDLL("librcl.so")
            self._take = rcl.rcl_take_request_with_info
            name_of = rcl.rcl_service_get_service_name
            self._send = ctypes.CDLL("librcl_action.so").rcl_action_send_goal_response
            self._forget = ctypes.CDLL("librcutils.so").rcutils_reset_error
        except (OSError, AttributeError) as error:
            raise LookupError(str(error)) from error
        if None in (*capsules, part(handle, "pointer")):
            raise LookupError("rclpy has no pointer to an action server")
        self._handle = handle
        self._create = _Create(_address(capsules[0]))
        self._fill = _Fill(_address(capsules[1]))
        self._destroy = _Destroy(_address(capsules[2]))
        name_of.restype = ctypes.c_char_p
        if not (name_of(self._service()) or b"").endswith(b"/_action/send_goal"):
            raise LookupError("an action server of rcl does not begin with its service of goals")

    def _service(self) -> ctypes.c_void_p:
        """The service of goals: the first part of what rcl_action_server_t points to."""
        return ctypes.c_void_p(ctypes.c_void_p.from_address(self._handle.pointer).value)

    def take(self, kind: Any, sent: Callable[[int], None]) -> tuple[WrittenRequest, Any] | None:
        """The next request, as an object of the class `kind`; sent: is told when it was written,
        before it is converted.
        """
        create = _Create(_address(type(kind)._CREATE_ROS_MESSAGE))
        destroy = _Destroy(_address(type(kind)._DESTROY_ROS_MESSAGE))
        convert = converter(type(kind))
        assert convert is not None  # rclpy converts its requests with it
        info = _ServiceInfo()
        message = create()
        try:
            with self._handle:
                code = self._take(self._service(), ctypes.byref(info), ctypes.c_void_p(message))
            if code != 0:
                self._forget()
            if code == _NOTHING:
                return None
            if code != 0:
                raise RCLError(f"failed to take a request for a goal: {code}")
            sent(info.sent)
            request = convert(message)
        finally:
            destroy(message)
        own = info.request_id
        return WrittenRequest(bytes(own.writer), own.sequence_number, info.sent), request

    def answer(self, header: WrittenRequest, response: Any) -> None:
        """Send the response to a request."""
        request_id = _RequestId(
            (ctypes.c_uint8 * 16).from_buffer_copy(header.writer), header.sequence_number
        )
        message = self._create()
        try:
            if not self._fill(response, message):
                raise RCLError("the response to a request for a goal can't be converted")
            with self._handle:
                at = ctypes.c_void_p(self._handle.pointer)
                code = self._send(at, ctypes.byref(request_id), ctypes.c_void_p(message))
            if code != 0:
                self._forget()
            if code not in (0, _TIMEOUT):
                raise RCLError(f"failed to send the response to a request for a goal: {code}")
        finally:
            self._destroy(message)


def _patient(plain: type) -> type:
    """rclpy's handle of an action server, whose responses reach a client that is discovered late.

    A goal whose client does not hear that it was accepted is not executed: rclpy expects an
    RCLError then. The other two responses raise nothing when their client has gone.
    """

    class PatientHandle(plain):
        requests: GoalRequests | None = None

        def send_goal_response(self, header: Any, response: Any) -> None:
            send = super().send_goal_response
            if self.requests is not None and isinstance(header, WrittenRequest):
                send = self.requests.answer
            try:
                self._patiently(send, header, response)
            except UNSENT as error:
                raise RCLError(str(error)) from error

        def send_cancel_response(self, header: Any, response: Any) -> None:
            each = super().send_cancel_response
            send_to_whoever_is_left(lambda: self._patiently(each, header, response))

        def send_result_response(self, header: Any, response: Any) -> None:
            each = super().send_result_response
            send_to_whoever_is_left(lambda: self._patiently(each, header, response))

        def _patiently(self, send: Callable[[Any, Any], None], header: Any, response: Any) -> None:
            if not hasattr(self, "_sender"):
                self._sender = PatientSender(lambda response, attempt: attempt(response))
            self._sender.send(response, lambda response: send(header, response))

    return PatientHandle


_MAKING = threading.Lock()
_EARLY = 1000  # goals that are taken before the executor looks


@contextmanager
def _patient_handles() -> Iterator[None]:
    """rclpy makes the handles of its action servers patient meanwhile; plain where it has none."""
    plain = part(_rclpy, "ActionServer")
    if plain is None:
        yield
        return
    with _MAKING:
        _rclpy.ActionServer = _patient(plain)
        try:
            yield
        finally:
            _rclpy.ActionServer = plain


class InTurn:
    """Goals of each client, for threads that each hear of one and may overtake one another."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._came: dict[bytes, deque[tuple[Any, Any]]] = {}
        self._served: set[bytes] = set()

    def add(self, client: bytes, goal: tuple[Any, Any]) -> None:
        """Note a goal that came."""
        with self._lock:
            self._came.setdefault(client, deque()).append(goal)

    def waiting(self, client: bytes) -> Iterator[tuple[Any, Any]]:
        """A client's goals, the first first, until none is left; none where another thread is about
        them. To be looked at to its end.
        """
        with self._lock:
            if client in self._served:
                return
            self._served.add(client)
        while True:
            with self._lock:
                if client not in self._came:
                    self._served.remove(client)
                    return
                goal = self._came[client].popleft()
                if not self._came[client]:
                    del self._came[client]
            yield goal


class PatientActionServer(ActionServer):
    """An ActionServer whose responses reach clients that are discovered late, that survives those
    that have gone, that accepts a client's goals in the order in which they came, also where its
    callback group lets several threads in, and whose requests for goals a subclass may see first.

    Where rclpy's insides are missing, `goal_class`, `goal_came` and `unknown_result` are not
    called, `goal_sent` is told nothing, `take_waiting` takes nothing, and threads are not ordered.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self._in_turn = InTurn()
        self._taking = threading.Lock()
        self._early: deque[tuple[Any, Any]] = deque()  # goals that `take_waiting` took
        with _patient_handles():
            super().__init__(*arguments, **options)
        with suppress(LookupError, AttributeError):
            self._handle.requests = GoalRequests(self._handle, self.action_type)

    def goal_class(self) -> Any:
        """Class that the next request for a goal is converted to."""
        return self.action_type.Impl.SendGoalService.Request

    def goal_sent(self, sent: int) -> None:
        """Be told when the request that is converted next was written [ns of its writer's clock],
        0 where that is not known.
        """

    def goal_came(self, request_id: Any, request: Any) -> None:
        """Look at a request for a goal before it is accepted."""

    def unknown_result(self, result: Any) -> None:
        """Say in an empty result that there is no such goal, or not any more."""

    async def _execute_goal_request(self, taken: tuple[Any, Any]) -> None:
        """Accept or reject all goals of this one's client that have been taken, the first first;
        nothing where another thread is about it.
        """
        if not self._takes_goals():
            await super()._execute_goal_request(taken)
            return
        failures: list[Exception] = []
        for goal in self._in_turn.waiting(participant_of(taken[0])):
            try:
                await super()._execute_goal_request(goal)
            except Exception as failure:  # the next goal has nobody else
                failures.append(failure)
        if len(failures) > 1:
            raise ExceptionGroup("goals of one client", failures)
        if failures:
            raise failures[0]

    async def _execute_get_result_request(self, taken: tuple[Any, Any]) -> None:
        """As rclpy's, which answers for a goal that it does not know with a result of zeros."""
        header, request = taken
        goals = part(self, "_goal_handles")
        if goals is None or bytes(request.goal_id.uuid) in goals:
            await super()._execute_get_result_request(taken)
            return
        response = self.action_type.Impl.GetResultService.Response()
        response.status = GoalStatus.STATUS_UNKNOWN
        self.unknown_result(response.result)
        self._handle.send_result_response(header, response)

    def take_waiting(self, most: int) -> bool:
        """Let `goal_came` see the goals that wait for the executor now, from any thread; the
        executor accepts and executes them later. Whether all have been seen, and none is just being
        taken.
        """
        for _ in range(most):
            if len(self._early) >= _EARLY or not self._taking.acquire(blocking=False):
                return False
            try:
                goal = self._take_goal()
            finally:
                self._taking.release()
            if goal is None:
                return True
            self._early.append(goal)
            self._go_on()
        return False

    def _go_on(self) -> None:
        """Let the executor look at the goals that were taken early."""
        executor = part(part(self, "_node"), "executor")
        if executor is not None:
            executor.wake()

    def is_ready(self, wait_set: Any) -> bool:
        """Whether there is anything to take."""
        ready: bool = super().is_ready(wait_set)
        return ready or bool(self._early)

    def take_data(self) -> dict[str, Any]:
        """Take what has come, goals by `goal_class`."""
        goal = self._early.popleft() if self._early else None
        if self._takes_goals() and part(self, "_is_goal_request_ready"):
            self._is_goal_request_ready = False  # where another is taken first, it comes again
            if goal is None:
                with self._taking:
                    goal = self._take_goal()
        if self._early:
            self._go_on()
        data: dict[str, Any] = super().take_data()
        if goal is not None:
            data["goal"] = goal
        return data

    def _takes_goals(self) -> bool:
        take = part(part(self, "_handle"), "take_goal_request")
        return take is not None and part(self, "_lock") is not None

    def _take_goal(self) -> tuple[Any, Any] | None:
        """The next request for a goal with its identity, seen by `goal_came`."""
        if not self._takes_goals():
            return None
        requests: GoalRequests | None = part(self._handle, "requests")
        with self._lock:
            if requests is None:
                goal = self._handle.take_goal_request(self.goal_class())
            else:
                goal = requests.take(self.goal_class(), self.goal_sent)
        if goal is None or not all(goal):
            return None
        self.goal_came(*goal)
        self._in_turn.add(participant_of(goal[0]), goal)
        return goal[0], goal[1]


# Messages in C before Python objects are made of them: rclpy converts a message while it holds the
# interpreter, so that no other thread runs meanwhile. It asks the message's class for the function
# that converts it; a lookalike has a function of our own, which looks at the C message first.

Convert = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)
"""Makes a Python object of the C message at an address."""
_api = ctypes.pythonapi
_api.PyCapsule_GetName.restype = ctypes.c_char_p
_api.PyCapsule_GetName.argtypes = [ctypes.py_object]
_api.PyCapsule_GetPointer.restype = ctypes.c_void_p
_api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
_api.PyCapsule_New.restype = ctypes.py_object
_api.PyCapsule_New.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]


class CSequence(ctypes.Structure):
    """Of rosidl_runtime_c; a string has the same layout. What it holds is freed by its capacity,
    whatever its size.
    """

    _fields_ = (("data", ctypes.c_void_p), ("size", ctypes.c_size_t), ("capacity", ctypes.c_size_t))


def converter(kind: Any) -> Callable[[int], Any] | None:
    """The function that makes an object of a C message of this metaclass; None where it has
    none.
    """
    if part(kind, "_CONVERT_TO_PY") is None:
        kind.__import_type_support__()
    capsule = part(kind, "_CONVERT_TO_PY")
    if capsule is None:
        return None
    return Convert(_api.PyCapsule_GetPointer(capsule, _api.PyCapsule_GetName(capsule)))


def lookalike(kind: Any, convert: Any) -> Any:
    """A class that rclpy takes for one of metaclass `kind`, whose messages `convert` makes: a
    Convert, which has to be kept.
    """
    pointer = ctypes.cast(convert, ctypes.c_void_p)
    own = {
        "_TYPE_SUPPORT": kind._TYPE_SUPPORT,
        "_CREATE_ROS_MESSAGE": kind._CREATE_ROS_MESSAGE,
        "_DESTROY_ROS_MESSAGE": kind._DESTROY_ROS_MESSAGE,
        "_CONVERT_TO_PY": _api.PyCapsule_New(pointer, None, None),
    }
    return type("Lookalike", (), own)()
