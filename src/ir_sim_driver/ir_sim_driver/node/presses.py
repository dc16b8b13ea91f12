"""Presses of the emergency stop, and the other PLC inputs: heard on a way of their own.

The levels of the topic are heard twice. A participant that nothing else is sent to hears those
messages only that press the emergency stop: their publishers leave the others out. So no flood of
levels, goals or requests is in front of a press. All levels, in order, come to the node's own
participant, where they may be late. `~/set_plc_input` has a participant, too, and a press goes
before all requests that wait. A thread looks at all of them every few milliseconds and is never
behind goals, cells or other services.
"""

from __future__ import annotations

import os
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile
from rclpy.serialization import deserialize_message

from ir_msgs.msg import PlcInputs
from ir_msgs_py import names
from ir_msgs_py.names import own
from ir_msgs_py.plc import PlcInputs as Levels
from ir_msgs_py.ros.conversions import status_to_msg
from ir_msgs_py.ros.messages import type_name
from ir_msgs_py.ros.network import RANGE
from ir_msgs_py.ros.power_conversions import plc_inputs_from_msg
from ir_msgs_py.ros.rclpy_inside import (
    can_poll,
    client_of,
    keep_only,
    patient_sender,
    take_bytes,
    take_request,
)
from ir_msgs_py.ros.serving import ANY, Calls, RequestQueue, unexpected
from ir_msgs_py.ros.topics import BURST, REQUESTS_WAITING, SERVICE, PolledGroup
from ir_msgs_py.status import Status, StatusCode
from ir_sim_driver.controller import Driver
from ir_sim_driver.errors import DriverError
from ir_sim_driver.plc import STOP_BIT, TOPIC, Written
from ir_values.errors import IrError

PERIOD = 0.004  # s between two looks while nothing comes
TURN = 64  # messages of a topic that one look takes, or requests that it answers: 2 ms
_REQUESTS = 512  # that one look takes, about as long
_LAST = 1.0  # s for the last answer
_SENDS = 10  # of an answer, a second: those behind it wait as long
_SAID_AGAIN = 60.0  # s between two warnings of one kind
_PRESSED = f"{STOP_BIT} = TRUE"
_KEPT_LEVELS = 256  # messages whose levels are remembered
_BOTH = (DurabilityPolicy.TRANSIENT_LOCAL, DurabilityPolicy.VOLATILE)
"""Both kinds of publishers are heard, see `topics.COMMANDS`."""
_NOTHING_LOST = QoSProfile(history=HistoryPolicy.KEEP_ALL)
"""Who finds the queue full sends again, and no message pushes another one out."""


class OwnParticipant:
    """A participant beside that of `node`, in its domain, namespace and enclave, for `what`; its
    node is hidden, and no executor waits for it. Where rclpy can't poll, or participants don't find
    each other, it is `node` itself.
    """

    def __init__(self, node: Node, what: str) -> None:
        self.node = node
        self._context: Context | None = None
        if not can_poll() or os.environ.get(RANGE, "").upper() == "OFF":
            return
        self._context = Context()
        self._context.init(_enclave_of(node), domain_id=node.context.get_domain_id())
        self.node = Node(
            names.hidden_node(node.get_name(), what),
            context=self._context,
            namespace=node.get_namespace(),
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
            parameter_overrides=[Parameter("start_type_description_service", value=False)],
        )

    @property
    def apart(self) -> bool:
        """Whether it is another participant than the node's."""
        return self._context is not None

    def close(self) -> None:
        """Leave the graph."""
        if self._context is not None:
            self.node.destroy_node()
            self._context.try_shutdown()


def _enclave_of(node: Node) -> list[str]:
    """Words for a context of the same enclave."""
    own = (node.get_name(), node.get_namespace())
    for name, namespace, enclave in node.get_node_names_and_namespaces_with_enclaves():
        if (name, namespace) == own and enclave:
            return ["--ros-args", "--enclave", enclave]
    return []


class CommandThread:
    """Looks again and again at `polls`, in this order; each returns how much it has taken, which is
    at most a turn: a flood of one is no delay for the others.
    """

    def __init__(self, name: str, *polls: Callable[[], int]) -> None:
        self._polls = polls
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Begin to look."""
        self._thread.start()

    def close(self) -> None:
        """End after the present look."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        while not self._closing.is_set():
            if not sum([poll() for poll in self._polls]):
                time.sleep(PERIOD)  # half the processor of a wait for `_closing`


