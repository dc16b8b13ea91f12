"""One recording in progress: channels by topic, what is attached, and what became of it. No ROS here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

from ir_recorder.format import contents
from ir_recorder.format.qos import QosOffer
from ir_recorder.write.data_files import data_of_cell
from ir_recorder.write.writer import RecordingSummary, RecordingWriter

# those whose numbers a recording holds, and whose versions decide them
PACKAGES = (
    *("ir_planner", "ir_sim_driver", "ir_program_runner", "ir_kernels", "ir_description", "ir_msgs_py"),
    *("ir_msgs", "numpy", "scipy", "pybullet", "rclpy"),
)


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
        self._attached: set[str] = set()
        own = {
            contents.VERSION: installed_version("ir_recorder"),
            contents.STARTED: str(time),
            contents.PACKAGES: ", ".join(f"{name} {installed_version(name)}" for name in PACKAGES),
        }
        writer.facts(contents.FACTS, {**own, **facts})

    @property
    def path(self) -> str:
        """Where the file grows."""
        return str(self._writer.path)

    @property
    def messages(self) -> int:
        """How many messages were written."""
        return self._writer.messages

    def holds(self, name: str) -> bool:
        """Whether an attachment of that name is in."""
        return name in self._attached

    def open_topic(self, topic: str, type_name: str, offers: Sequence[QosOffer]) -> None:
        """Opens the channel of a topic; SchemaError when its type isn't installed."""
        if topic not in self._channels:
            self._channels[topic] = self._writer.register(topic, type_name, offers)

    def message(self, topic: str, data: bytes, time: int) -> None:
        """Appends a message of an open topic, received at `time` [ns]."""
        self._writer.write(self._channels[topic], time, data)

    def attach_cell(self, files: CellFiles, time: int) -> None:
        """Puts cell, URDF and the data of robot and controller beside the messages, once."""
        if self.holds(contents.CELL):
            return
        self.attach(contents.CELL, files.cell_yaml, time)
        if files.urdf:
            self.attach(contents.URDF, files.urdf, time)
        for name, text in data_of_cell(files.cell_yaml).items():
            self.attach(name, text, time)

    def attach(self, name: str, text: str, time: int) -> None:
        """Puts a text beside the messages; the first of a name stays."""
        if name not in self._attached:
            media = "application/xml" if name == contents.URDF else "application/yaml"
            self._writer.attach(name, media, text.encode(), time)
            self._attached.add(name)

    def flush(self) -> None:
        """Leaves no message in memory."""
        self._writer.flush()

    def finish(self) -> RecordingSummary:
        """Closes the file with its indexes."""
        return self._writer.finish()


def installed_version(package: str) -> str:
    """The version of a package, "unknown" where it isn't installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
