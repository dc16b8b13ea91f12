"""Services and actions that answer every request, and publish what was answered for recordings.

The middleware keeps only so many requests and drops the oldest without a word. A BoundedService
takes, at each turn of the executor, all that have come into a queue of its own, refuses what is
beyond with a sentence, and answers one. What is raised meanwhile (no descriptor left, a full disk,
1e308 in a field, a bug) becomes the status of that request, so that the node lives on.
"""

from __future__ import annotations

import array
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, ClassVar, Generic, TypeVar
from weakref import WeakKeyDictionary, WeakSet

from rclpy.callback_groups import CallbackGroup
from rclpy.executors import await_or_execute
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from rclpy.service import Service
from rclpy.waitable import NumberOfEntities, Waitable

from ir_msgs.msg import RecordedCall
from ir_msgs_py import names
from ir_msgs_py.ros.conversions import status_to_msg
from ir_msgs_py.ros.goal_clients import ActionClients, Gone
from ir_msgs_py.ros.messages import type_name
from ir_msgs_py.ros.rclpy_inside import (
    PatientActionServer,
    can_take_requests,
    client_of,
    forget_request,
    participant_of,
    patient_sender,
    readers,
    send_to_whoever_is_left,
    take_request,
)
from ir_msgs_py.ros.topics import REQUESTS_WAITING, SERVICE, PolledGroup
from ir_msgs_py.status import Status, StatusCode

MOST_BYTES = 2 * 2**20
"""Of a request or an answer in a recording: the points of forty movements."""
CALLS_KEPT = 100
"""Calls that the middleware keeps for a busy recorder: each is a request and an answer."""
BYTES_WAITING = 64 * 2**20
"""Bytes of the requests of a service that wait together; the first is taken whatever its size."""
LOOK = 0.05
"""s between two looks whether a client is still there: each takes a third of a millisecond."""
_TAKEN_KEPT = 1000  # goals
_NUMBER = 8  # bytes; what a number takes at most
T = TypeVar("T")
U = TypeVar("U")


class Calls:
    """Publishes the calls of a node on its topic `~/calls`; `of` gives the one that all its
    services share.

    services: those that answer; weakly, since their handlers hold the node. Where nobody
    subscribes, nothing is done. A message that is longer than MOST_BYTES is left out (its field is
    empty), and it is measured before it is copied: a recorder must not cost a node the memory of
    its answers.
    """

    _known: ClassVar[WeakKeyDictionary[Node, Calls]] = WeakKeyDictionary()

    def __init__(self, node: Node) -> None:
        self.services: WeakSet[Service] = WeakSet()
        self._clock = node.get_clock()
        self._name = node.get_fully_qualified_name()
        self._publisher = node.create_publisher(
            RecordedCall, f"~/{names.CALLS}", QoSProfile(depth=CALLS_KEPT)
        )

    @classmethod
    def of(cls, node: Node) -> Calls:
        """Those of a node."""
        if node not in cls._known:
            cls._known[node] = cls(node)
        return cls._known[node]

    def taken(self, name: str, kind: str, request: Any) -> Callable[[Any], None]:
        """A request of the service or action `name` of the type `kind` is taken now: what to call
        with its answer. A handler may change the request, so it is copied first where somebody
        listens by then.
        """
        stamp = self._clock.now().to_msg()
        data = _bounded_cdr(request) if self._publisher.get_subscription_count() else None

        def publish_answer(response: Any) -> None:
            if not self._publisher.get_subscription_count():
                return
            call = RecordedCall(node=self._name, service=name, type=kind)
            call.header.stamp = stamp
            call.request = _bounded_cdr(request) if data is None else data
            call.response = _bounded_cdr(response)
            self._publisher.publish(call)

        return publish_answer


