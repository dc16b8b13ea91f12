"""Recording in progress: channels by topic, what is attached, and what became of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from ir_recorder.errors import LostFileError, RecorderError, WriteError
from ir_recorder.format import contents
from ir_recorder.format.contents import Split, part_facts, part_path
from ir_recorder.format.qos import QosOffer
from ir_recorder.recording.arithmetic import arithmetic
from ir_recorder.recording.cell_files import CellFiles, data_of_cell
from ir_recorder.recording.split_files import LatchedMessages
from ir_recorder.recording.writer import RecordingSummary, RecordingWriter
from ir_values.extensions import installed_extensions

# those whose numbers a recording holds, and whose versions decide them
PACKAGES = (
    *(
        "ir_planner",
        "ir_sim_driver",
        "ir_program_runner",
        "ir_kernels",
        "ir_description",
        "ir_msgs_py",
    ),
    *("ir_msgs", "numpy", "scipy", "pybullet", "rclpy"),
)

_TRIED_AGAIN = 1_000_000_000  # ns until a next file that can't be begun is tried again


class RecordingSession:
    """Feeds a writer, and the next one where `split` says so (`open_next` opens it).

    Every method may raise WriteError, after which the session is over. blocked: why the next file
    can't be begun, so that this one goes on and it is tried again each second; "" where it can.
    """

    def __init__(
        self,
        writer: RecordingWriter,
        facts: Mapping[str, str],
        time: int,
        split: Split | None = None,
        open_next: Callable[[Path], RecordingWriter] = RecordingWriter,
    ) -> None:
        self._writer = writer
        self._open_next = open_next
        self._split = split or Split()
        self._latched = LatchedMessages()
        self._first = writer.path
        self._part = 0
        self.blocked = ""
        self._next_try = 0
        self._begun = time
        self._name = f"{writer.path.stem} {time}"
        self._topics: dict[str, tuple[str, Sequence[QosOffer]]] = {}
        self._channels: dict[str, int] = {}
        self._attached: dict[str, tuple[str, bytes]] = {}
        self._messages = 0
        self._span = (0, 0)
        own = {
            contents.VERSION: installed_version("ir_recorder"),
            contents.STARTED: str(time),
            contents.PACKAGES: ", ".join(
                (
                    *(f"{name} {installed_version(name)}" for name in PACKAGES),
                    *installed_extensions(),
                )
            ),
            contents.ARITHMETIC: arithmetic(),
        }
        self._facts = {**own, **facts}
        self._head()

    @property
    def path(self) -> str:
        """Where the first file grows."""
        return str(self._first)

    @property
    def messages(self) -> int:
        """How many messages were written, those that further files repeat not counted."""
        return self._messages

    def holds(self, name: str) -> bool:
        """Whether an attachment of that name is in."""
        return name in self._attached

    def open_topic(self, topic: str, type_name: str, offers: Sequence[QosOffer]) -> None:
        """Opens the channel of a topic; SchemaError when its type isn't installed."""
        if topic not in self._channels:
            self._channels[topic] = self._writer.register(topic, type_name, offers)
            self._topics[topic] = type_name, offers
            self._latched.open(topic, offers)

    def message(self, topic: str, data: bytes, time: int) -> None:
        """Appends a message of an open topic, received at `time` [ns]."""
        if self._split.wanted and time >= self._next_try and self._is_due(time):
            self._next_file(time)
        self._writer.write(self._channels[topic], time, data)
        self._latched.keep(topic, data)
        first, last = self._span if self._messages else (time, time)
        self._span = min(first, time), max(last, time)
        self._messages += 1

    def _is_due(self, time: int) -> bool:
        """Whether the file is long enough at `time` [ns]."""
        return self._split.due(self._writer.size, (time - self._begun) * 1e-9)

    def attach_cell(self, files: CellFiles, time: int) -> None:
        """Puts cell, URDF and the data of robot and controller beside the messages, once."""
        texts = {contents.CELL: files.cell_yaml, contents.URDF: files.urdf}
        if self.holds(contents.attached(files.namespace, contents.CELL)):
            return
        for name, text in (texts | data_of_cell(files.cell_yaml)).items():
            if text:
                self.attach(contents.attached(files.namespace, name), text, time)

    def attach(self, name: str, text: str, time: int) -> None:
        """Puts a text beside the messages; the first of a name stays."""
        if name not in self._attached:
            xml = name.endswith(contents.URDF)
            media = "application/xml" if xml else "application/yaml"
            self._attached[name] = media, text.encode()
            self._writer.attach(name, media, text.encode(), time)

    def flush(self) -> None:
        """Leaves no message in memory."""
        self._writer.flush()

    def note_lost(self, count: int) -> None:
        """Say beside the messages how many never arrived."""
        self._writer.facts(contents.LOST, {contents.MESSAGES_LOST: str(count)})

    def finish(self) -> RecordingSummary:
        """Closes the file with its indexes."""
        self._writer.finish()
        paths = tuple(part_path(self._first, part) for part in range(self._part + 1))
        lost = [path.name for path in paths if not path.exists()]
        if lost:
            raise LostFileError(f"{self._first}: {', '.join(lost)} of it is gone")
        first, last = self._span
        seconds = (last - first) * 1e-9
        return RecordingSummary(self._first, self._messages, seconds, paths, blocked=self.blocked)

    def _head(self) -> None:
        """What every file begins with."""
        self._writer.facts(contents.FACTS, self._facts)
        if self._split.wanted:
            record = part_facts(self._name, self._part, self._latched.counts())
            self._writer.facts(contents.PARTS, record)

    def _next_file(self, time: int) -> None:
        """Ends the file and begins another that can be read alone, where one can be opened."""
        try:
            following = self._open_next(part_path(self._first, self._part + 1))
        except RecorderError as error:
            self.blocked = f"{error}; {self._writer.path.name} goes on"
            self._next_try = time + _TRIED_AGAIN
            return
        try:
            self._writer.finish()
        except WriteError:
            following.discard()
            raise
        self.blocked = ""
        self._part = self._part + 1
        self._begun = time
        self._writer = following
        self._head()
        for name, (media, data) in self._attached.items():
            self._writer.attach(name, media, data, time)
        for topic, (type_name, offers) in self._topics.items():
            self._channels[topic] = self._writer.register(topic, type_name, offers)
        for topic, data in self._latched.all():
            self._writer.write(self._channels[topic], time, data)


def installed_version(package: str) -> str:
    """The version of a package, "unknown" where it isn't installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
