"""Publishes the state of the recorder: an error ends a recording, lost messages are a warning."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from ir_msgs_py import names


class RecorderDiagnostics:
    """One publisher of the node; `publish` once a second."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = node.create_publisher(DiagnosticArray, names.DIAGNOSTICS, 10)

    def publish(self, failure: str, path: str, messages: int, topics: int, lost: int) -> None:
        """`failure`: why the last recording ended on its own; `path`: of the running one, "" for none."""
        status = DiagnosticStatus(name=self._node.get_name(), hardware_id="")
        status.level = DiagnosticStatus.ERROR if failure else DiagnosticStatus.OK
        if lost and not failure:
            status.level = DiagnosticStatus.WARN
        status.message = failure or ("recording" if path else "idle")
        values = {"path": path, "messages": messages, "topics": topics, "lost": lost}
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)
