"""A cycle as steps of a program: one cycle on its own, and the run that fills the line from empty
and then makes cycle after cycle.

Every wait is for a machine: it ends as long after that was started as planned. So a late machine
shifts what depends on it alone, and the first cycles, in which few machines have a part, need no
schedule of their own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from ir_description import Cell, ProgramStep
from ir_description.cell import PartRoute
from ir_planner.cycle import ModeWait, SteadyCycle, Visit
from ir_planner.flexible.tending_cell import (
    front_name,
    machines_of,
    pause_steps,
    route_of,
    start_of,
    transport,
)

AFTER = "after"
BEFORE = "before"
_SAME = 1e-3  # s: a part is taken as soon as it is finished

Where = tuple[str, int, int]
"""A wait: after or before which activity, and of which unit."""


@dataclass(frozen=True)
class Due:
    """A wait ends so many seconds after the machine at a place of the route was started."""

    place: int
    seconds: float


def occupied(cycle: SteadyCycle) -> tuple[int, ...]:
    """Places at whose machine a part lies when the cycle begins: it is taken before one is
    brought.
    """
    first: dict[int, bool] = {}
    for visit in cycle.visits:
        first.setdefault(visit.activity, True)
        first.setdefault(visit.activity + 1, False)
    return tuple(sorted(place for place, taken in first.items() if taken and place > 0))


def waits_for(cycle: SteadyCycle, process: Sequence[float]) -> dict[Where, Due]:
    """What each wait of the cycle is for: the next machine whose part is taken as soon as it is
    finished. A wait that is for none only fills the cycle.
    """
    visits = cycle.visits
    found: dict[Where, Due] = {}
    for k, visit in enumerate(visits):
        end_of_hop = visit.start + visit.seconds + _length(visit.after)
        for where, waits, end, first in (
            (AFTER, visit.after, end_of_hop, k + 1),
            (BEFORE, visit.before, visit.start, k),
        ):
            if not waits:
                continue
            following = [visits[(first + i) % len(visits)] for i in range(len(visits))]
            due = _due(cycle, process, following, end)
            if due is not None:
                found[where, visit.activity, visit.unit] = due
    return found


def _due(
    cycle: SteadyCycle, process: Sequence[float], following: Sequence[Visit], end: float
) -> Due | None:
    period = cycle.period
    for visit in following:
        if visit.activity == 0:
            continue
        seconds = process[visit.activity - 1]
        if seconds == 0.0:
            continue
        loads = [each for each in cycle.visits if each.activity == visit.activity - 1]
        since = min((visit.start - each.start - each.seconds) % period for each in loads)
        lead = (visit.start - end) % period
        if abs(since - seconds) < _SAME and lead <= seconds:
            return Due(visit.activity, seconds - lead)
    return None


def _length(waits: Sequence[ModeWait]) -> float:
    return sum(wait.seconds for wait in waits)


def cycle_program(cell: Cell, cycle: SteadyCycle) -> tuple[ProgramStep, ...]:
    """One cycle as steps, from in front of the first station of the route until the robot is there
    again. It waits in front of stations, starts every machine when it has left it, and waits for
    the machine before it takes a part. cell: with the parts that lie there when the cycle begins.
    """
    line = _Line(cell)
    dues = waits_for(cycle, line.process)
    following = (*cycle.visits[1:], cycle.visits[0])
    for visit, after in zip(cycle.visits, following, strict=True):
        place = visit.activity
        line.bring(place)
        line.stand(_since(visit.after, dues.get((AFTER, place, visit.unit)), line.names))
        line.go(place, after.activity)
        due = dues.get((BEFORE, after.activity, after.unit))
        line.stand(_since(after.before, due, line.names))
    return tuple(line.steps)


def _since(
    waits: Sequence[ModeWait], due: Due | None, names: Sequence[str]
) -> list[tuple[float, str]]:
    return [(wait.seconds, start_of(names[due.place]) if due else "") for wait in waits]


# The run: the line is filled from empty, then cycle follows cycle.
#
# A transport is left out where no part lies. What the robot does is the same otherwise, so the
# line fills by itself, and in as many cycles as a part needs.


@dataclass(frozen=True, eq=False)
class CycleLengths:
    """Seconds that the robot takes: by activity and unit, and for the empty hop after these by the
    activity that follows.
    """

    activities: Mapping[tuple[int, int], float]
    hops: Mapping[tuple[tuple[int, int], int], float]

    def hop(self, visit: Visit, following: int) -> float:
        """From the end of a visit to the begin of another activity; 0 where that is there."""
        if following == visit.activity + 1:
            return 0.0
        return self.hops[(visit.activity, visit.unit), following]


class _Line:
    """The steps of a program as they are written; where the parts are, and when each machine was
    started [s], after them.
    """

    def __init__(self, cell: Cell) -> None:
        self.route: PartRoute = route_of(cell)
        self.names = machines_of(cell)
        self.process = [cell.machine(name).process for name in self.names[1:-1]]
        self.steps: list[ProgramStep] = []
        self.started: dict[int, float] = {}
        self.now = 0.0
        self._cell = cell
        self._places = cell.parts_at_start()

    def bring(self, place: int) -> None:
        """The part at a place of the route to the next one."""
        station = self.route.visits[place]
        part = next(name for name, where in self._places.lying.items() if where == station)
        finished = self._works(place)
        start = self._works(place + 1)
        for step in transport(self._cell, place, part, finished=finished, start=start):
            self._places = self._places.after(step)
            self.steps.append(step)
        self.started.pop(place, None)

    def _works(self, place: int) -> bool:
        """Whether a machine works on the part at a place; at a buffer it only lies."""
        return 0 < place <= len(self.process) and self.process[place - 1] > 0.0

    def go(self, activity: int, following: int) -> None:
        """The empty hop from the end of an activity to the begin of another."""
        if following != activity + 1:
            front = front_name(self.route.visits[following])
            self.steps.append(ProgramStep("STATION", front))

    def stand(self, waits: Sequence[tuple[float, str]]) -> None:
        """Wait some seconds, each for a signal."""
        self.steps += pause_steps(waits)
        self.now += sum(seconds for seconds, _ in waits)


def run_program(
    cell: Cell, cycle: SteadyCycle, lengths: CycleLengths, cycles: int
) -> tuple[tuple[ProgramStep, ...], tuple[int, ...]]:
    """The steps, and the units of their transports: from an empty line, in front of the first
    station, until so many cycles were made in which every transport was; the robot is in front of
    the first station again. cell: with all parts that can be in flight, of which one lies at the
    first station.
    """
    line = _Line(cell)
    dues = waits_for(cycle, line.process)
    visits = list(_performed(cycle, len(line.route.visits) - 1, cycles))
    for (visit, full), (after, _) in zip(visits, [*visits[1:], visits[0]], strict=True):
        place = visit.activity
        line.bring(place)
        line.now += lengths.activities[place, visit.unit]
        line.started[place + 1] = line.now
        _wait(line, visit.after, dues.get((AFTER, place, visit.unit)), full=full)
        line.go(place, after.activity)
        line.now += lengths.hop(visit, after.activity)
        due = dues.get((BEFORE, after.activity, after.unit))
        _wait(line, after.before, due, full=full)
        _wait_for(line, after.activity)
    return tuple(line.steps), tuple(visit.unit for visit, _ in visits)


def _performed(cycle: SteadyCycle, last: int, cycles: int) -> Iterator[tuple[Visit, bool]]:
    """The transports that find a part, cycle by cycle, and whether the cycle is whole."""
    lying = set[int]()
    whole = 0
    while whole < cycles:
        done = []
        for visit in cycle.visits:
            if visit.activity == 0 or visit.activity in lying:
                lying.discard(visit.activity)
                lying.add(visit.activity + 1)
                lying.discard(last)
                done.append(visit)
        full = len(done) == len(cycle.visits)
        whole += full
        yield from ((visit, full) for visit in done)


def _wait(line: _Line, waits: Sequence[ModeWait], due: Due | None, *, full: bool) -> None:
    """A wait of the cycle as long as it is now; one that only fills the cycle has its length in
    whole cycles.
    """
    if due is None:
        line.stand([(_length(waits) if full else 0.0, "")])
        return
    since = line.started.get(due.place)
    seconds = 0.0 if since is None else max(since + due.seconds - line.now, 0.0)
    line.stand([(seconds, start_of(line.names[due.place]))])


def _wait_for(line: _Line, place: int) -> None:
    """What is left until the machine is ready whose part is next."""
    if place not in line.started:
        return
    left = line.started[place] + line.process[place - 1] - line.now
    if left > _SAME:
        line.stand([(left, start_of(line.names[place]))])
