"""Diagnostics of a node on /diagnostics, one bounded line each.

The names carry the node's namespace, so that cells are kept apart.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from ir_msgs_py import names
from ir_msgs_py.names import diagnostic_name
from ir_values.errors import one_line

OK, WARN, ERROR = (
    int(level[0]) for level in (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR)
)


@dataclass(frozen=True)
class Condition:
    """The state of a node or of a part of it; level: a number of
    diagnostic_msgs/DiagnosticStatus.
    """

    name: str
    level: int
    sentence: str
    values: Mapping[str, object] = field(default_factory=dict)
    hardware: str = ""


class Diagnostics:
    """The publisher of one node."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = node.create_publisher(DiagnosticArray, names.DIAGNOSTICS, 10)

    def publish(self, conditions: Iterable[Condition], stamp: Time | None = None) -> None:
        """Publish these conditions in one message; stamp: when they held, by default now."""
        namespace = self._node.get_namespace()
        said = [*conditions, *self._doubled()]
        message = DiagnosticArray(status=[_status(namespace, condition) for condition in said])
        message.header.stamp = stamp or self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def _doubled(self) -> list[Condition]:
        """What there is to say where other nodes have this node's name."""
        name = self._node.get_name()
        namespace = self._node.get_namespace()
        count = self._node.get_node_names_and_namespaces().count((name, namespace))
        if count < 2:
            return []
        sentence = (
            f"{count} nodes are named {self._node.get_fully_qualified_name()}, and each takes "
            "what is sent to that name: end all but one, or start it in another namespace"
        )
        return [Condition(f"{name}: name", WARN, sentence)]


def _status(namespace: str, condition: Condition) -> DiagnosticStatus:
    return DiagnosticStatus(
        name=diagnostic_name(namespace, condition.name),
        level=bytes([condition.level]),
        message=one_line(condition.sentence),
        hardware_id=condition.hardware,
        values=[
            KeyValue(key=key, value=one_line(str(value))) for key, value in condition.values.items()
        ],
    )
