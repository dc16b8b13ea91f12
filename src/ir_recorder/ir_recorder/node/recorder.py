"""The recorder node `ir_recorder`: all topics of a cell into one MCAP, by service or command.

Control never waits for the recorder: it only subscribes, and a storage that fails ends the
recording, not the node.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from rclpy.node import Node

from ir_msgs.srv import StartRecording, StopRecording
from ir_msgs_py import names
from ir_msgs_py.ros.diagnostics import ERROR, OK, WARN, Condition, Diagnostics
from ir_msgs_py.ros.node_process import own_words, run_node
from ir_msgs_py.ros.parameters import Parameters
from ir_msgs_py.ros.serving import BoundedService, answered
from ir_msgs_py.status import Status, StatusCode
from ir_recorder.arguments import record_parser, roots_of
from ir_recorder.errors import (
    LostFileError,
    RecorderError,
    SchemaError,
    WriteError,
)
from ir_recorder.format import contents
from ir_recorder.format.contents import Split
from ir_recorder.format.qos import QosOffer
from ir_recorder.format.schemas import SchemaLibrary
from ir_recorder.node.node_queries import CellRequest, ParameterRequests
from ir_recorder.node.subscriptions import TopicListener, is_own
from ir_recorder.recording.cell_files import CellFiles, files_of_cell
from ir_recorder.recording.cell_topics import TopicSelection, checked_topics, single_type
from ir_recorder.recording.session import RecordingSession
from ir_recorder.recording.settings import RecorderSettings
from ir_recorder.recording.split_files import check_free, continued_path
from ir_recorder.recording.worker import Act, Message, RecordingWorker
from ir_recorder.recording.writer import OpenWriter, RecordingSummary, RecordingWriter, open_writer
from ir_values.errors import InvalidValueError, IrError, one_line
from ir_values.files import FileRoots

# Answers to ~/start and ~/stop: a refusal is a status, and no request ends the node.


class StartAndStop(Protocol):
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
        """Why the last recording ended on its own or lost its file, "" when it didn't."""


class RecorderServices:
    """Offers start and stop on `node` for `recorder`."""

    def __init__(self, node: Node, recorder: StartAndStop) -> None:
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
            lost = self._recorder.failure
            summary = self._recorder.finish()
            if summary is None:
                raise RecorderError(self._recorder.failure or "nothing is being recorded")
            response.path = str(summary.path)
            response.paths = [str(path) for path in summary.paths]
            response.messages = summary.messages
            response.seconds = summary.seconds
            response.dropped = summary.dropped + summary.lost
            held = f"{summary.messages} messages over {summary.seconds:.1f} s"
            if summary.dropped:
                held += f", {summary.dropped} dropped: the disk was too slow"
            if summary.lost:
                held += f", {summary.lost} lost: they never arrived, as where a node was suspended"
            if summary.blocked:
                held += f"; not split: {summary.blocked}"
            held += without_publisher(unmet, "was seen")
            if lost:
                raise LostFileError(f"{lost}: {held}")
            return held

        return self._answer(response, stop)

    def _answer(self, response: Any, work: Callable[[], str]) -> Any:
        return answered(response, self._source, lambda: Status.success(work()), _known, self._log)


def _known(error: Exception) -> Status | None:
    if isinstance(error, (RecorderError, IrError)):
        return Status(StatusCode.FAILURE, str(error))
    return None


def without_publisher(topics: Sequence[str], when: str) -> str:
    """The end of a sentence: the wanted topics without a publisher."""
    return f"; no publisher {when} of {', '.join(topics)}" if topics else ""


# Publishes the state of the recorder: an error ends a recording, lost messages are a warning.


@dataclass(frozen=True)
class State:
    """failure: why the last recording ended on its own; path: of the running one, "" for none;
    blocked: why its next file can't be begun, "" where it can; lost: messages that never arrived;
    dropped: for which the disk was too slow; waiting: bytes in the queue to it.
    """

    failure: str
    path: str
    blocked: str
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
        doubtful = state.lost or state.dropped or state.blocked
        level = ERROR if state.failure else WARN if doubtful else OK
        sentence = state.failure or state.blocked or ("recording" if state.path else "idle")
        values = {name: value for name, value in asdict(state).items() if name != "failure"}
        self._diagnostics.publish([Condition(self._name, level, sentence, values)])


# ROS parameters of the recorder node.


def declared_settings(node: Node) -> RecorderSettings:
    """Declares a parameter per setting, fixed at the start, and returns their values;
    InvalidValueError for a bad one.
    """
    return Parameters(node, RecorderSettings).value


# The recorder node `ir_recorder`: all topics of the cell into one MCAP, started and stopped by
# service or by `ir-record`.
#
# Control never waits for the recorder: it only subscribes, and a storage that fails ends the
# recording, not the node.

COMMAND_NODE = "ir_record"  # beside the cell's own recorder
POLL_PERIOD = 0.02  # s: 10 joint states at a time; waking for each takes a third of a core


