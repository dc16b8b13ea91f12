"""Commands by topic: trajectories and PLC inputs."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from trajectory_msgs.msg import JointTrajectory

from ir_msgs.msg import PlcInputs
from ir_msgs_py import names
from ir_msgs_py.plc import PlcInputs as Levels
from ir_msgs_py.ros.conversions import status_to_msg
from ir_msgs_py.ros.messages import type_name
from ir_msgs_py.ros.power_conversions import plc_inputs_from_msg
from ir_msgs_py.ros.rclpy_inside import (
    PatientSender,
    can_take_messages,
    can_take_requests,
    take_bytes,
    take_request,
)
from ir_msgs_py.ros.serving import ANY, Calls, unexpected
from ir_msgs_py.ros.topics import BURST, SERVICE, PolledGroup
from ir_msgs_py.status import Status
from ir_sim_driver.controller import Driver, refused
from ir_sim_driver.errors import DriverError, TrajectoryRefusedError
from ir_sim_driver.motion import ErrorCode, Outcome, TrajectoryGoal
from ir_sim_driver.node.messages import goal_from_trajectory
from ir_sim_driver.node.trajectory_actions import TrajectoryReader
from ir_sim_driver.plc import STOP_BIT, TOPIC
from ir_values.errors import IrError

# PLC inputs and recovery.
#
# They have a thread of their own, which looks every few milliseconds and is never behind goals,
# cells or other services. Messages are taken as bytes; a flood of the same levels is read once.

_PERIOD = 0.004  # s between two looks while nothing comes
TURN = 64  # messages or requests that one look takes: 2 ms of the thread
_KEPT_LEVELS = 256  # messages whose levels are remembered
_PRESS_QUALITY = tuple(
    QoSProfile(depth=BURST, durability=durability)
    for durability in (DurabilityPolicy.TRANSIENT_LOCAL, DurabilityPolicy.VOLATILE)
)
"""Both kinds of publishers are heard, see `topics.COMMANDS`, with 20,000 levels before a press."""


class CommandThread:
    """Looks again and again at `polls`, in this order; each returns how much it has taken, which is
    at most a turn: a flood of one is no delay for the others.
    """

    def __init__(self, *polls: Callable[[], int]) -> None:
        self._polls = polls
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="presses", daemon=True)

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
            if not sum(poll() for poll in self._polls):
                self._closing.wait(_PERIOD)


class PlcTopic:
    """Hands each message to the driver, in the order in which they were sent; `poll` takes them."""

    def __init__(self, node: Node, driver: Driver) -> None:
        self._driver = driver
        self._started = time.time_ns()
        self._newest = 0
        self._known: dict[tuple[int, bytes], None] = {}  # heard by the other subscription
        self._levels: dict[bytes, Levels | None] = {}
        self._subscriptions = [self._listen(node, quality) for quality in _PRESS_QUALITY]

    def _listen(self, node: Node, quality: QoSProfile) -> Any:
        """A subscription that `poll` takes from; where rclpy can't, the executor calls back."""
        latching = quality.durability == DurabilityPolicy.TRANSIENT_LOCAL

        def called(data: bytes) -> None:
            self._take([(time.time_ns(), bytes(data), latching)])

        topic = names.PLC_INPUTS
        polled = node.create_subscription(
            PlcInputs, topic, _nothing, quality, callback_group=PolledGroup(), raw=True
        )
        if can_take_messages(polled):
            return polled
        node.destroy_subscription(polled)
        node.create_subscription(PlcInputs, topic, called, quality, raw=True)
        return None

    def poll(self) -> int:
        """Take what has come; the number of messages."""
        came: list[tuple[int, bytes, bool]] = []
        for subscription, latching in zip(self._subscriptions, (True, False), strict=True):
            for _ in range(TURN if subscription is not None else 0):
                taken = take_bytes(subscription)
                if taken is None:
                    break
                came.append((taken[1]["source_timestamp"], taken[0], latching))
        if came:
            self._take(came)
        return len(came)

    def _take(self, came: list[tuple[int, bytes, bool]]) -> None:
        came.sort(key=lambda each: each[0])
        levels: list[Levels] = []
        before = b""
        for sent, data, latching in came:
            old = latching and sent < min(self._started, self._newest)
            if old or (sent, data) in self._known:
                continue
            self._known[sent, data] = None
            self._newest = max(self._newest, sent)
            if data != before:  # levels that are repeated without a break say nothing new
                levels += self._read(data)
            before = data
        while len(self._known) > BURST:
            del self._known[next(iter(self._known))]
        if levels:
            self._write(lambda: self._driver.plc.write_all_inputs(TOPIC, *levels))

    def _read(self, data: bytes) -> list[Levels]:
        """The levels; none for a message that makes no sense, of which only a pressed stop
        counts.
        """
        known = self._levels.get(data)
        if known is not None:
            return [known]
        msg = deserialize_message(data, PlcInputs)
        try:
            levels = plc_inputs_from_msg(msg)
        except (IrError, ValueError) as error:
            self._driver.warn(f"plc_inputs ignored: {error}")
            if msg.emergency_stop:
                self._write(lambda: self._driver.plc.write_inputs(TOPIC, {STOP_BIT: True}))
            return []
        if len(self._levels) < _KEPT_LEVELS:
            self._levels[data] = levels
        return [levels]

    def _write(self, write: Callable[[], None]) -> None:
        try:
            write()
        except (IrError, DriverError) as error:
            self._driver.warn(f"plc_inputs ignored: {error}")


