"""Diagnostics of a node on /diagnostics, one bounded line each.

The names carry the node's namespace, so that cells are kept apart.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

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


_LOOK = 2.0  # s between two looks: one takes a millisecond
_PORT = re.compile(r"/dev/shm/(fastrtps_port\d+)(?:_el)?(?: \(deleted\))?$")


def lost_ports() -> tuple[str, ...]:
    """Shared memory at which this process listens and that has been removed; () where it can't be
    known, as on a system without /proc.

    Fast DDS holds `fastrtps_portN_el` open for each port at which it listens, and maps
    `fastrtps_portN`. A file that was removed stays mapped, but others make a new one.
    """
    try:
        descriptors = [_link(path) for path in Path("/proc/self/fd").iterdir()]
        mapped = Path("/proc/self/maps").read_text(encoding="ascii", errors="replace")
    except OSError:
        return ()
    return unlinked(descriptors, mapped.splitlines())


def unlinked(descriptors: Iterable[str], mapped: Iterable[str]) -> tuple[str, ...]:
    """Ports whose lock is among the open files, and whose mapping is marked as deleted."""
    own = {found[1] for each in descriptors if "_el" in each and (found := _PORT.search(each))}
    gone = {
        found[1] for each in mapped if each.endswith("(deleted)") and (found := _PORT.search(each))
    }
    return tuple(sorted(own & gone))


def _link(path: Path) -> str:
    try:
        return str(path.readlink())
    except OSError:  # closed meanwhile
        return ""


class Diagnostics:
    """The publisher of one node."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._look_at = 0.0
        self._lost: tuple[str, ...] = ()
        self._publisher = node.create_publisher(DiagnosticArray, names.DIAGNOSTICS, 10)

    def publish(self, conditions: Iterable[Condition], stamp: Time | None = None) -> None:
        """Publish these conditions in one message; stamp: when they held, by default now."""
        namespace = self._node.get_namespace()
        said = [*conditions, *self._doubled(), *self._deaf()]
        message = DiagnosticArray(status=[_status(namespace, condition) for condition in said])
        message.header.stamp = stamp or self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def _deaf(self) -> list[Condition]:
        """What there is to say where other processes can no longer reach this one."""
        now = time.monotonic()
        if now >= self._look_at:
            self._look_at = now + _LOOK
            self._lost = lost_ports()
        if not self._lost:
            return []
        sentence = (
            f"shared memory {', '.join(self._lost)} was removed while this node listens there: "
            "what processes of this host send does not arrive, start the node again"
        )
        return [Condition(f"{self._node.get_name()}: hearing", ERROR, sentence)]

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