@dataclass(frozen=True)
class _Asked:
    """What a recording was started with, for another file of it."""

    overwrite: bool
    topics: tuple[str, ...]
    files: tuple[CellFiles, ...]
    roots: FileRoots
    split: Split | None


class RecorderNode(Node):
    """Records while a session is open; looks for new topics several times a second."""

    def __init__(
        self,
        settings: RecorderSettings | None = None,
        writer: OpenWriter = open_writer,
        name: str = names.RECORDER,
        **options: Any,
    ) -> None:
        super().__init__(name, **options)
        self._settings = settings or declared_settings(self)
        self._open_writer = writer
        self._recording: RecordingWorker | None = None
        self._asked: _Asked | None = None
        self._schemas = SchemaLibrary()
        self._selection = TopicSelection()
        self._listener = TopicListener(self, self._settings.depth)
        self._passed_over: set[str] = set()
        self._failure = ""
        self._blocked = ""
        self._cell = CellRequest(self, self._attach)
        self._parameter_requests = ParameterRequests(
            self,
            lambda name, text: self._write(lambda session: session.attach(name, text, self._now())),
        )
        self._diagnostics = RecorderDiagnostics(self)
        if name == names.RECORDER:  # a command's own recording is no service of the cell
            self._requests = RecorderServices(self, self)
        self.create_timer(self._settings.discovery_period, self._discover)
        self.create_timer(POLL_PERIOD, self._collect)
        self.create_timer(1.0, self._each_second)
        if self._settings.path:
            self.start(self._settings.path, self._settings.overwrite, split=self._settings.split)

    @property
    def messages(self) -> int:
        """How many messages the running recording holds."""
        return self._recording.session.messages if self._recording is not None else 0

    @property
    def recording(self) -> bool:
        """Whether a recording is in progress."""
        return self._recording is not None

    @property
    def cell_attached(self) -> bool:
        """Whether the running recording holds the cell."""
        return self.attached(contents.CELL)

    def attached(self, name: str) -> bool:
        """Whether the running recording holds an attachment of that name."""
        return self._recording is not None and self._recording.session.holds(name)

    @property
    def unmet(self) -> tuple[str, ...]:
        """Wanted topics and patterns of the running recording without a publisher so far."""
        if self._recording is None:
            return ()
        return self._selection.unmet((*self._listener, *self._passed_over))

    @property
    def failure(self) -> str:
        """Why the last recording ended on its own, "" when it didn't."""
        return self._failure

    def start(
        self,
        path: str,
        overwrite: bool = False,
        topics: Sequence[str] = (),
        cell: str = "",
        roots: FileRoots | None = None,
        split: Split | None = None,
    ) -> str:
        """Opens a recording below `roots` (None: those of the settings) and returns its absolute
        path.

        RecorderError when it can't.
        """
        if self._recording is not None:
            raise RecorderError(
                f"already recording into {self._recording.session.path}; stop first"
            )
        wanted = checked_topics(topics) or self._settings.wanted_topics
        name = cell or self._settings.cell
        files = files_of_cell(name) if name else ()
        asked = _Asked(overwrite, wanted, files, roots or self._settings.file_roots, split)
        into = self._open(path, asked)
        self._failure = ""
        self._listener.lost = 0
        self._begin(asked)
        if self._failure:
            raise WriteError(self._failure)
        missing = without_publisher(self.unmet, "is seen yet")
        self.get_logger().info(one_line(f"recording into {into}{missing}"))
        return into

    def _begin(self, asked: _Asked) -> None:
        """Fills a recording that was opened."""
        self._asked = asked
        self._selection = TopicSelection(asked.topics, self.get_namespace())
        self._passed_over.clear()
        for files in asked.files:
            self._attach(files)
        self._cell.begin()
        self._parameter_requests.begin()
        self._discover()

    def _open(self, path: str, asked: _Asked) -> str:
        def open_file(path: str | Path) -> RecordingWriter:
            return self._open_writer(str(path), asked.overwrite, asked.roots)

        if asked.split is not None:
            check_free(path, asked.split, asked.overwrite)
        facts = self._settings.named_facts
        session = RecordingSession(open_file(path), facts, self._now(), asked.split, open_file)
        self._recording = RecordingWorker(session, self._settings.queue_megabytes * 1_000_000)
        return session.path

    def finish(self) -> RecordingSummary | None:
        """Ends the recording and returns its summary, or None when there was none."""
        self._collect()
        recording = self._recording
        self._recording = None
        self._listener.close()
        if recording is None:
            return None
        try:
            lost = self._listener.lost
            if lost:
                recording.do(lambda session: session.note_lost(lost))
            summary = replace(recording.finish(), lost=lost)
        except WriteError as error:
            self._failure = str(error)
            raise
        self.get_logger().info(
            f"{summary.path}: {summary.messages} messages over {summary.seconds:.1f} s, "
            f"{summary.lost} lost, {summary.dropped} dropped"
        )
        return summary

    def destroy_node(self) -> None:
        """End the recording, if there is one, then the node."""
        try:
            self.finish()
        finally:
            super().destroy_node()

    def _discover(self) -> None:
        """Subscribes to topics that are new and belong to the recording."""
        if self._recording is None:
            return
        for topic, types in self.get_topic_names_and_types():
            if (
                topic in self._listener
                or topic in self._passed_over
                or topic not in self._selection
            ):
                continue
            type_name = single_type(topic, types)
            offers = self._listener.offers(topic)
            if type_name is None:
                self._pass_over(topic, f"types {', '.join(types)} can't be recorded")
            elif offers:
                self._listen(topic, type_name, offers)

    def _listen(self, topic: str, type_name: str, offers: Sequence[QosOffer]) -> None:
        if self._recording is None:
            return
        try:
            self._schemas.schema(type_name)
            self._recording.do(lambda session: session.open_topic(topic, type_name, offers))
            self._listener.open(topic, type_name, offers)
        except SchemaError as error:
            self._pass_over(topic, str(error))
        except WriteError as error:
            self._abandon(error)

    def _collect(self) -> None:
        """Hands on what has arrived since the last time."""
        if self._recording is None:
            return
        own = self.get_namespace()
        everything = bool(self._selection.wanted)
        arrivals = self._listener.take()
        try:
            self._recording.write(
                Message(each.topic, each.data, each.time)
                for each in arrivals
                if everything or is_own(each, own)
            )
        except WriteError as error:
            self._abandon(error)

    def _each_second(self) -> None:
        self._ask()
        recording = self._recording
        blocked = recording.session.blocked if recording is not None else ""
        if blocked != self._blocked and blocked:
            self.get_logger().warning(blocked)
        self._blocked = blocked
        self._diagnostics.publish(
            State(
                self._failure,
                recording.session.path if recording is not None else "",
                blocked,
                self.messages,
                len(self._listener),
                self._listener.lost,
                recording.dropped if recording is not None else 0,
                recording.waiting if recording is not None else 0,
            )
        )

    def _ask(self) -> None:
        """Asks the planner for its cell and the nodes for their parameters, until they have
        answered.
        """
        if self._recording is None:
            return
        self._parameter_requests.each()
        if not (self.cell_attached or (self._asked and self._asked.files)):
            self._cell.each()

    def _attach(self, files: CellFiles) -> None:
        self._write(lambda session: session.attach_cell(files, self._now()))

    def _write(self, act: Act) -> None:
        """Acts on the running recording, if there is one; a storage that refuses ends it."""
        if self._recording is None:
            return
        try:
            self._recording.do(act)
        except WriteError as error:
            self._abandon(error)

    def _abandon(self, error: WriteError) -> None:
        """Ends the recording, and goes on in another file where its own was lost."""
        lost = self._recording
        sentence = str(error)
        self._recording = None
        self._listener.close()
        asked = self._asked
        if isinstance(error, LostFileError) and lost is not None and asked is not None:
            asked = replace(asked, overwrite=False)
            try:
                into = self._open(str(continued_path(Path(lost.session.path))), asked)
            except RecorderError as further:
                sentence += f"; no other file could be begun: {further}"
            else:
                sentence += f"; what follows is recorded into {into}"
        self._failure = sentence
        self.get_logger().error(sentence)
        if self._recording is not None and asked is not None:
            self._begin(asked)

    def _pass_over(self, topic: str, reason: str) -> None:
        self._passed_over.add(topic)
        self.get_logger().warning(one_line(f"{topic} isn't recorded: {reason}"))

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds)


