"""Listens to topics as raw bytes, with the quality of service that is offered, and without waking
for every message.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log, ParameterEvent
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from ir_msgs_py import names
from ir_msgs_py.names import owns_diagnostic, owns_logger, owns_node
from ir_msgs_py.ros.messages import interface_type
from ir_msgs_py.ros.rclpy_inside import can_take_messages, take_message
from ir_msgs_py.ros.topics import PolledGroup
from ir_recorder.errors import SchemaError
from ir_recorder.format.qos import QosOffer, request_for
from ir_values.errors import UnknownTypeError

_LATCHED = DurabilityPolicy.TRANSIENT_LOCAL


@dataclass(frozen=True)
class Arrival:
    """A message's CDR bytes, and when they arrived [ns of the node's clock]."""

    time: int
    topic: str
    data: bytes


_OWNERS: dict[str, tuple[Any, Callable[[str, Any], bool]]] = {
    names.DIAGNOSTICS: (
        DiagnosticArray,
        lambda namespace, message: any(
            owns_diagnostic(namespace, each.name) for each in message.status
        ),
    ),
    names.ROSOUT: (Log, lambda namespace, message: owns_logger(namespace, message.name)),
    names.PARAMETER_EVENTS: (
        ParameterEvent,
        lambda namespace, message: owns_node(namespace, message.node),
    ),
}
"""Topics that all cells share: the type, and whether a message comes from a node of a namespace."""


def is_own(arrival: Arrival, namespace: str) -> bool:
    """Whether a message belongs to the cell of a namespace; on topics of the cell's own all do."""
    if arrival.topic not in _OWNERS:
        return True
    message_type, owns = _OWNERS[arrival.topic]
    try:
        return owns(namespace, deserialize_message(arrival.data, message_type))
    except Exception:  # bytes of a stranger, that the middleware can't read
        return False


class TopicListener:
    """Subscriptions of a node by topic; `lost` counts messages of single publishers that never
    arrived.
    """

    def __init__(self, node: Node, depth: int) -> None:
        self._node = node
        self._depth = depth
        self._group = PolledGroup()
        self._subscriptions: dict[str, Subscription] = {}
        self._next: dict[str, Callable[[], tuple[Any, dict[str, int]] | None]] = {}
        # of the last message; None where publishers mix theirs
        self._numbers: dict[str, int | None] = {}
        self.lost = 0

    def __contains__(self, topic: str) -> bool:
        return topic in self._subscriptions

    def __len__(self) -> int:
        return len(self._subscriptions)

    def __iter__(self) -> Iterator[str]:
        return iter(self._subscriptions)

    def offers(self, topic: str) -> tuple[QosOffer, ...]:
        """What the topic's publishers offer now."""
        return tuple(
            _offer(publisher) for publisher in self._node.get_publishers_info_by_topic(topic)
        )

    def open(self, topic: str, type_name: str, offers: Sequence[QosOffer]) -> None:
        """Subscribes to a topic; SchemaError when its type isn't installed."""
        request = request_for(offers)
        profile = QoSProfile(
            depth=self._depth,
            reliability=ReliabilityPolicy.RELIABLE
            if request.reliable
            else ReliabilityPolicy.BEST_EFFORT,
            durability=_LATCHED if request.transient_local else DurabilityPolicy.VOLATILE,
        )
        came: deque[tuple[bytes, dict[str, int]]] = deque(maxlen=self._depth)

        def keep(data: bytes, info: dict[str, int]) -> None:
            came.append((data, info))

        subscribe = partial(
            self._node.create_subscription,
            _message_type(type_name),
            topic,
            keep,
            profile,
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        subscription = subscribe(callback_group=self._group)
        self._next[topic] = partial(take_message, subscription)
        if not can_take_messages(subscription):  # then rclpy calls back with what comes
            self._node.destroy_subscription(subscription)
            subscription = subscribe()
            self._next[topic] = lambda: came.popleft() if came else None
        self._subscriptions[topic] = subscription
        self._numbers[topic] = 0 if len(offers) == 1 else None

    def take(self) -> list[Arrival]:
        """All that has arrived since the last time, in the order of arrival."""
        clock = self._node.get_clock()
        arrived = []
        for topic, take in self._next.items():
            for _ in range(self._depth):
                taken = take()
                if taken is None:
                    break
                data, info = taken
                received = info["received_timestamp"] if not clock.ros_time_is_active else 0
                self._count(topic, info["publication_sequence_number"])
                arrived.append(Arrival(received or clock.now().nanoseconds, topic, data))
        return sorted(arrived, key=attrgetter("time"))

    def close(self) -> None:
        """Ends all subscriptions."""
        for subscription in self._subscriptions.values():
            self._node.destroy_subscription(subscription)
        self._subscriptions.clear()
        self._next.clear()
        self._group = PolledGroup()  # a group keeps a reference to whatever it ever had

    def _count(self, topic: str, number: int | None) -> None:
        """A publisher numbers its messages: numbers that are left out are messages that didn't
        arrive.
        """
        last = self._numbers[topic]
        if last is not None and number is not None:
            if 0 < last < number:
                self.lost += number - last - 1
            self._numbers[topic] = number


def _offer(publisher: TopicEndpointInfo) -> QosOffer:
    profile = publisher.qos_profile
    return QosOffer(
        reliable=profile.reliability == ReliabilityPolicy.RELIABLE,
        transient_local=profile.durability == _LATCHED,
        depth=int(profile.depth),
    )


def _message_type(name: str) -> Any:
    """The class of an installed type; the session has looked its definition up before."""
    try:
        return interface_type(name, "msg")
    except UnknownTypeError as error:
        raise SchemaError(f"type {name[:200]} isn't installed for Python: {error}") from error
