"""Publishes the state of the recorder: an error ends a recording, lost messages are a warning."""

from __future__ import annotations

from rclpy.node import Node

from ir_msgs_py.ros.diagnostics import ERROR, OK, WARN, Condition, Diagnostics


class RecorderDiagnostics:
    """One publisher of the node; `publish` once a second."""

    def __init__(self, node: Node) -> None:
        self._name, self._diagnostics = node.get_name(), Diagnostics(node)

    def publish(self, failure: str, path: str, messages: int, topics: int, lost: int) -> None:
        """`failure`: why the last recording ended on its own; `path`: of the running one, "" for none."""
        level = ERROR if failure else WARN if lost else OK
        sentence = failure or ("recording" if path else "idle")
        values = {"path": path, "messages": messages, "topics": topics, "lost": lost}
        self._diagnostics.publish([Condition(self._name, level, sentence, values)])
