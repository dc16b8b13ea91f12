"""Topics that a node looks at when it wants to, instead of being woken by every message.

Waking an rclpy executor 500 times a second takes a third of a core; taking what has arrived takes
nothing until somebody asks. The middleware keeps the messages and notes when they came.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy


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


class Received(NamedTuple):
    """A message, and how long ago it came [s]."""

    message: Any
    age: float


class LatestMessage:
    """The newest message of a topic, whoever publishes it and however fast."""

    def __init__(self, node: Node, message_type: Any, topic: str) -> None:
        newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._subscription = node.create_subscription(
            message_type, topic, lambda message: None, newest, callback_group=PolledGroup()
        )

    def take(self) -> Received | None:
        """Return the newest message that has come since the last call, None when none has."""
        with self._subscription.handle:
            taken = self._subscription.handle.take_message(self._subscription.msg_type, False)
        if taken is None:
            return None
        message, info = taken
        return Received(message, max(0.0, (time.time_ns() - info["received_timestamp"]) * 1e-9))


class PolledTopic:
    """The newest messages of a topic with the quality of service that is asked for."""

    def __init__(self, node: Node, message_type: Any, topic: str, qos: QoSProfile) -> None:
        self._most = max(1, qos.depth)
        self._subscription = node.create_subscription(
            message_type, topic, lambda message: None, qos, callback_group=PolledGroup()
        )

    def take(self) -> list[Any]:
        """Return what has come since the last call, oldest first; at most the depth asked for."""
        taken: list[Any] = []
        with self._subscription.handle:
            while len(taken) < self._most:
                found = self._subscription.handle.take_message(self._subscription.msg_type, False)
                if found is None:
                    break
                taken.append(found[0])
        return taken
