"""A topic of commands: every message counts once, from publishers that latch and from those that do
not.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Hashable, Iterator, Sequence
from functools import partial
from typing import Any

from rclpy.node import Node

from ir_msgs_py.ros.quality import COMMANDS, REQUESTS_WAITING


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
                with subscription.handle:
                    taken = subscription.handle.take_message(subscription.msg_type, False)
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