# The topic: presses that come before their turn, and all levels in order.


class ReceivedPress(NamedTuple):
    """A message: when it was sent and came [ns], by clocks of the sender and of this process, and
    whether its publisher latches.
    """

    sent: int
    came: int
    data: bytes
    latching: bool = False


Key = tuple[int, bytes]
"""A message: when it was sent, and its bytes."""
_OVERTAKEN = 5_000_000_000  # ns for which a press is ahead of its turn at most


class Told(NamedTuple):
    """A message in its turn: its bytes, and when it came [ns].

    overtaken: by a press. ahead: it is a press that was heard ahead of its turn; owed: and had no
    number then.
    """

    data: bytes
    came: int
    overtaken: bool = False
    ahead: bool = False
    owed: bool = False


class LevelOrder:
    """Brings presses that were heard before their turn, and all messages in the order in which each
    sender sent them, into one order. No message counts twice.

    started: when the driver began to listen [ns], by the clocks of senders.
    """

    def __init__(self, started: int) -> None:
        self._started = started
        self._newest = 0
        self._known: dict[Key, None] = {}
        self._ahead: dict[Key, int] = {}  # presses until their turn, and when they came
        self._owed: set[Key] = set()

    def presses(self, heard: Sequence[ReceivedPress]) -> list[Key]:
        """The presses among the `heard` whose turn has not come."""
        found = []
        for each in heard:
            key = (each.sent, each.data)
            history = each.latching and each.sent < self._started
            if key in self._known or key in self._ahead or history:
                continue
            self._ahead[key] = each.came
            found.append(key)
        return found

    def owe(self, presses: Sequence[Key]) -> None:
        """These presses, ahead of their turn, found the button pressed: whether it was let go
        between is known in their turn.
        """
        self._owed.update(presses)

    def levels(self, came: Sequence[ReceivedPress]) -> Iterator[Told]:
        """What `came` in its turn and counts. Of a run of the same levels the first and the last
        do.
        """
        run: Told | None = None  # the last of a run, where it isn't the first
        before = b""
        for each in sorted(came, key=lambda each: each.sent):
            told = self._told(each)
            if told is None:
                continue
            if each.data == before:
                run = told
                continue
            if run is not None:
                yield run
            yield told
            run = None
            before = each.data
        if run is not None:
            yield run

    def _told(self, each: ReceivedPress) -> Told | None:
        """A message in its turn; None where it doesn't count."""
        key = (each.sent, each.data)
        old = each.latching and each.sent < min(self._started, self._newest)
        if old or key in self._known:
            return None
        self._known[key] = None
        while len(self._known) > BURST:
            del self._known[next(iter(self._known))]
        self._newest = max(self._newest, each.sent)
        overtaken = self._is_overtaken(each)
        told = Told(each.data, each.came, overtaken, key in self._ahead, key in self._owed)
        self._ahead.pop(key, None)
        self._owed.discard(key)
        return told

    def _is_overtaken(self, each: ReceivedPress) -> bool:
        """Whether a press that was sent later, or this one, has been heard ahead of it."""
        while self._ahead:
            first = next(iter(self._ahead))
            if each.came - self._ahead[first] < _OVERTAKEN:
                break
            del self._ahead[first]
            self._owed.discard(first)
        return bool(self._ahead) and each.sent <= next(reversed(self._ahead))[0]