def _bounded_cdr(message: Any) -> array.array[int]:
    """The message's CDR; nothing where it is longer than MOST_BYTES."""
    data = serialize_message(message) if _bytes_left(message, MOST_BYTES) >= 0 else b""
    return array.array("B", data if len(data) <= MOST_BYTES else b"")


class RequestQueue:
    """Requests of the service `name` that wait, at most `most` and BYTES_WAITING together."""

    def __init__(self, name: str, most: int = REQUESTS_WAITING) -> None:
        self._name = name
        self._most = most
        self._entries: deque[tuple[Any, int]] = deque()
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._entries)

    def add(self, request: Any, entry: Callable[[], Any]) -> str:
        """Let an entry wait for a request, made by `entry`; why it may not, "" where it does."""
        left = _bytes_left(request, BYTES_WAITING)
        size = BYTES_WAITING - left
        if len(self) >= self._most:
            return f"{self._most} requests of {self._name} are waiting: send fewer at once"
        if self._entries and self._bytes + size > BYTES_WAITING:
            return (
                f"requests of {self._name} that wait would take more than {BYTES_WAITING >> 20} "
                "MiB: send fewer at once"
            )
        self._entries.append((entry(), size))
        self._bytes += size
        return ""

    def pop(self) -> Any:
        """The entry that has waited longest."""
        entry, size = self._entries.popleft()
        self._bytes -= size
        return entry


def _bytes_left(value: Any, left: int) -> int:
    """How many of `left` bytes a value leaves, about; it ends as soon as none are left."""
    if left < 0:
        return left
    if isinstance(value, str | bytes):
        return left - len(value)
    if isinstance(value, array.array):
        return left - len(value) * value.itemsize
    if hasattr(value, "nbytes"):
        return left - int(value.nbytes)
    for part in _fields_or_items(value):
        left = _bytes_left(part, left)
        if left < 0:
            return left
    return left - _NUMBER


def _fields_or_items(value: Any) -> Iterable[Any]:
    """What a message or a collection is made of; nothing of any other value."""
    if hasattr(value, "get_fields_and_field_types"):
        return (getattr(value, name) for name in value.get_fields_and_field_types())
    return value if isinstance(value, list | tuple | set) else ()


StatusOf = Callable[[Exception], Status | None]

ANY = (Exception, SystemExit)
"""What must not end a node. SystemExit: somebody's registered search may call exit()."""


def answered(
    response: Any,
    source: str,
    work: Callable[[], Status],
    status_of: StatusOf,
    log: Callable[[str], object] = lambda text: None,
) -> Any:
    """The response with the status that `work` returns, or that of what it raises.

    source: the node. status_of: the status of an error that a request may end with, None for all
    others, which are logged with their traceback.
    """
    try:
        status = work()
    except ANY as error:  # whatever it is: one request must not end the node for all others
        known = None if isinstance(error, SystemExit) else status_of(error)
        if known is None:
            log(traceback.format_exc())
        status = known or unexpected(error)
    response.status = status_to_msg(Status(status.code, status.message, source))
    return response


def unexpected(error: BaseException) -> Status:
    """The status of an error that nobody thought of."""
    return Status(StatusCode.FAILURE, f"unexpected {type(error).__name__}: {error}")


Handler = Callable[..., Any]


def with_status(response: Any, status: Status) -> None:
    """Put a status into a response of this project's services."""
    response.status = status_to_msg(status)


