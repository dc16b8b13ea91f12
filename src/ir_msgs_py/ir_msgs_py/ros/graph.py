"""Who offers what: services, actions and topics with their types, and how publishers offer them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rclpy.action import get_action_names_and_types
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from ir_msgs_py.ros.calls import type_text

_DEPTH = 100
_OWN = "ir_msgs/"


class Graph:
    """The graph as one node sees it; it fills up within moments after the node has started."""

    def __init__(self, node: Node) -> None:
        self._node = node

    def services(self) -> dict[str, str]:
        """Service names with their type, without those of actions."""
        return {
            name: _chosen(types)
            for name, types in self._node.get_service_names_and_types()
            if "/_action/" not in name
        }

    def actions(self) -> dict[str, str]:
        """Action names with their type."""
        return {name: _chosen(types) for name, types in get_action_names_and_types(self._node)}

    def topics(self) -> dict[str, str]:
        """Topic names with their type, without those of actions."""
        return {
            name: _chosen(types)
            for name, types in self._node.get_topic_names_and_types()
            if "/_action/" not in name
        }

    def nodes(self) -> list[str]:
        """Full names of the nodes."""
        found = self._node.get_node_names_and_namespaces()
        return [f"{namespace.rstrip('/')}/{name}" for name, namespace in found]

    def other_type(self, name: str, kind: Any) -> str:
        """What to add to a sentence when nobody offers the service or topic `name` as the class
        `kind`: the type that somebody has it with, "" when nobody does.
        """
        full = self._node.resolve_service_name(name)
        own = type_text(kind)
        known = (*self._node.get_service_names_and_types(), *self._node.get_topic_names_and_types())
        found = [
            each for offered, types in known if offered == full for each in types if each != own
        ]
        return f"; somebody in the graph has it as {found[0]}" if found else ""

    def publishers(self, topic: str) -> list[Any]:
        """End points that publish the topic."""
        infos: list[Any] = self._node.get_publishers_info_by_topic(topic)
        return infos

    def qos_of_publishers(self, topic: str) -> QoSProfile:
        """Quality of service with which all present publishers are heard, as `ros2 topic echo`
        chooses it.
        """
        offered = [info.qos_profile for info in self.publishers(topic)]
        reliable = all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offered)
        kept = bool(offered) and all(
            qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered
        )
        return QoSProfile(
            depth=_DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
        )


def _chosen(types: Sequence[str]) -> str:
    """The type that counts where somebody offers a name with another one too: this project's."""
    return next((each for each in types if each.startswith(_OWN)), types[0])
