"""Publishes the state of the recorder: an error ends a recording, lost messages are a warning."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from rclpy.node import Node

from ir_msgs_py.ros.diagnostics import ERROR, OK, WARN, Condition, Diagnostics


@dataclass(frozen=True)
class State:
    """failure: why the last recording ended on its own; path: of the running one, "" for none;
    lost: messages that never arrived; dropped: for which the disk was too slow; waiting: bytes in
    the queue to it.
    """

    failure: str
    path: str
    messages: int
    topics: int
    lost: int
    dropped: int
    waiting: int


class RecorderDiagnostics:
    """One publisher of the node; `publish` once a second."""

    def __init__(self, node: Node) -> None:
        self._name = node.get_name()
        self._diagnostics = Diagnostics(node)

    def publish(self, state: State) -> None:
        """One status."""
        level = ERROR if state.failure else WARN if state.lost or state.dropped else OK
        sentence = state.failure or ("recording" if state.path else "idle")
        values = {name: value for name, value in asdict(state).items() if name != "failure"}
        self._diagnostics.publish([Condition(self._name, level, sentence, values)])
