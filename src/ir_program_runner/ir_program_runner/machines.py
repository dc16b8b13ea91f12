"""The cell's machines as a soft PLC: levels of signals, and answers that follow a signal after a
delay.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from ir_msgs_py.plc import Signal
from ir_values.errors import InvalidValueError

MOST_SIGNALS = 10_000  # a cell has tens; who invents names must not fill the memory


class CellSignal(Protocol):
    """A signal as a cell describes it; `follows` names the signal that it follows, or is empty."""

    @property
    def name(self) -> str:
        """Name."""

    @property
    def initial(self) -> bool:
        """Level at the start."""

    @property
    def follows(self) -> str:
        """Signal whose level it takes."""

    @property
    def delay(self) -> float:
        """Seconds after that signal was set."""


class Machines:
    """Levels of all signals; one that was never set is 0."""

    def __init__(self, signals: Iterable[CellSignal] = ()) -> None:
        self._signals = tuple(signals)
        self._levels = {signal.name: signal.initial for signal in self._signals}
        self._due: list[tuple[float, Signal]] = []

    def set(self, signal: Signal, now: float) -> None:
        """Take a level; machines that follow it will answer later. now: a steady clock [s]."""
        self._levels[signal.name] = signal.value
        for each in self._signals:
            if each.follows == signal.name:
                self._due = [
                    (when, answer) for when, answer in self._due if answer.name != each.name
                ]
                self._due.append((now + each.delay, Signal(each.name, signal.value)))

    def hear(self, signal: Signal, now: float) -> None:
        """Take a level from outside. Raises InvalidValueError for a new name when there are
        MOST_SIGNALS.
        """
        if signal.name not in self._levels and len(self._levels) >= MOST_SIGNALS:
            raise InvalidValueError(
                f"there are {MOST_SIGNALS} signals already: {signal.name} is one too many"
            )
        self.set(signal, now)

    def holds(self, signals: Iterable[Signal]) -> bool:
        """Whether all signals have these levels."""
        return all(self._levels.get(signal.name, False) == signal.value for signal in signals)

    def take_answers(self, now: float) -> tuple[Signal, ...]:
        """Answers of the machines that are due, in their order; each is given once."""
        due = sorted((entry for entry in self._due if entry[0] <= now), key=lambda entry: entry[0])
        self._due = [entry for entry in self._due if entry[0] > now]
        return tuple(signal for _, signal in due)
