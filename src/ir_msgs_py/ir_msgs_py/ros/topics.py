"""Topics: quality of service, commands that count once, messages taken when they are wanted.

Waking an rclpy executor 500 times a second takes a third of a core. LatestMessage and PolledTopic
take what has arrived when somebody asks; the middleware keeps the messages and notes when they
came.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Hashable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from ir_msgs_py.ros.rclpy_inside import can_take_messages, take_message

REQUESTS_WAITING = 1000
"""Requests of a service that wait for their answers at most; what comes beyond is refused
(`serving.BoundedService`).
"""
BURST = 5_000
"""Requests that the middleware keeps between two looks of a node. ROS keeps 10 by default, and
drops the eleventh without a word to anybody; only a client that sends more than these faster than
the node looks, which is some ten thousand times a second, loses any. What nobody uses takes no
memory.
"""

SERVICE = QoSProfile(depth=BURST)
ACTION_SERVICES = {
    "goal_service_qos_profile": SERVICE,
    "result_service_qos_profile": SERVICE,
    "cancel_service_qos_profile": SERVICE,
}
"""Keyword arguments of an action server or client: an action is three services."""

COMMANDS = (
    QoSProfile(depth=REQUESTS_WAITING, durability=DurabilityPolicy.TRANSIENT_LOCAL),
    QoSProfile(depth=REQUESTS_WAITING),
)
"""Two subscriptions that hear every publisher of commands: those that latch, with what they said
before, and those that do not, as `ros2 topic pub` by default. A latching publisher reaches both.
"""

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""The last message reaches whoever comes later."""


class PolledGroup(CallbackGroup):
    """Entities that the executor never waits for."""

    def can_execute(self, entity: Any) -> bool:
        """Never."""
        return False

    def beginning_execution(self, entity: Any) -> bool:
        """Never."""
        return False

    def ending_execution(self, entity: Any) -> None:
        """Nothing began."""


class _Taken:
    """The messages of a topic that nobody is woken for; of those that rclpy calls back with where
    its insides are missing.
    """

    def __init__(self, node: Node, message_type: Any, topic: str, qos: QoSProfile) -> None:
        self._came: deque[tuple[Any, dict[str, int]]] = deque(maxlen=max(1, qos.depth))
        self._subscription = node.create_subscription(
            message_type, topic, self._keep, qos, callback_group=PolledGroup()
        )
        self._polled = can_take_messages(self._subscription)
        if not self._polled:
            node.destroy_subscription(self._subscription)
            self._subscription = node.create_subscription(message_type, topic, self._keep, qos)

    def next(self) -> tuple[Any, dict[str, int]] | None:
        """The next message with its times [ns]; None when there is none."""
        if self._polled:
            return take_message(self._subscription)
        return self._came.popleft() if self._came else None

    def _keep(self, message: Any, info: dict[str, int]) -> None:
        self._came.append((message, info))


class Received(NamedTuple):
    """A message, and how long ago it came [s]."""

    message: Any
    age: float


class LatestMessage:
    """The newest message of a topic, whoever publishes it and however fast.

    depth: how many wait between two looks, so that one that fits isn't pushed out by others.
    """

    def __init__(self, node: Node, message_type: Any, topic: str, depth: int = 1) -> None:
        newest = QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._taken = _Taken(node, message_type, topic, newest)

    def take(self, fits: Callable[[Any], bool] = lambda message: True) -> Received | None:
        """Return the newest message since the last call that fits, the newest where none does, None
        when none has come.
        """
        newest = None
        fitting = None
        while True:
            found = self._taken.next()
            if found is None:
                break
            newest = found
            if fits(found[0]):
                fitting = found
        chosen = fitting or newest
        if chosen is None:
            return None
        message, info = chosen
        return Received(message, max(0.0, (time.time_ns() - info["received_timestamp"]) * 1e-9))


class PolledTopic:
    """The newest messages of a topic with the quality of service that is asked for."""

    def __init__(self, node: Node, message_type: Any, topic: str, qos: QoSProfile) -> None:
        self._most = max(1, qos.depth)
        self._taken = _Taken(node, message_type, topic, qos)

    def take(self) -> list[Any]:
        """Return what has come since the last call, oldest first; at most the depth asked for."""
        taken: list[Any] = []
        while len(taken) < self._most:
            found = self._taken.next()
            if found is None:
                break
            taken.append(found[0])
        return taken


class CommandTopic:
    """Calls back with the messages of each turn, at least one, in the order in which they were
    sent; what latching publishers said before `node` started is heard too.

    A turn takes all that wait: on a busy machine a command would come behind seconds of older ones.
    of: what a message commands; history of it that comes after something newer is dropped.
    """

    def __init__(
        self,
        node: Node,
        msg_type: Any,
        topic: str,
        take: Callable[[Sequence[Any]], None],
        of: Callable[[Any], Hashable] = lambda msg: None,
    ) -> None:
        self._take = take
        self._of = of
        self._started = time.time_ns()
        self._heard: deque[tuple[int, Any]] = deque(maxlen=REQUESTS_WAITING)
        self._newest: dict[Hashable, int] = {}
        self._subscriptions = [
            (
                latching,
                node.create_subscription(msg_type, topic, partial(self._hear, latching), quality),
            )
            for latching, quality in zip((True, False), COMMANDS, strict=True)
        ]

    def _hear(self, latching: bool, msg: Any, info: dict[str, int]) -> None:
        came = [(info["source_timestamp"], latching, msg), *self._waiting()]
        came.sort(key=lambda each: each[0])
        new = [msg for sent, latched, msg in came if self._is_new(sent, latched, msg)]
        if new:
            self._take(new)

    def _waiting(self) -> Iterator[tuple[int, bool, Any]]:
        for latching, subscription in self._subscriptions:
            for _ in range(REQUESTS_WAITING):  # who floods the topic does not hold the node here
                taken = take_message(subscription) if can_take_messages(subscription) else None
                if taken is None:
                    break
                yield taken[1]["source_timestamp"], latching, taken[0]

    def _is_new(self, sent: int, latching: bool, msg: Any) -> bool:
        if (sent, msg) in self._heard:  # by the other subscription
            return False
        what = self._of(msg)
        newest = self._newest.get(what, 0)
        if latching and sent < min(self._started, newest):
            return False
        self._heard.append((sent, msg))
        if what in self._newest or len(self._newest) < REQUESTS_WAITING:
            self._newest[what] = max(sent, newest)
        return True
