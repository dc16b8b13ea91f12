"""Settings of the recorder node: one field each with its default, unit and sentence."""

from __future__ import annotations

from dataclasses import dataclass

from ir_recorder.errors import RecorderError


@dataclass(frozen=True)
class RecorderSettings:
    """What the recorder node may be told.

    path: file to record into from the start, "" = wait for ~/start. overwrite: replace an existing file.
    topics: names or patterns, empty = all topics of the cell. cell: name or file of the cell to attach, ""
    = ask the planner. facts: "key=value" texts kept in the file and shown by the report. depth: messages
    kept per subscription while the disk is busy. discovery_period [s]: how often new topics are looked for.
    """

    path: str = ""
    overwrite: bool = False
    topics: tuple[str, ...] = ()
    cell: str = ""
    facts: tuple[str, ...] = ()
    depth: int = 2000
    discovery_period: float = 0.1

    def __post_init__(self) -> None:
        object.__setattr__(self, "topics", tuple(self.topics))
        object.__setattr__(self, "facts", tuple(self.facts))
        if not 1 <= self.depth <= 100_000:
            raise RecorderError(f"depth is {self.depth}, must be 1 to 100000 messages")
        if not 0.01 <= self.discovery_period <= 60.0:
            raise RecorderError(f"discovery_period is {self.discovery_period:g} s, must be 0.01 to 60 s")
        for fact in self.facts:
            if "=" not in fact or "\0" in fact:
                raise RecorderError(f"fact {fact[:80]!r} is not of the form key=value")

    @property
    def named_facts(self) -> dict[str, str]:
        """The facts by key."""
        pairs = (fact.partition("=") for fact in self.facts)
        return {key.strip(): value.strip() for key, _, value in pairs}