class PlcTopic:
    """Hands the levels of `~/plc_inputs` to the driver; `poll` takes them."""

    def __init__(self, node: Node, driver: Driver, presses: OwnParticipant) -> None:
        self._driver = driver
        self._order = LevelOrder(time.time_ns())
        self._read_before: dict[bytes, Levels] = {}
        self._pressed = False  # by the last message in its turn
        self._name = node.resolve_topic_name(own(names.PLC_INPUTS))
        self._all = self._listen(node, QoSProfile(depth=BURST))
        self._presses: list[tuple[Any, bool]] = []
        if presses.apart:
            heard = self._listen(presses.node, _NOTHING_LOST)
            for subscription, latching in heard:
                if keep_only(subscription, _PRESSED):
                    self._presses.append((subscription, latching))
                else:  # a middleware that can't: presses come in their turn
                    presses.node.destroy_subscription(subscription)

    def _listen(self, node: Node, quality: QoSProfile) -> list[tuple[Any, bool]]:
        """Subscriptions that `poll` takes from, and whether they hear those who latch; where rclpy
        can't poll, the executor calls back.
        """
        found = []
        for durability in _BOTH:
            quality.durability = durability
            latching = durability == DurabilityPolicy.TRANSIENT_LOCAL

            def called(data: bytes, latching: bool = latching) -> None:
                now = time.time_ns()
                self._write_all([ReceivedPress(now, time.monotonic_ns(), bytes(data), latching)])

            if can_poll():
                polled = node.create_subscription(
                    PlcInputs, self._name, called, quality, callback_group=PolledGroup(), raw=True
                )
                found.append((polled, latching))
            else:
                node.create_subscription(PlcInputs, self._name, called, quality, raw=True)
        return found

    def poll(self) -> int:
        """Take what has come; the number of messages."""
        heard = list(_waiting_presses(self._presses))
        came = list(_waiting_presses(self._all))
        if came:
            self._write_all(came)
        ahead = self._order.presses(heard)
        if ahead:
            number = self._driver.stop_number
            self._press()
            self._order.owe(ahead if self._driver.stop_number == number else ahead[1:])
        return len(heard) + len(came)

    def _write_all(self, came: Sequence[ReceivedPress]) -> None:
        written: list[Written] = []
        for told in self._order.levels(came):
            levels = self._levels(told)
            if levels is None:
                continue
            again = told.owed and not self._pressed
            self._pressed = levels.emergency_stop
            if told.ahead and not again:  # it has pressed the button
                levels = levels.with_bit(STOP_BIT, False)
            written.append(Written(levels, told.came, told.overtaken, again))
        if written:
            self._write(lambda: self._driver.plc.write_heard(TOPIC, written))

    def _levels(self, told: Told) -> Levels | None:
        """The levels; None for a message that makes no sense, of which only a pressed stop
        counts.
        """
        if told.data in self._read_before:
            return self._read_before[told.data]
        msg = deserialize_message(told.data, PlcInputs)
        try:
            levels = plc_inputs_from_msg(msg)
        except (IrError, ValueError) as error:
            self._driver.warn(f"plc_inputs ignored: {error}")
            if msg.emergency_stop and not told.ahead:
                self._press()
            return None
        if len(self._read_before) < _KEPT_LEVELS:
            self._read_before[told.data] = levels
        return levels

    def _press(self) -> None:
        self._write(lambda: self._driver.plc.write_inputs(TOPIC, {STOP_BIT: True}))

    def _write(self, write: Callable[[], None]) -> None:
        try:
            write()
        except (IrError, DriverError) as error:
            self._driver.warn(f"plc_inputs ignored: {error}")


def _waiting_presses(subscriptions: Sequence[tuple[Any, bool]]) -> Iterator[ReceivedPress]:
    """What waits, at most a turn of each."""
    ahead = time.time_ns() - time.monotonic_ns()
    for subscription, latching in subscriptions:
        for _ in range(TURN):
            taken = take_bytes(subscription)
            if taken is None:
                break
            data, info = taken
            came = _by_own_clock(info["received_timestamp"], ahead)
            yield ReceivedPress(info["source_timestamp"], came, data, latching)


def _by_own_clock(received: int, ahead: int) -> int:
    """When a message came on the monotonic clock [ns], which nobody sets; ahead: how far the host's
    clock is ahead of it now.
    """
    return min(received - ahead, time.monotonic_ns())


# Services.


def presses_the_stop(request: Any) -> bool:
    """Whether a request of `~/set_plc_input` presses the emergency stop."""
    return bool(request.name == STOP_BIT and request.value)


