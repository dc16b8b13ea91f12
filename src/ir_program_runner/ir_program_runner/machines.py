"""The cell's machines as a soft PLC: levels of signals, answers that follow a signal after a delay,
and machines that work on a part.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

import numpy as np

from ir_description import Cell
from ir_description.cell import ProcessTimes, begin_of_work
from ir_msgs_py.plc import Signal
from ir_values.errors import InvalidValueError

MOST_SIGNALS = 10_000  # a cell has tens; who invents names must not fill the memory


class MachineSignal(Protocol):
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

    @property
    def process(self) -> str:
        """Machine whose process it reports, or empty."""


class MachineTime:
    """Time of the simulated machines [s]: it passes as in the plant while that is heard, which a
    busy computer delays, else as on the node's clock.

    plant: its time [s], None where it is not heard; node: a steady clock [s].
    """

    def __init__(self, plant: Callable[[], float | None], node: Callable[[], float]) -> None:
        self._plant = plant
        self._node = node
        self._last = (plant(), node())
        self._passed = 0.0

    def __call__(self) -> float:
        """Seconds since it was made; it never goes back."""
        plant = self._plant()
        node = self._node()
        plant_before, node_before = self._last
        passed = node - node_before
        if plant is not None and plant_before is not None:
            passed = plant - plant_before
        self._passed += max(passed, 0.0)
        self._last = (plant, node)
        return self._passed


class Machines:
    """Levels of all signals; one that was never set is 0.

    times: how long each machine with a process works on a part, by name; where that varies it is
    drawn, for every machine in a row of its own that the seed decides. capacities: on how many
    parts each of them works at once, 1 where none is given; more wait, first in, first out. Each
    place of such a machine has signals of its own.
    """

    def __init__(
        self,
        signals: Iterable[MachineSignal] = (),
        times: Mapping[str, ProcessTimes] | None = None,
        seed: int = 0,
        capacities: Mapping[str, int] | None = None,
    ) -> None:
        self._signals = tuple(signals)
        self._times = times or {}
        self._capacities = capacities or {}
        self._draws = {name: np.random.default_rng([seed, *name.encode()]) for name in self._times}
        self._levels = {signal.name: signal.initial for signal in self._signals}
        self._due: list[tuple[float, Signal]] = []

    @staticmethod
    def of(cell: Cell, seed: int = 0) -> Machines:
        """The machines of a cell."""
        times = {
            machine.name: machine.process_times or ProcessTimes(machine.process, machine.process)
            for machine in cell.equipment
            if machine.process > 0.0
        }
        capacities = {machine.name: machine.capacity for machine in cell.equipment}
        return Machines(cell.signals, times, seed, capacities)

    def set(self, signal: Signal, now: float) -> None:
        """Take a level; machines that follow it will answer later. now: a steady clock [s]."""
        changed = self._levels.get(signal.name) != signal.value
        self._levels[signal.name] = signal.value
        for each in self._signals:
            if each.follows != signal.name or (each.process and not (changed or signal.value)):
                continue
            self._due = [(when, answer) for when, answer in self._due if answer.name != each.name]
            if not each.process:
                self._due.append((now + each.delay, Signal(each.name, signal.value)))
                continue
            if self._levels[each.name]:
                self._levels[each.name] = False
                self._due.append((now, Signal(each.name, False)))
            if signal.value:
                capacity = self._capacities.get(each.process, 1)
                begin = begin_of_work(now, self._ends(each.process), capacity)
                seconds = self._times[each.process].drawn(self._draws[each.process])
                self._due.append((begin + seconds, Signal(each.name, True)))

    def _ends(self, machine: str) -> list[float]:
        """When a machine will have finished the parts that it has."""
        names = {each.name for each in self._signals if each.process == machine}
        return [when for when, answer in self._due if answer.name in names and answer.value]

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

    @property
    def next_answer(self) -> float:
        """When the next machine answers; inf where none will."""
        return min((when for when, _ in self._due), default=float("inf"))

    def take_answers(self, now: float) -> tuple[Signal, ...]:
        """Answers of the machines that are due, in their order; each is given once."""
        due = sorted((entry for entry in self._due if entry[0] <= now), key=lambda entry: entry[0])
        self._due = [entry for entry in self._due if entry[0] > now]
        return tuple(signal for _, signal in due)
