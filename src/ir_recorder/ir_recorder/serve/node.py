"""Answers to ~/start and ~/stop: a refusal is a status, and no request ends the node."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from rclpy.node import Node

from ir_msgs.srv import StartRecording, StopRecording
from ir_msgs_py.errors import MsgsError
from ir_msgs_py.ros.serving import BoundedService, answered
from ir_msgs_py.status import Status, StatusCode
from ir_recorder.errors import NothingRecordedError, RecorderError
from ir_recorder.format.parts import Split
from ir_recorder.write.writer import RecordingSummary


class Recorder(Protocol):
    """What the services ask for."""

    def start(self, path: str, overwrite: bool, topics: Sequence[str], *, split: Split) -> str:
        """Begin a recording and return its path."""

    def finish(self) -> RecordingSummary | None:
        """End the recording; its summary, None when there was none."""

    @property
    def unmet(self) -> tuple[str, ...]:
        """Wanted topics without a publisher so far."""

    @property
    def failure(self) -> str:
        """Why the last recording ended on its own, "" when it didn't."""


class Services:
    """Offers start and stop on `node` for `recorder`."""

    def __init__(self, node: Node, recorder: Recorder) -> None:
        self._recorder = recorder
        self._source = node.get_name()
        self._log = node.get_logger().error
        BoundedService(node, StartRecording, "~/start", self._on_start)
        BoundedService(node, StopRecording, "~/stop", self._on_stop)

    def _on_start(self, request: Any, response: Any) -> Any:
        def start() -> str:
            split = Split(request.split_size, request.split_duration)
            start = self._recorder.start
            response.path = start(request.path, request.overwrite, request.topics, split=split)
            return (
                "recording into "
                f"{response.path}{without_publisher(self._recorder.unmet, 'is seen yet')}"
            )

        return self._answer(response, start)

    def _on_stop(self, request: Any, response: Any) -> Any:
        def stop() -> str:
            unmet = self._recorder.unmet
            summary = self._recorder.finish()
            if summary is None:
                raise NothingRecordedError(self._recorder.failure or "nothing is being recorded")
            response.path = str(summary.path)
            response.paths = [str(path) for path in summary.paths]
            response.messages = summary.messages
            response.seconds = summary.seconds
            response.dropped = summary.dropped
            seconds = f"{summary.messages} messages over {summary.seconds:.1f} s"
            if summary.dropped:
                seconds += f", {summary.dropped} dropped: the disk was too slow"
            return f"{seconds}{without_publisher(unmet, 'was seen')}"

        return self._answer(response, stop)

    def _answer(self, response: Any, work: Callable[[], str]) -> Any:
        return answered(response, self._source, lambda: Status.success(work()), _known, self._log)


def _known(error: Exception) -> Status | None:
    if isinstance(error, (RecorderError, MsgsError)):
        return Status(StatusCode.FAILURE, str(error))
    return None


def without_publisher(topics: Sequence[str], when: str) -> str:
    """The end of a sentence: the wanted topics without a publisher."""
    return f"; no publisher {when} of {', '.join(topics)}" if topics else ""
