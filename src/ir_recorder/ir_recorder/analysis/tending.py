"""A robot that tends machines, part by part: energy, time and waits, planned beside driven; who
waited for whom, and when each machine worked.

It reads the steps of a run and the signals of the machines, recorded or simulated.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ir_description import Cell
from ir_description.cell import CellSignal, begin_of_work
from ir_msgs_py.plc import Signal
from ir_msgs_py.report import PlannedMovement

SHORT = 0.05  # s: what nodes take to answer isn't a wait for a machine


@dataclass(frozen=True, eq=False)
class TendedStep:
    """A step as it was driven. begin: when its turn came; start: when its signals were there; end
    [s]. waiting [J] at the mains before the start; joules: from start to end.
    """

    movement: PlannedMovement
    begin: float
    start: float
    end: float
    waiting: float
    joules: float


@dataclass(frozen=True)
class SignalChange:
    """A signal that took a level at a time [s]."""

    time: float
    name: str
    value: bool


@dataclass(frozen=True)
class Span:
    """From begin to end [s]."""

    begin: float
    end: float

    @property
    def seconds(self) -> float:
        """How long [s]."""
        return self.end - self.begin

    def within(self, begin: float, end: float) -> float:
        """Seconds of it that lie between two times."""
        return max(0.0, min(self.end, end) - max(self.begin, begin))


@dataclass(frozen=True)
class MachineTimes:
    """When a machine worked on the parts in a slot, and when a finished part lay there until the
    robot took it. slot: from 1 on where the machine holds several parts, else 0.
    """

    name: str
    working: tuple[Span, ...]
    finished: tuple[Span, ...]
    slot: int = 0

    @property
    def label(self) -> str:
        """The machine, with the slot where it holds several."""
        return f"{self.name} {self.slot}" if self.slot else self.name


@dataclass(frozen=True)
class PartRow:
    """From the part before until part `number` was put down at the end of its route: joules at the
    mains, planned beside driven, and the waits in between [s] by machine: of the robot in planned
    pauses and for signals that came late, of finished parts for the robot.
    """

    number: int
    span: Span
    joules: float
    planned_seconds: float
    planned_joules: float
    paused: dict[str, float] = field(default_factory=dict)
    late: dict[str, float] = field(default_factory=dict)
    finished: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Tending:
    """parts: in the order in which they left; filling: how many rows at the begin fill the line, in
    which machines had no part; steps, machines: what was done when.
    """

    parts: tuple[PartRow, ...]
    filling: int
    machines: tuple[MachineTimes, ...]
    steps: tuple[TendedStep, ...]

    @property
    def steady(self) -> tuple[PartRow, ...]:
        """The parts after the line was filled."""
        return self.parts[self.filling :]


def tending_of(
    cell: Cell, steps: Sequence[TendedStep], signals: Sequence[SignalChange]
) -> Tending | None:
    """What was driven in a cell; None where it has no route, or no part left it."""
    if cell.route is None:
        return None
    last = cell.route.visits[-1]
    ends = [k for k, each in enumerate(steps) if each.movement.detach and _at(each) == last]
    if not ends:
        return None
    machines = _machines(cell, signals, steps[-1].end)
    starts = {signal.follows: signal.process for signal in cell.signals if signal.process}
    answers = {signal.name: signal.process for signal in cell.signals if signal.process}
    rows = []
    first = 0
    for number, place in enumerate(ends, 1):
        own = steps[first : place + 1]
        rows.append(_part_row(number, own, machines, starts, answers))
        first = place + 1
    return Tending(tuple(rows), _filling(rows, machines), machines, tuple(steps))


def _at(step: TendedStep) -> str:
    return step.movement.to_station


def _part_row(
    number: int,
    steps: Sequence[TendedStep],
    machines: Sequence[MachineTimes],
    starts: dict[str, str],
    answers: dict[str, str],
) -> PartRow:
    """What one part took, and who waited for whom."""
    span = Span(steps[0].begin, steps[-1].end)
    paused: dict[str, float] = {}
    late: dict[str, float] = {}
    for step in steps:
        movement = step.movement
        if movement.since in starts:
            name = starts[movement.since]
            paused[name] = paused.get(name, 0.0) + step.end - step.start
        names = [Signal.parse(text).name for text in movement.wait_for]
        for name in dict.fromkeys(answers[each] for each in names if each in answers):
            if step.start - step.begin > SHORT:
                late[name] = late.get(name, 0.0) + step.start - step.begin
    finished = dict.fromkeys((machine.name for machine in machines), 0.0)
    for machine in machines:
        finished[machine.name] += sum(
            each.within(span.begin, span.end) for each in machine.finished
        )
    return PartRow(
        number,
        span,
        sum(step.joules + step.waiting for step in steps),
        sum(step.movement.duration for step in steps),
        sum(step.movement.report.energy for step in steps),
        paused,
        late,
        {name: seconds for name, seconds in finished.items() if seconds > 0.0},
    )


def _machines(cell: Cell, signals: Iterable[SignalChange], end: float) -> tuple[MachineTimes, ...]:
    changes = sorted(signals, key=lambda change: change.time)
    result = []
    for name in dict.fromkeys(signal.process for signal in cell.signals if signal.process):
        reports = [signal for signal in cell.signals if signal.process == name]
        slots = [_slot(signal, changes, end) for signal in reports]
        every = [span for loaded, _ in slots for span in loaded]
        begun = _begun(every, cell.machine(name).capacity)
        for number, (loaded, finished) in enumerate(slots, 1):
            working = tuple(Span(begun[span], span.end) for span in loaded)
            slot = number if len(slots) > 1 else 0
            result.append(MachineTimes(name, working, tuple(finished), slot))
    return tuple(result)


def _slot(
    signal: CellSignal, changes: Iterable[SignalChange], end: float
) -> tuple[list[Span], list[Span]]:
    """From when a part was there until it was finished, and from then until it was taken."""
    begun = np.inf
    done = 0.0 if signal.initial else np.inf
    loaded = []
    finished = []
    for change in changes:
        if change.name == signal.follows and change.value:
            begun = change.time
        elif change.name == signal.name and change.value:
            if np.isfinite(begun):
                loaded.append(Span(begun, change.time))
            begun = np.inf
            done = change.time
        elif change.name == signal.follows and np.isfinite(done):
            finished.append(Span(done, change.time))
            done = np.inf
    if np.isfinite(begun):
        loaded.append(Span(begun, end))
    if np.isfinite(done):
        finished.append(Span(done, end))
    return loaded, finished


def _begun(loaded: Iterable[Span], capacity: int) -> dict[Span, float]:
    """When the work on each part in a machine began: when it was there, and the machine had
    finished one of the others.
    """
    begun = {}
    ends: list[float] = []
    for span in sorted(loaded, key=lambda each: each.begin):
        begun[span] = min(begin_of_work(span.begin, ends, capacity), span.end)
        ends.append(span.end)
    return begun


def _filling(rows: Sequence[PartRow], machines: Sequence[MachineTimes]) -> int:
    """Rows before the first in which no machine was still to get its first part."""
    begins = [machine.working[0].begin for machine in machines if machine.working]
    latest = max(begins, default=0.0)
    return sum(row.span.begin < latest for row in rows)


# A plan of a cycle that is repeated, which nobody drove.


def planned_machines(cell: Cell, steps: Sequence[PlannedMovement]) -> tuple[MachineTimes, ...]:
    """When the machines of a route that hold one part work in the cycle of a plan, and when it lies
    there finished: from where the robot puts one down until it takes one, the cycle repeated before
    and after.
    """
    if cell.route is None or not steps:
        return ()
    ends = np.cumsum([step.duration for step in steps])
    period = float(ends[-1])
    put: dict[str, list[float]] = {}
    taken: dict[str, list[float]] = {}
    for before, step, end in zip([steps[-1], *steps[:-1]], steps, ends.tolist(), strict=True):
        if step.to_station in cell.route.visits and _carries(before) != _carries(step):
            times, at = (taken, end - step.duration) if _carries(step) else (put, end)
            times.setdefault(cell.station(step.to_station).equipment, []).append(at)
    return tuple(
        _repeated(machine.name, machine.process, put[machine.name], taken[machine.name], period)
        for machine in cell.equipment
        if machine.process > 0.0 and machine.places == 1
        if machine.name in put and machine.name in taken
    )


def _carries(step: PlannedMovement) -> bool:
    """Whether the robot holds a part."""
    return "+" in step.load


def _repeated(
    name: str, process: float, put: Sequence[float], taken: Sequence[float], period: float
) -> MachineTimes:
    working = []
    finished = []
    for begin in put:
        done = begin + process
        later = [time + k * period for time in taken for k in range(_CYCLES)]
        until = min((time for time in later if time >= done - SHORT), default=done)
        for k in range(-_CYCLES, 1):
            shift = k * period
            working.append(Span(begin + shift, done + shift))
            if until > done:
                finished.append(Span(done + shift, until + shift))
    return MachineTimes(name, tuple(working), tuple(finished))


_CYCLES = 4  # of a part in a machine, at most