class BoundedService(Waitable):
    """A service of `node`; at most `most_waiting` requests wait in it, and BYTES_WAITING.

    put: puts a status into a response, where that has no `status` of ours.
    handler: from request and response to the response; requests are answered in the order in which
    they came. What it raises, and a response that can't be sent, is answered as a failure and
    logged; a client that has gone is a warning. watching: it also takes whether its client has
    gone. Where rclpy's insides are missing, it is a service as rclpy has it: the middleware's queue
    is the only one, and nobody is watched.
    """

    def __init__(
        self,
        node: Node,
        service_type: Any,
        name: str,
        handler: Handler,
        group: CallbackGroup | None = None,
        most_waiting: int = REQUESTS_WAITING,
        put: Callable[[Any, Status], None] = with_status,
        *,
        watching: bool = False,
    ) -> None:
        super().__init__(group or node.default_callback_group)
        self._node = node
        self._watching = watching
        self._type = service_type
        self._handler = handler
        self._put = put
        self._source = node.get_name()
        self._log = node.get_logger().error
        untouched = PolledGroup()  # the executor does not take from the service, this does
        self._service = node.create_service(
            service_type, name, handler, qos_profile=SERVICE, callback_group=untouched
        )
        self._calls = Calls.of(node)
        self._sender = patient_sender(self._service)
        if not can_take_requests(self._service):
            node.destroy_service(self._service)
            self._service = node.create_service(
                service_type, name, self._answer, qos_profile=SERVICE, callback_group=group
            )
            self._calls.services.add(self._service)
            return
        self._calls.services.add(self._service)
        self._more = node.create_guard_condition(_nothing, callback_group=untouched)
        self._queue = RequestQueue(self._service.service_name, most_waiting)
        self._index = 0
        node.add_waitable(self)

    def __enter__(self) -> None:
        self._service.handle.__enter__()
        self._more.handle.__enter__()

    def __exit__(self, *exception: object) -> None:
        self._more.handle.__exit__(*exception)
        self._service.handle.__exit__(*exception)

    def get_num_entities(self) -> NumberOfEntities:
        """A service, and what ends the wait while requests are in the queue."""
        return NumberOfEntities(num_services=1, num_gcs=1)

    def add_to_wait_set(self, wait_set: Any) -> None:
        """Wait for a request."""
        self._index = wait_set.add_service(self._service.handle)
        wait_set.add_guard_condition(self._more.handle)
        if self._queue:
            self._more.trigger()

    def is_ready(self, wait_set: Any) -> bool:
        """Whether a request has come or waits."""
        return bool(self._queue) or bool(wait_set.is_ready("service", self._index))

    def take_data(self) -> tuple[Any, Any, tuple[Gone, ...]] | None:
        """Take all that have come; the one to be answered now."""
        while True:
            taken = take_request(self._service)
            if taken is None:
                return self._queue.pop() if self._queue else None
            request, header = taken
            refusal = self._queue.add(request, partial(self._watched, request, header))
            if refusal:
                self._send(self._response(Status(StatusCode.FAILURE, refusal)), header)

    async def execute(self, taken_data: tuple[Any, Any, tuple[Gone, ...]] | None) -> None:
        """Answer it."""
        if taken_data is None:
            return
        request, header, watch = taken_data
        self._send(self._answer(request, self._type.Response(), *watch), header)

    def _watched(self, request: Any, header: Any) -> tuple[Any, Any, tuple[Gone, ...]]:
        return request, header, (self._gone(header),) if self._watching else ()

    def _gone(self, header: Any) -> Gone:
        """Whether the client of a request has gone."""
        client = client_of(header)
        topic = f"rr{self._service.service_name}Reply"
        return gone(lambda: client in readers(self._node, topic))

    def _answer(self, request: Any, response: Any, *watch: Gone) -> Any:
        """The handler's response, or that of what it raises."""
        try:
            kind = type_name(self._type)
            publish_answer = self._calls.taken(self._service.service_name, kind, request)
            response = self._handler(request, response, *watch)
            publish_answer(response)
        except ANY as error:
            self._log(traceback.format_exc())
            response = self._response(unexpected(error))
        return response

    def _send(self, response: Any, header: Any) -> None:
        """Send a response, or that it can't be sent; whether or not its client is still there."""
        try:
            send_to_whoever_is_left(lambda: self._sender.send(response, header))
        except ANY as error:
            self._log(traceback.format_exc())
            failure = self._response(unexpected(error))
            send_to_whoever_is_left(lambda: self._sender.send(failure, header))

    def _response(self, status: Status) -> Any:
        response = self._type.Response()
        self._put(response, Status(status.code, status.message, self._source))
        return response