def main(arguments: Sequence[str] | None = None) -> int:
    """`ir-record PATH [--overwrite] [--topics ...] [--cell NAME]`: records until SIGINT or
    SIGTERM.
    """
    everything = sys.argv[1:] if arguments is None else list(arguments)
    try:
        options = record_parser().parse_args(own_words("ir-record", everything))
    except InvalidValueError as error:
        sys.stderr.write(f"ir-record: {error}\n")
        return 1

    recorders: list[RecorderNode] = []

    def start() -> RecorderNode:
        name = COMMAND_NODE if options.path else names.RECORDER
        node = RecorderNode(name=name, namespace=options.namespace or None)
        recorders.append(node)
        try:
            if options.path:
                roots = roots_of(options.roots)
                split = Split(options.split_size, options.split_duration)
                node.start(
                    options.path, options.overwrite, options.topics, options.cell, roots, split
                )
        except BaseException:
            node.destroy_node()
            raise
        return node

    def fails() -> bool:
        return bool(options.path) and any(node.failure for node in recorders)

    def ended() -> bool:
        return fails() and not any(node.recording for node in recorders)

    refusals = (RecorderError, IrError)
    code = run_node(
        "ir-record", start, everything, refusals=refusals, goes_on=lambda node: not ended()
    )
    return 1 if fails() else code


if __name__ == "__main__":
    sys.exit(main())
