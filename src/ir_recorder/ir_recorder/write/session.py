"""One recording in progress: channels by topic, what is attached, and what became of it. No ROS here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

from ir_recorder.format import contents
from ir_recorder.format.qos import QosOffer
from ir_recorder.write.writer import RecordingSummary, RecordingWriter


@dataclass(frozen=True)
class CellFiles:
    """The cell in its own file format, and the robot's URDF."""

    cell_yaml: str
    urdf: str


class RecordingSession:
    """Feeds a writer; every method may raise WriteError, after which the session is over."""

    def __init__(self, writer: RecordingWriter, facts: Mapping[str, str], time: int) -> None:
        self._writer = writer
        self._channels: dict[str, int] = {}
        self._attached = False
        own = {contents.VERSION: project_version(), contents.STARTED: str(time)}
        writer.facts(contents.FACTS, {**own, **facts})

    @property
    def path(self) -> str:
        """Where the file grows."""
        return str(self._writer.path)

    @property
    def messages(self) -> int:
        """How many messages were written."""
        return self._writer.messages

    @property
    def cell_attached(self) -> bool:
        """Whether the cell's files are in."""
        return self._attached

    def open_topic(self, topic: str, type_name: str, offers: Sequence[QosOffer]) -> None:
        """Opens the channel of a topic; SchemaError when its type isn't installed."""
        if topic not in self._channels:
            self._channels[topic] = self._writer.register(topic, type_name, offers)

    def message(self, topic: str, data: bytes, time: int) -> None:
        """Appends a message of an open topic, received at `time` [ns]."""
        self._writer.write(self._channels[topic], time, data)

    def attach_cell(self, files: CellFiles, time: int) -> None:
        """Puts cell and URDF beside the messages, once."""
        if not self._attached:
            self._writer.attach(contents.CELL, "application/yaml", files.cell_yaml.encode(), time)
            if files.urdf:
                self._writer.attach(contents.URDF, "application/xml", files.urdf.encode(), time)
            self._attached = True

    def finish(self) -> RecordingSummary:
        """Closes the file with its indexes."""
        return self._writer.finish()


def project_version() -> str:
    """The version that is installed."""
    try:
        return version("ir_recorder")
    except PackageNotFoundError:
        return "unknown"
