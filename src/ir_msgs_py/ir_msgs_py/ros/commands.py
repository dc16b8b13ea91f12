"""A topic of commands: every message counts once, from publishers that latch and from those that do not."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Hashable
from functools import partial
from typing import Any

from rclpy.node import Node

from ir_msgs_py.ros.quality import COMMANDS, REQUESTS_WAITING


class CommandTopic:
    """Calls back with each message; what latching publishers said before `node` started is heard too.

    of: what a message commands; history of it that comes after something newer is dropped.
    """

    def __init__(
        self,
        node: Node,
        msg_type: Any,
        topic: str,
        take: Callable[[Any], None],
        of: Callable[[Any], Hashable] = lambda msg: None,
    ) -> None:
        self._take, self._of, self._started = take, of, time.time_ns()
        self._heard: deque[tuple[int, Any]] = deque(maxlen=REQUESTS_WAITING)
        self._newest: dict[Hashable, int] = {}
        latching, live = COMMANDS
        node.create_subscription(msg_type, topic, partial(self._hear, True), latching)
        node.create_subscription(msg_type, topic, partial(self._hear, False), live)

    def _hear(self, latching: bool, msg: Any, info: dict[str, int]) -> None:
        sent, what = info["source_timestamp"], self._of(msg)
        if (sent, msg) in self._heard:  # by the other subscription
            return
        newest = self._newest.get(what, 0)
        if latching and sent < min(self._started, newest):
            return
        self._heard.append((sent, msg))
        if what in self._newest or len(self._newest) < REQUESTS_WAITING:
            self._newest[what] = max(sent, newest)
        self._take(msg)