class TakenGoals(Generic[T]):
    """What is noted of goals when they are taken from the middleware, until they are accepted. The
    oldest go first: rclpy doesn't accept every one.
    """

    def __init__(self) -> None:
        self._noted: dict[bytes, T] = {}

    def note(self, goal_id: bytes, value: T) -> None:
        """Note it of a goal."""
        while len(self._noted) >= _TAKEN_KEPT:
            self._noted.pop(next(iter(self._noted)), None)
        self._noted[goal_id] = value

    def pop(self, goal_id: bytes, otherwise: U) -> T | U:
        """What was noted, asked once; `otherwise` where nothing was, or too long ago."""
        return self._noted.pop(goal_id, otherwise)


class RecordedActionServer(PatientActionServer):
    """An action server whose goals and results are published for recordings, and that watches the
    clients of its goals.

    came: is told the id of a goal when it is taken from the middleware, also by `take_waiting`,
    which may be long before it is accepted; and when it was sent [ns of its sender's clock], 0
    where that is not known.
    """

    def __init__(
        self,
        node: Node,
        action_type: Any,
        name: str,
        *arguments: Any,
        came: Callable[[bytes, int], None] = lambda goal_id, sent: None,
        **options: Any,
    ) -> None:
        self._came = came
        self._sent = 0
        self._senders = TakenGoals[bytes]()
        self._clients = ActionClients(node, name)
        self._calls = Calls.of(node)
        self._type_text = type_name(action_type)
        self._full_name = node.resolve_topic_name(name)
        super().__init__(node, action_type, name, *arguments, **options)

    def goal_sent(self, sent: int) -> None:
        """Note when the goal that comes next was sent."""
        self._sent = sent

    def goal_came(self, request_id: Any, request: Any) -> None:
        """Note who has sent the goal, and tell of it."""
        key = bytes(request.goal_id.uuid)
        self._senders.note(key, participant_of(request_id))
        self._came(key, self._sent)

    def watch(self, goal_id: bytes, timeout: float) -> Gone:
        """Whether the client of a goal has been gone for `timeout` [s], from now on; 0: never. To
        be asked for once, and looked at again and again.
        """
        return self._clients.watch(timeout, self._senders.pop(goal_id, b""))

    def register_execute_callback(self, execute_callback: Any) -> None:
        """Let a goal be executed by this callback where it names none."""
        super().register_execute_callback(self._recorded(execute_callback))

    def notify_execute(self, goal_handle: Any, execute_callback: Any) -> None:
        """Let a goal be executed, by its own callback where it has one."""
        own = None if execute_callback is None else self._recorded(execute_callback)
        super().notify_execute(goal_handle, own)

    def _recorded(self, execute_callback: Any) -> Any:
        """The callback, and around it what a recording needs."""

        async def execute(goal: Any) -> Any:
            publish_answer = self._calls.taken(self._full_name, self._type_text, goal.request)
            result = await await_or_execute(execute_callback, goal)
            publish_answer(result)
            forget_request(goal)
            return result

        return execute


def gone(there: Callable[[], bool], clock: Callable[[], float] = time.monotonic) -> Gone:
    """Whether a client that was `there` is no more, looked at now and then every LOOK [s] at most;
    one that was never seen, since the middleware does not tell or has not discovered it yet, has
    not gone.
    """
    seen = there()
    left = False
    next_look = clock() + LOOK

    def look() -> bool:
        nonlocal seen, left, next_look
        now = clock()
        if left or now < next_look:
            return left
        next_look = now + LOOK
        here = there()
        left = seen and not here
        seen = seen or here
        return left

    return look


def _nothing() -> None:
    """What the guard's callback does: ending the wait is all."""
