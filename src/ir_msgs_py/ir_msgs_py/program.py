"""Where a program is: one event whenever a movement or a pause starts or ends."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from ir_msgs_py.checks import one_of, set_field
from ir_msgs_py.errors import InvalidValueError
from ir_msgs_py.report import PlannedMovement


class Event(StrEnum):
    """What happened to a movement or a pause."""

    STARTED = "started"
    ENDED = "ended"
    FAILED = "failed"
    CANCELED = "canceled"


@dataclass(frozen=True, eq=False, kw_only=True)
class ProgramState:
    """An event of movement `index` (0-based) of `total`; stamp_ns: node clock [ns]."""

    stamp_ns: int
    program_id: str
    index: int
    total: int
    event: str
    movement: PlannedMovement
    note: str = ""

    def __post_init__(self) -> None:
        set_field(self, "event", Event(one_of(self.event, list(Event), "event of a program")))
        if not 0 <= self.index < self.total:
            raise InvalidValueError(
                f"index of the movement is {self.index}: it must be in 0 .. {self.total - 1}"
            )
