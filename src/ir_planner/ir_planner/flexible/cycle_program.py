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
from ir_description.cell import PartRoute, begin_of_work
from ir_planner.cycle import ModeWait, SteadyCycle, Visit
from ir_planner.flexible.tending_cell import (
    front_name,
    machines_of,
    pause_steps,
    route_of,
    slot_name,
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
    """A wait ends so many seconds after the machine was started with the part in a slot."""

    slot: str
    seconds: float


class MachineSlots:
    """The slots of the machines along a route of a cell, of which parts take one after the other as
    they come. cycle: what says how many parts each machine holds at most.
    """

    def __init__(self, cell: Cell, cycle: SteadyCycle) -> None:
        names = machines_of(cell)[1:-1]
        self.cycle = cycle
        self._machines = [cell.machine(name) for name in names]

    def of(self, place: int, number: int) -> str:
        """The slot of a part of that number at a place of the route; "" where no machine works."""
        if not 0 < place <= len(self._machines):
            return ""
        machine = self._machines[place - 1]
        most = self.cycle.most[place - 1]
        return slot_name(machine.name, number, most) if machine.process > 0.0 else ""

    def finished(self, *, empty: bool) -> dict[str, dict[str, bool]]:
        """By machine that works its slots, and whether each has a part when the cycle begins;
        empty: none has.
        """
        slots: dict[str, dict[str, bool]] = {}
        full = self.cycle.full
        for place, machine in enumerate(self._machines, 1):
            if machine.process > 0.0:
                brought = -sum(full[: place - 1])
                inside = {self.of(place, brought - 1 - k) for k in range(full[place - 1])}
                own = [self.of(place, k) for k in range(self.cycle.most[place - 1])]
                slots[machine.name] = {slot: slot in inside and not empty for slot in own}
        return slots

    def ready(self, place: int, now: float, ends: Sequence[float]) -> float:
        """When the work on a part ends that comes to a place now. ends: of those before it, in
        their order.
        """
        machine = self._machines[place - 1]
        return begin_of_work(now, ends, machine.capacity) + machine.process

    def waits_for(self) -> dict[Where, Due]:
        """What each wait of the cycle is for: the next machine whose part is taken as soon as it is
        finished. A wait that is for none only fills the cycle.
        """
        visits = self.cycle.visits
        work = [
            [wait + machine.process for wait in self._queued(k)]
            for k, machine in enumerate(self._machines)
        ]
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
                due = self._due(work, following, end)
                if due is not None:
                    found[where, visit.activity, visit.unit] = due
        return found

    def _queued(self, k: int) -> tuple[float, ...]:
        machine = self._machines[k]
        return self.cycle.queued(k, machine.process, machine.capacity)

    def _due(
        self, work: Sequence[Sequence[float]], following: Sequence[Visit], end: float
    ) -> Due | None:
        """work: from when it comes to a machine until it is finished, of the part of each unit."""
        for visit in following:
            slot = self.of(visit.activity, self.cycle.number(visit))
            if not slot:
                continue
            unit, stay = self.cycle.stay(visit)
            lead = (visit.start - end) % self.cycle.period
            if abs(stay - work[visit.activity - 1][unit]) < _SAME and lead <= stay:
                return Due(slot, stay - lead)
        return None


def _length(waits: Sequence[ModeWait]) -> float:
    return sum(wait.seconds for wait in waits)


def cycle_program(cell: Cell, cycle: SteadyCycle) -> tuple[ProgramStep, ...]:
    """One cycle as steps, from in front of the first station of the route until the robot is there
    again. It waits in front of stations, starts every machine when it has left it, and waits for
    the machine before it takes a part. cell: with the parts that lie there when the cycle begins.
    """
    line = _Line(cell, cycle)
    dues = line.slots.waits_for()
    following = (*cycle.visits[1:], cycle.visits[0])
    for visit, after in zip(cycle.visits, following, strict=True):
        place = visit.activity
        line.bring(place, cycle.number(visit))
        line.stand(_since(visit.after, dues.get((AFTER, place, visit.unit))))
        line.go(place, after.activity)
        line.stand(_since(after.before, dues.get((BEFORE, after.activity, after.unit))))
    return tuple(line.steps)


def _since(waits: Sequence[ModeWait], due: Due | None) -> list[tuple[float, str]]:
    return [(wait.seconds, start_of(due.slot) if due else "") for wait in waits]


# The run: the line is filled from empty, then cycle follows cycle.
#
# A transport is left out where its part hasn't come yet. What the robot does is the same otherwise,
# so the line fills by itself, and in as many cycles as a part needs.


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
    """The steps of a program as they are written; where the parts are, and when the work in each
    slot was started and ends [s], after them.
    """

    def __init__(self, cell: Cell, cycle: SteadyCycle) -> None:
        self.route: PartRoute = route_of(cell)
        self.slots = MachineSlots(cell, cycle)
        self.steps: list[ProgramStep] = []
        self.started: dict[str, float] = {}
        self.ready: dict[str, float] = {}
        self.now = 0.0
        self._ends: dict[int, list[float]] = {}
        self._cell = cell
        self._places = cell.parts_at_start()

    def bring(self, place: int, number: int) -> None:
        """The part of that number at a place of the route to the next one."""
        part = self._places.at(self.route.visits[place])[0]
        taken_from = self.slots.of(place, number)
        brought_to = self.slots.of(place + 1, number)
        for step in transport(
            self._cell, place, part, taken_from=taken_from, brought_to=brought_to
        ):
            self._places = self._places.after(step)
            self.steps.append(step)
        self.started.pop(taken_from, None)

    def begin(self, place: int, number: int) -> None:
        """The machine at a place is started now with the part of that number."""
        slot = self.slots.of(place, number)
        if slot:
            ends = self._ends.setdefault(place, [])
            ends.append(self.slots.ready(place, self.now, ends))
            self.started[slot] = self.now
            self.ready[slot] = ends[-1]

    def go(self, activity: int, following: int) -> None:
        """The empty hop from the end of an activity to the begin of another."""
        if following != activity + 1:
            front = front_name(self.route.visits[following])
            self.steps.append(ProgramStep("STATION", front))

    def stand(self, waits: Sequence[tuple[float, str]]) -> None:
        """Wait some seconds, each for a signal."""
        self.steps += pause_steps(waits)
        self.now += sum(seconds for seconds, _ in waits)

    def wait(self, waits: Sequence[ModeWait], due: Due | None, *, full: bool) -> None:
        """A wait of the cycle as long as it is now; one that only fills the cycle has its length in
        whole cycles.
        """
        if due is None:
            self.stand([(_length(waits) if full else 0.0, "")])
            return
        since = self.started.get(due.slot)
        seconds = 0.0 if since is None else max(since + due.seconds - self.now, 0.0)
        self.stand([(seconds, start_of(due.slot))])

    def wait_for(self, slot: str) -> None:
        """What is left until the part in a slot is finished, which is next."""
        left = self.ready.get(slot, self.now) - self.now
        if left > _SAME:
            self.stand([(left, start_of(slot))])


def run_program(
    cell: Cell, cycle: SteadyCycle, lengths: CycleLengths, cycles: int
) -> tuple[tuple[ProgramStep, ...], tuple[int, ...]]:
    """The steps, and the units of their transports: from an empty line, in front of the first
    station, until so many cycles were made in which every transport was; the robot is in front of
    the first station again. cell: with all parts that can be in flight, of which one lies at the
    first station.
    """
    line = _Line(cell, cycle)
    dues = line.slots.waits_for()
    visits = list(_performed(cycle, cycles))
    following = [*visits[1:], visits[0]]
    for (visit, number, full), (after, next_number, _) in zip(visits, following, strict=True):
        place = visit.activity
        line.bring(place, number)
        line.now += lengths.activities[place, visit.unit]
        line.begin(place + 1, number)
        line.wait(visit.after, dues.get((AFTER, place, visit.unit)), full=full)
        line.go(place, after.activity)
        line.now += lengths.hop(visit, after.activity)
        line.wait(after.before, dues.get((BEFORE, after.activity, after.unit)), full=full)
        line.wait_for(line.slots.of(after.activity, next_number))
    return tuple(line.steps), tuple(visit.unit for visit, _, _ in visits)


def _performed(cycle: SteadyCycle, cycles: int) -> Iterator[tuple[Visit, int, bool]]:
    """The transports that find a part, cycle by cycle: the visit, the number of its part (0: the
    first that is made), and whether the cycle is whole, that is, all of its transports find one.
    The line fills in the first cycles, whose transports of earlier parts (numbers below 0) are left
    out; it ends after so many whole ones.
    """
    made = 0
    whole = 0
    while whole < cycles:
        numbered = [(visit, made + cycle.number(visit)) for visit in cycle.visits]
        done = [(visit, number) for visit, number in numbered if number >= 0]
        full = len(done) == len(numbered)
        if full:
            whole += 1
        made += cycle.units
        yield from ((visit, number, full) for visit, number in done)
