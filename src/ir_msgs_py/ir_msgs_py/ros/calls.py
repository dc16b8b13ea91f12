"""What a node was asked and what it answered, for recordings: one message per request on its topic
`~/calls`.

Where nobody subscribes, nothing is done. A message that is longer than MOST_BYTES is left out (its
field is empty), and it is measured before it is copied: a recorder must not cost a node the memory
of its answers.
"""

from __future__ import annotations

import array
from collections.abc import Callable, Iterable
from typing import Any, ClassVar
from weakref import WeakKeyDictionary

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message

from ir_msgs.msg import RecordedCall
from ir_msgs_py import names

MOST_BYTES = 2 * 2**20
"""Of a request or an answer: the points of forty movements. What the middleware keeps for a
recorder that is busy is at most WAITING of these twice.
"""
WAITING = 100
_NUMBER = 8  # bytes; what a number takes at most


class Calls:
    """Publishes the calls of a node; `of` gives the one that all its services share."""

    _known: ClassVar[WeakKeyDictionary[Node, Calls]] = WeakKeyDictionary()

    def __init__(self, node: Node) -> None:
        self._clock = node.get_clock()
        self._name = node.get_fully_qualified_name()
        self._publisher = node.create_publisher(
            RecordedCall, f"~/{names.CALLS}", QoSProfile(depth=WAITING)
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
        data = _bounded(request) if self._publisher.get_subscription_count() else None

        def answered(response: Any) -> None:
            if not self._publisher.get_subscription_count():
                return
            call = RecordedCall(node=self._name, service=name, type=kind)
            call.header.stamp = stamp
            call.request = _bounded(request) if data is None else data
            call.response = _bounded(response)
            self._publisher.publish(call)

        return answered


def type_text(kind: Any) -> str:
    """Name of an interface's class: "ir_msgs/srv/PlanProgram"."""
    package, folder = kind.__module__.split(".")[:2]
    return f"{package}/{folder}/{kind.__name__}"


def _bounded(message: Any) -> array.array[int]:
    """The message's CDR; nothing where it is longer than MOST_BYTES."""
    data = serialize_message(message) if _left(message, MOST_BYTES) >= 0 else b""
    return array.array("B", data if len(data) <= MOST_BYTES else b"")


def _left(value: Any, left: int) -> int:
    """How many of `left` bytes a value leaves, about; it ends as soon as none are left."""
    if left < 0:
        return left
    if isinstance(value, str | bytes):
        return left - len(value)
    if isinstance(value, array.array):
        return left - len(value) * value.itemsize
    if hasattr(value, "nbytes"):
        return left - int(value.nbytes)
    for part in _parts(value):
        if (left := _left(part, left)) < 0:
            return left
    return left - _NUMBER


def _parts(value: Any) -> Iterable[Any]:
    if hasattr(value, "get_fields_and_field_types"):
        return (getattr(value, name) for name in value.get_fields_and_field_types())
    return value if isinstance(value, list | tuple | set) else ()