class _Answers:
    """A thread that sends what it is given; one to a client that has died takes a second."""

    def __init__(self) -> None:
        self._queue: deque[Callable[[], None]] = deque()
        self._more = threading.Semaphore(0)
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="answers", daemon=True)
        self._thread.start()

    def __len__(self) -> int:
        return len(self._queue)

    def submit(self, send: Callable[[], None], *, urgent: bool = False) -> None:
        """Let the thread call `send`; urgent: before all that wait."""
        if urgent:
            self._queue.appendleft(send)
        else:
            self._queue.append(send)
        self._more.release()

    def close(self) -> None:
        """End after what is being sent."""
        self._closing = True
        self._more.release()
        self._thread.join(_LAST)

    def _run(self) -> None:
        while self._more.acquire() and not self._closing:
            self._queue.popleft()()


class PolledService:
    """A service of `node` that a CommandThread answers: requests are acted upon at once, and their
    answers are sent by another thread.

    owner: in whose name. handler: from request, response, the time at which the request came [ns
    of the monotonic clock] and its client. urgent: whether a request goes before all that wait. At
    most REQUESTS_WAITING wait, and BYTES_WAITING; what comes beyond is refused.
    """

    def __init__(
        self,
        node: Node,
        service_type: Any,
        name: str,
        handler: Callable[[Any, Any, int, str], Any],
        owner: Node,
        urgent: Callable[[Any], bool] = lambda request: False,
    ) -> None:
        self._type = service_type
        self._handler = handler
        self._urgent = urgent
        self._source = owner.get_name()
        self._log = node.get_logger().error
        self._polled = can_poll()
        name = owner.resolve_service_name(name)  # `node` may have another private namespace
        if self._polled:
            self._service = node.create_service(
                service_type, name, _nothing, qos_profile=SERVICE, callback_group=PolledGroup()
            )
        else:  # then the executor calls the handler
            self._service = node.create_service(
                service_type, name, lambda request, response: handler(request, response, 0, "")
            )
        self._calls = Calls.of(owner)
        self._calls.services.add(self._service)
        self._sender = patient_sender(self._service, _SENDS)
        self._waiting = RequestQueue(self._service.service_name)
        self._answers = _Answers()

    def close(self) -> None:
        """Send no more answers."""
        self._answers.close()

    def poll(self) -> int:
        """Answer a turn of what has come, urgent ones first; the number of requests."""
        came = self._take() if self._polled else 0
        for _ in range(min(TURN, len(self._waiting))):
            self._answer(*self._waiting.pop())
        return came + len(self._waiting)

    def _take(self) -> int:
        """Take a turn of what has come and answer the urgent ones; how many."""
        ahead = time.time_ns() - time.monotonic_ns()
        for count in range(_REQUESTS):
            taken = take_request(self._service)
            if taken is None:
                return count
            request, header = taken
            came = _by_own_clock(header.received_timestamp, ahead)
            if self._urgent(request):
                self._answer(request, header, came, urgent=True)
            elif refusal := self._waiting.add(request, partial(tuple, (request, header, came))):
                self._refuse(refusal, header)
        return _REQUESTS

    def _answer(self, request: Any, header: Any, came: int, *, urgent: bool = False) -> None:
        response = self._type.Response()
        answered = self._calls.taken(self._service.service_name, type_name(self._type), request)
        try:
            response = self._handler(request, response, came, client_of(header))
        except ANY as error:
            self._log(traceback.format_exc())
            response.status = self._status(unexpected(error))
        self._answers.submit(lambda: self._send(answered, response, header), urgent=urgent)

    def _refuse(self, sentence: str, header: Any) -> None:
        if len(self._answers) >= REQUESTS_WAITING:  # nobody waits for so many
            self._log(
                f"requests of {self._service.service_name} come faster than they can be refused: "
                "some get no answer",
                throttle_duration_sec=_SAID_AGAIN,
            )
            return
        response = self._type.Response()
        response.status = self._status(Status(StatusCode.FAILURE, sentence))
        self._answers.submit(lambda: self._send(_nothing, response, header))

    def _status(self, status: Status) -> Any:
        return status_to_msg(Status(status.code, status.message, self._source))

    def _send(self, answered: Callable[[Any], None], response: Any, header: Any) -> None:
        try:
            answered(response)
            self._sender.send(response, header)
        except ANY:
            self._log(traceback.format_exc())


def _nothing(*message: Any) -> Any:
    """A callback that the executor never calls."""
