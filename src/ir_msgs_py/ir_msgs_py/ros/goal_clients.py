"""Clients of an action's goals: whether who has sent one is still there.

A goal carries the participant of its sender, which is that of the sender's process. Whoever sends
goals hears the answers to them, and so is in the graph as long as its process lives. A sender whose
goal is not answered cancels it by its id: it may be carried out all the same.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from uuid import uuid4

from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.node import Node
from rclpy.task import Future
from unique_identifier_msgs.msg import UUID

_DISCOVERY = 10.0  # s in which the client of a goal shows in the graph, on a busy machine too
_GRAPH_PERIOD = 0.2  # s between two looks who is there: each takes a millisecond
_HELD_UP = 1.0  # s that count at most between two looks: who looks may have been held up itself

Gone = Callable[[], bool]


def new_goal_id() -> UUID:
    """An id for a goal that is sent."""
    return UUID(uuid=list(uuid4().bytes))


def cancel_unanswered(client: ActionClient, goal_id: UUID, sent: Future) -> None:
    """Cancel a goal whose answer has not come: its node may have taken it, or takes it later. To be
    called on the thread that spins.
    """
    ClientGoalHandle(client, goal_id, None).cancel_goal_async()
    sent.add_done_callback(_cancel_taken)


def _cancel_taken(sent: Future) -> None:
    handle = sent.result()
    if handle is not None and handle.accepted:
        handle.cancel_goal_async()


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
        self._missing = 0.0
        self._looked = time.monotonic()
        self._until = self._looked + discovery

    def gone(self, clients: Sequence[bytes]) -> bool:
        """Look at the identities of those who are clients of the action now."""
        now = time.monotonic()
        own = any(each.startswith(self._participant) for each in clients)
        self._known = self._known or (own and bool(self._participant))
        discovering = bool(clients) and not self._known and now < self._until
        self._missing += min(now - self._looked, _HELD_UP)
        self._looked = now
        if own or discovering:
            self._missing = 0.0
        return 0.0 < self._timeout < self._missing


class ActionClients:
    """Identities of the clients of an action of `node` in the graph: who hears the answers to
    goals, as whoever sends one does, or the feedback.
    """

    def __init__(self, node: Node, action: str) -> None:
        self._node = node
        service = node.resolve_service_name(f"{action}/_action/send_goal")
        self._answers = f"rr{service}Reply"
        self._feedback = f"{action}/_action/feedback"
        self._seen = -_GRAPH_PERIOD
        self._there: tuple[bytes, ...] = ()

    def now(self) -> Sequence[bytes]:
        """Those of the last moments."""
        now = time.monotonic()
        if now - self._seen >= _GRAPH_PERIOD:
            node = self._node
            found = [
                *node.get_subscriptions_info_by_topic(self._answers, no_mangle=True),
                *node.get_subscriptions_info_by_topic(self._feedback),
            ]
            self._there = tuple(bytes(each.endpoint_gid) for each in found)
            self._seen = now
        return self._there

    def watch(self, timeout: float, participant: bytes) -> Gone:
        """Whether the client of a goal that is watched from now on has been gone for `timeout` [s];
        0: never. participant: of who sent it.
        """
        watch = ClientWatch(timeout, participant)
        if timeout == 0.0:
            return lambda: False
        return lambda: watch.gone(self.now())
