"""What was assumed while a program was followed, and what it could change."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum

from ir_krl.errors import SourcePlace


class Effect(IntEnum):
    """What an assumption could change, the worst last."""

    NONE = 0
    TIMES = 1
    SPEEDS = 2
    PLACES = 3
    MOTIONS = 4


_COULD_CHANGE = {
    Effect.NONE: "",
    Effect.TIMES: "how long it takes",
    Effect.SPEEDS: "how fast it goes and where it rounds corners",
    Effect.PLACES: "where the robot goes",
    Effect.MOTIONS: "which motions are driven",
}


@dataclass(frozen=True)
class Note:
    """Something a reader should know: what was assumed, or what isn't modelled, and its effect;
    places: in how many of the program, of which `place` is the first.
    """

    place: SourcePlace
    text: str
    effect: Effect = Effect.NONE
    places: int = 1

    def __str__(self) -> str:
        said = f"{self.place}: {self.text}" if str(self.place) else self.text
        said += f", at {self.places} places" if self.places > 1 else ""
        change = _COULD_CHANGE[self.effect]
        return f"{said} (could change {change})" if change else said


def worst_first(notes: Iterable[Note]) -> tuple[Note, ...]:
    """In the order of their effects, as they came where that is the same."""
    return tuple(sorted(notes, key=lambda note: -note.effect))
