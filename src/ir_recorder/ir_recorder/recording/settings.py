"""Settings of the recorder node; its ROS parameters derive from them."""

from __future__ import annotations

from dataclasses import dataclass

from ir_recorder.errors import RecorderError
from ir_recorder.format.contents import Split
from ir_values.files import FileRoots
from ir_values.settings import check_settings, setting


@dataclass(frozen=True)
class RecorderSettings:
    """Settings of the recorder node. An empty text in a list counts as nothing: ROS has no empty
    lists.
    """

    path: str = setting(
        "", "File to record into from the start; empty: wait for ~/start.", read_only=True
    )
    overwrite: bool = setting(False, "Replace an existing file.", read_only=True)
    topics: tuple[str, ...] = setting(
        ("",), "Names or patterns of topics; empty: all topics of the cell.", read_only=True
    )
    roots: tuple[str, ...] = setting(
        ("",),
        "Folders below which recordings may be written; empty: IR_FILE_ROOTS, else the working "
        "folder.",
        read_only=True,
    )
    cell: str = setting(
        "", "Name or file of the cell to attach; empty: ask the planner.", read_only=True
    )
    facts: tuple[str, ...] = setting(
        ("",), "Texts key=value, kept in the file and shown by the report.", read_only=True
    )
    split_size: int = setting(
        0,
        "Of the recording into path: size after which a further file begins; 0: one file.",
        unit="bytes",
        minimum=0,
        maximum=2**62,
        read_only=True,
    )
    split_duration: float = setting(
        0.0,
        "Of the recording into path: duration after which a further file begins; 0: one file.",
        unit="s",
        minimum=0.0,
        maximum=31_536_000.0,
        read_only=True,
    )
    queue_megabytes: int = setting(
        64,
        "Messages that may wait for a slow disk; what comes beyond is dropped and counted.",
        unit="MB",
        minimum=1,
        maximum=10_000,
        read_only=True,
    )
    depth: int = setting(
        2000,
        "Messages kept per topic between two looks.",
        minimum=1,
        maximum=100_000,
        read_only=True,
    )
    discovery_period: float = setting(
        0.1,
        "Time between two looks for new topics.",
        unit="s",
        minimum=0.01,
        maximum=60.0,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)
        _ = self.split
        for fact in self.facts:
            if fact and ("=" not in fact or "\0" in fact):
                raise RecorderError(f"fact {fact[:80]!r} is not of the form key=value")

    @property
    def split(self) -> Split:
        """When a further file begins."""
        return Split(self.split_size, self.split_duration)

    @property
    def wanted_topics(self) -> tuple[str, ...]:
        """The names and patterns, empty for all topics of the cell."""
        return tuple(topic for topic in self.topics if topic)

    @property
    def file_roots(self) -> FileRoots:
        """The folders below which recordings may be written."""
        return FileRoots.of(self.roots)

    @property
    def named_facts(self) -> dict[str, str]:
        """The facts by key."""
        pairs = (fact.partition("=") for fact in self.facts if fact)
        return {key.strip(): value.strip() for key, _, value in pairs}
