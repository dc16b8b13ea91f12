"""Publishes what the runner does: a driver that is not heard, or a program that failed, is a
warning.
"""

from __future__ import annotations

from rclpy.node import Node

from ir_msgs_py.modes import Mode
from ir_msgs_py.ros.diagnostics import OK, WARN, Condition, Diagnostics
from ir_msgs_py.status import Status
from ir_program_runner.progress import Progress


class RunnerDiagnostics:
    """One publisher of the node; `publish` once a second."""

    def __init__(self, node: Node) -> None:
        self._name = node.get_name()
        self._diagnostics = Diagnostics(node)

    def publish(
        self, progress: Progress | None, driver: Status, mode: Mode | None, last: Status
    ) -> None:
        """`progress`: of the running program, None for none; `last`: how the one before ended."""
        level = OK
        sentence = "ready"
        values: dict[str, object] = {
            "driver": str(driver),
            "mode": "not known" if mode is None else mode.name,
        }
        if progress is not None:
            sentence = f"step {progress.index + 1} of {progress.total}: {progress.phase}"
            values["program"] = progress.program_id
        elif not last.ok:
            level = WARN
            sentence = f"the last program did not end well: {last}"
        if not driver.ok:
            level = WARN
            sentence = f"{sentence}; {driver.message}"
        self._diagnostics.publish([Condition(self._name, level, sentence, values)])