class PolledService:
    """A service of `node` that a CommandThread answers: requests are acted upon at once, and their
    answers are sent by another thread, as one to a client that has died takes a second.

    handler: from request, response and the time at which the request came [ns of the host's clock].
    """

    def __init__(
        self, node: Node, service_type: Any, name: str, handler: Callable[[Any, Any, int], Any]
    ) -> None:
        self._type = service_type
        self._handler = handler
        self._source = node.get_name()
        self._log = node.get_logger().error
        self._service = node.create_service(
            service_type, name, _nothing, qos_profile=SERVICE, callback_group=PolledGroup()
        )
        self._polled = can_take_requests(self._service)
        if not self._polled:  # then the executor calls the handler
            node.destroy_service(self._service)
            self._service = node.create_service(
                service_type, name, lambda request, response: handler(request, response, 0)
            )
        self._calls = Calls.of(node)
        self._sender = PatientSender(self._service.send_response)
        self._answers = ThreadPoolExecutor(max_workers=1, thread_name_prefix="answers")

    def poll(self) -> int:
        """Answer what has come; the number of requests."""
        for count in range(TURN):
            taken = take_request(self._service) if self._polled else None
            if taken is None:
                return count
            request, header = taken
            response = self._type.Response()
            answered = self._calls.taken(self._service.service_name, type_name(self._type), request)
            try:
                response = self._handler(request, response, header.received_timestamp)
            except ANY as error:
                self._log(traceback.format_exc())
                status = unexpected(error)
                named = Status(status.code, status.message, self._source)
                response.status = status_to_msg(named)
            self._answers.submit(self._send, answered, response, header)
        return TURN

    def _send(self, answered: Callable[[Any], None], response: Any, header: Any) -> None:
        try:
            answered(response)
            self._sender.send(response, header)
        except ANY:
            self._log(traceback.format_exc())


def _nothing(*message: Any) -> Any:
    """A callback that the executor never calls."""


# Trajectories by topic: taken as bytes, so that a huge one is refused before Python objects are
# made of it, and parsed beside the control loop.

_POINT = (
    256  # bytes; one with positions, velocities, accelerations and efforts of six joints has 232
)
_OBJECTS = 4  # times its bytes that a message takes as Python objects
_HEAD = 65_536  # bytes for header and names: some twenty times what they need


class TrajectoryTopic:
    """Hands each trajectory to the driver; what is refused becomes a warning."""

    def __init__(self, node: Node, driver: Driver) -> None:
        self._driver = driver
        self._reader = TrajectoryReader()
        topic = names.COMMANDED_TRAJECTORY
        self._subscription = node.create_subscription(
            JointTrajectory, topic, self._take, 10, raw=True
        )

    def take_waiting(self, most: int) -> bool:
        """Take what waits for the executor now, from any thread; whether that was all."""
        if not can_take_messages(self._subscription):
            return True
        for _ in range(most):
            taken = take_bytes(self._subscription)
            if taken is None:
                return True
            self._take(taken[0])
        return False

    def _take(self, message: bytes) -> None:
        most = self._driver.max_points
        bound = _HEAD + _POINT * most
        if len(message) > bound:
            size = f"{len(message)} bytes: at most {bound}, for {most} points"
            self._driver.warn(f"trajectory of the topic: it has {size}")
            return

        def read() -> TrajectoryGoal:
            return goal_from_trajectory(self._reader.read(message), most)

        try:  # the points are counted when it is read
            ticket = self._driver.admit(0, _OBJECTS * len(message))
        except TrajectoryRefusedError as error:
            self._ended(refused(str(error), error.code))
        else:
            self._driver.submit(0, read, self._ended, ticket)

    def _ended(self, outcome: Outcome) -> None:
        if outcome.code is not ErrorCode.SUCCESSFUL:
            self._driver.warn(f"trajectory of the topic: {outcome.sentence} ({outcome.code.name})")
