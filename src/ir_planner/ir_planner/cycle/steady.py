"""The steady cycle of least energy of one robot that tends machines.

Parts go through machines 1 to m in order, each of which works on as many at once as its capacity
is and holds as many more as its buffer. Activity a takes a part at place a (0: infeed) and brings
it to place a + 1 (m + 1: outfeed). In a cycle of k units every activity is done k times. Chosen
together: the order of the activities, the duration of each and of the empty hops between them on
convex curves of energy over duration, the waits, and the power mode of each. The process of a
machine may go on over the end of the cycle.

There is a mixed-integer linear program for each way in which machines can be full when the cycle
begins: then parts and their places are known, and what comes before what mostly is. Successors are
0 or 1, times flow along the successors that are chosen (a time is zero where its hop isn't), a
power mode is a range of a wait's length. A program whose relaxed cost is above a known cycle needs
no search.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, permutations, product
from math import gcd, lcm

import numpy as np

from ir_description.cell import begin_of_work
from ir_planner.cycle.linear import LinearProgram
from ir_values.arrays import FloatArray

UNITS_MAX = 2
"""Most units of a cycle."""

Node = tuple[int, int]
"""An activity, and its number among its like in the cycle, from 0."""
Arc = tuple[Node, Node]

_EXACT = 1e-6  # relative, of the cost
_SAME = 1e-9  # s
_ROUNDS = 20  # cycles after which a machine's queue is what it always is


@dataclass(frozen=True)
class Curve:
    """Corners of a convex energy over duration: seconds rise, joules per second rise from one to
    the next.
    """

    seconds: tuple[float, ...]
    joules: tuple[float, ...]

    @staticmethod
    def below(points: Iterable[tuple[float, float]]) -> Curve:
        """The lower convex hull of points (seconds, joules), from the fastest to the slowest."""
        hull: list[tuple[float, float]] = []
        for point in sorted(points):
            if hull and point[0] == hull[-1][0]:
                continue
            while len(hull) > 1 and _slope(hull[-2], hull[-1]) >= _slope(hull[-2], point):
                hull.pop()
            hull.append(point)
        return Curve(tuple(s for s, _ in hull), tuple(j for _, j in hull))

    @property
    def segments(self) -> list[tuple[float, float]]:
        """Length [s] and slope [W] of each segment."""
        corners = list(zip(self.seconds, self.joules, strict=True))
        return [(b[0] - a[0], _slope(a, b)) for a, b in pairwise(corners)]

    def shifted(self, seconds: float, joules: float) -> Curve:
        """The curve of what takes so much more."""
        return Curve(
            tuple(s + seconds for s in self.seconds), tuple(j + joules for j in self.joules)
        )

    def at(self, seconds: float) -> float:
        """Joules at a duration on the curve."""
        return float(np.interp(seconds, self.seconds, self.joules))


def in_turn(curves: Sequence[Curve]) -> Curve:
    """The least energy of several movements one after the other over their time together."""
    slopes = sorted(
        (segment for curve in curves for segment in curve.segments), key=lambda each: each[1]
    )
    seconds = [sum(curve.seconds[0] for curve in curves)]
    joules = [sum(curve.joules[0] for curve in curves)]
    for length, slope in slopes:
        seconds.append(seconds[-1] + length)
        joules.append(joules[-1] + slope * length)
    return Curve(tuple(seconds), tuple(joules))


def shared_among(curves: Sequence[Curve], seconds: float) -> list[float]:
    """How long each of the movements takes where all together take `seconds` and least energy."""
    taken = [curve.seconds[0] for curve in curves]
    left = seconds - sum(taken)
    slopes = sorted(
        (slope, k, length) for k, curve in enumerate(curves) for length, slope in curve.segments
    )
    for _, k, length in slopes:
        more = min(length, max(left, 0.0))
        taken[k] += more
        left -= more
    return taken


def _slope(a: tuple[float, float], b: tuple[float, float]) -> float:
    return (b[1] - a[1]) / (b[0] - a[0])


@dataclass(frozen=True)
class WaitMode:
    """A wait of shortest to longest s takes joules + watts x length; name: of the power mode."""

    name: str
    shortest: float
    longest: float
    joules: float
    watts: float


@dataclass(frozen=True)
class SteadyProblem:
    """activities (m + 1): their curves. hops: of the empty hops by the activities that they are
    between; where one is missing, the next activity begins where the other ended, and no activity
    is done twice in a row. after, before:
    modes of a wait at the end of each activity and at the begin of each. process (m): seconds of
    the machines; the one of machine a + 1 lies between the activities a and a + 1. own, own_hops:
    curves of an activity of one unit, and of the hops after it by the activity that follows, where
    they aren't those of all units. capacities, buffers (m): 1 and 0 of each where they are empty.
    """

    activities: tuple[Curve, ...]
    hops: Mapping[tuple[int, int], Curve]
    after: tuple[tuple[WaitMode, ...], ...]
    before: tuple[tuple[WaitMode, ...], ...]
    process: tuple[float, ...]
    own: Mapping[Node, Curve] = field(default_factory=dict)
    own_hops: Mapping[tuple[Node, int], Curve] = field(default_factory=dict)
    capacities: tuple[int, ...] = ()
    buffers: tuple[int, ...] = ()

    @property
    def alike(self) -> bool:
        """Whether all units have the same curves."""
        return not self.own and not self.own_hops

    @property
    def capacity(self) -> tuple[int, ...]:
        """Parts that each machine works on at once."""
        return self.capacities or (1,) * len(self.process)

    @property
    def places(self) -> tuple[int, ...]:
        """Parts that each machine holds."""
        buffers = self.buffers or (0,) * len(self.process)
        return tuple(map(sum, zip(self.capacity, buffers, strict=True)))

    def activity(self, node: Node) -> Curve:
        """The curve of an activity of a unit."""
        return self.own.get(node, self.activities[node[0]])

    def hop(self, node: Node, following: int) -> Curve | None:
        """The curve of the hop after it; None where the next activity begins where it ended."""
        return self.own_hops.get((node, following), self.hops.get((node[0], following)))

    @property
    def longest(self) -> float:
        """A period [s] for one unit that always suffices: one activity after the other."""
        slowest = sum(curve.seconds[-1] for curve in self.activities)
        hops = max((curve.seconds[-1] for curve in self.hops.values()), default=0.0)
        return slowest + hops * len(self.activities) + sum(self.process)


@dataclass(frozen=True)
class ModeWait:
    """A wait [s] in a power mode."""

    mode: str
    seconds: float


@dataclass(frozen=True)
class Visit:
    """An activity in the cycle: it starts at `start` s and takes `seconds`; hop [s]: to the begin
    of the next one; after, before: waits at its end (before the hop) and at its begin.
    """

    activity: int
    unit: int
    start: float
    seconds: float
    hop: float
    before: tuple[ModeWait, ...]
    after: tuple[ModeWait, ...]


@dataclass(frozen=True)
class SteadyCycle:
    """visits: in order, the first one starts at 0 s; joules: of the cycle, on the curves; bound:
    what no cycle within the period that was asked for can be below; units: parts a cycle. full:
    parts in each machine when it begins.
    """

    visits: tuple[Visit, ...]
    period: float
    units: int
    joules: float
    bound: float
    full: tuple[int, ...]

    @property
    def most(self) -> tuple[int, ...]:
        """Parts that each machine holds at most."""
        inside = list(self.full)
        most = list(self.full)
        for visit in self.visits:
            if visit.activity > 0:
                inside[visit.activity - 1] -= 1
            if visit.activity < len(inside):
                inside[visit.activity] += 1
                most[visit.activity] = max(most[visit.activity], inside[visit.activity])
        return tuple(most)

    @property
    def seconds_per_part(self) -> float:
        """Of the period, for each part [s]."""
        return self.period / self.units

    @property
    def joules_per_part(self) -> float:
        """Of the energy, for each part [J]."""
        return self.joules / self.units

    @property
    def order(self) -> tuple[Node, ...]:
        """The activities in order."""
        return tuple((visit.activity, visit.unit) for visit in self.visits)

    @property
    def turns(self) -> int:
        """Cycles after which every place of a machine has a part of the same number again, where
        parts take the places in turn.
        """
        return lcm(*(most // gcd(most, self.units) for most in self.most))

    def number(self, visit: Visit) -> int:
        """Which part a visit brings, those from 0 on come to the line in this cycle."""
        return visit.unit - sum(self.full[: visit.activity])

    def stay(self, visit: Visit) -> tuple[int, float]:
        """Of the part that a visit takes from a machine: the unit that brought it there, and how
        long it has been there then [s].
        """
        unit = visit.unit - self.full[visit.activity - 1]
        load = self._load(visit.activity - 1, unit % self.units)
        periods = -(unit // self.units)
        return load.unit, visit.start + periods * self.period - load.start - load.seconds

    def queued(self, machine: int, process: float, capacity: int) -> tuple[float, ...]:
        """How long the part of each unit lies in a machine before it begins with it [s], since it
        works on as many others as it can.
        """
        loads = [self._load(machine, unit) for unit in range(self.units)]
        waits: list[float] = []
        ends: list[float] = []
        for round_ in range(_ROUNDS):
            for load in loads:
                here = round_ * self.period + load.start + load.seconds
                begin = begin_of_work(here, ends[-capacity:], capacity)
                waits.append(begin - here)
                ends.append(begin + process)
        return tuple(waits[-self.units :])

    def _load(self, machine: int, unit: int) -> Visit:
        """The visit that brings the part of a unit to a machine."""
        return next(v for v in self.visits if (v.activity, v.unit) == (machine, unit))

    def repeated(self, times: int) -> SteadyCycle:
        """The cycle made so many times, as one."""
        visits = tuple(
            replace(visit, unit=k * self.units + visit.unit, start=visit.start + k * self.period)
            for k in range(times)
            for visit in self.visits
        )
        return SteadyCycle(
            visits, times * self.period, times * self.units, times * self.joules,
            times * self.bound, self.full,
        )  # fmt: skip


@dataclass(frozen=True)
class _Lag:
    """From the end of `start` to the begin of `end`, so many periods later, at least `seconds`."""

    start: Node
    end: Node
    seconds: float
    periods: int


def cheapest_cycle(
    problem: SteadyProblem,
    *,
    period: float,
    units: int = 1,
    stopped: Callable[[], bool] | None = None,
) -> SteadyCycle | None:
    """The cycle of `units` parts of least energy that takes at most period x units s; None where
    there is none, or none was found before it was `stopped`.
    """
    once = None
    if units > 1 and problem.alike:
        once = cheapest_cycle(problem, period=period, stopped=stopped)
    return _least_cycle(problem, units, period * units, once, stopped)


def fastest_cycle(
    problem: SteadyProblem, *, units: int = 1, stopped: Callable[[], bool] | None = None
) -> SteadyCycle | None:
    """The shortest cycle; its joules and its bound are seconds."""
    once = None
    if units > 1 and problem.alike:
        once = fastest_cycle(problem, stopped=stopped)
    most = problem.longest * units if once is None else once.period * units
    return _least_cycle(problem, units, most, once, stopped, fastest=True)


def _least_cycle(
    problem: SteadyProblem,
    units: int,
    period: float,
    once: SteadyCycle | None,
    stopped: Callable[[], bool] | None,
    *,
    fastest: bool = False,
) -> SteadyCycle | None:
    """The best cycle over all numbers of parts that machines have when it begins, those of the
    least bound first. once: a cycle of one unit, which may be made again and again.
    """
    best = None if once is None else once.repeated(units)
    contents = []
    for full in product(*(range(places + 1) for places in problem.places)):
        model = _Model(problem, units, period, full, fastest=fastest)
        if model.possible:
            contents.append((model.program.relaxed().bound, full))
    bound = np.inf
    for relaxed, full in sorted(contents):
        limit = np.inf if best is None else best.joules * (1.0 - _EXACT)
        if relaxed >= limit or (stopped is not None and stopped()):
            bound = min(bound, relaxed)
            continue
        model = _Model(problem, units, period, full, fastest=fastest)
        cycle, proved = model.solve(stopped, limit)
        bound = min(bound, max(proved, relaxed))
        best = cycle or best
    return None if best is None else replace(best, bound=min(bound, best.joules))


class _Model:
    """The linear program of a problem within a period [s] of the whole cycle, where so many parts
    are in each machine when it begins (`full`).

    The units of an activity are numbered as they come in the cycle, and parts leave a machine as
    they came. So the part of load i leaves by unload i + full, and i may begin when the unload
    i + full - places is over: times differ by at least so much, and by whole periods.
    """

    def __init__(
        self,
        problem: SteadyProblem,
        units: int,
        period: float,
        full: Sequence[int],
        *,
        fastest: bool,
    ) -> None:
        self.problem = problem
        self.units = units
        self.full = tuple(full)
        self.most = period
        self.price = 0.0 if fastest else 1.0
        self.program = LinearProgram()
        count = len(problem.activities)
        self.nodes: list[Node] = [(a, u) for a in range(count) for u in range(units)]
        self.first = self.nodes[0]
        self._travel = _shortest_travel(problem)
        self.least = self._least_period()
        self.lags = [lag for m, parts in enumerate(full) for lag in self._machine_lags(m, parts)]
        self.lags += [self._lag((a, u), a, u + 1, self._travel[a, a]) for a, u in self.nodes]
        self.possible = self.least <= self.most and self._windows()
        if self.possible:
            self._build(fastest=fastest)

    def _build(self, *, fastest: bool) -> None:
        """Variables of the linear program (begins, durations, waits, successors), then its rows:
        one activity at a time, and the order in which parts pass each machine.
        """
        problem = self.problem
        self.period = self.program.variable(self.least, self.most, cost=float(fastest))
        self.start = {
            node: self.program.variable(self.soonest[node], self.latest[node])
            for node in self.nodes
        }
        self.duration: dict[Node, dict[int, float]] = {}
        for node in self.nodes:
            curve = problem.activity(node)
            self.duration[node] = self._segments(curve, self._cost(curve.joules[0]), None)
        self.waits: dict[tuple[str, Node], list[tuple[WaitMode, int, int]]] = {}
        for node in self.nodes:
            self.waits["after", node] = self._modes(problem.after[node[0]])
            self.waits["before", node] = self._modes(problem.before[node[0]])
        self.taken: dict[Arc, int] = {}
        self.flow: dict[Arc, int] = {}
        self.hop: dict[Arc, dict[int, float]] = {}
        self._successors()
        self._times()
        self._half()
        for lag in self.lags:
            self._add_lag(lag)
        for machine, parts in enumerate(self.full):
            self._queue(machine, parts)
            self._at_once(machine, parts)

    def _least_period(self) -> float:
        """What the busiest machine takes for its parts; one with a single place from one load to
        the next.
        """
        busiest = 0.0
        for machine, process in enumerate(self.problem.process):
            busy = process / self.problem.capacity[machine]
            if self.problem.places[machine] == 1:
                busy += sum(self._shortest(a) for a in (machine, machine + 1))
                busy += self._travel[machine + 1, machine]
            busiest = max(busiest, busy)
        return self.units * busiest

    def _shortest(self, activity: int) -> float:
        return min(self.problem.activity((activity, u)).seconds[0] for u in range(self.units))

    def _machine_lags(self, machine: int, parts: int) -> Iterator[_Lag]:
        """A part is taken when its process is over, and one is brought where there is a place."""
        travel = self._travel[machine + 1, machine]
        for unit in range(self.units):
            load = machine, unit
            yield self._lag(load, machine + 1, unit + parts, self.problem.process[machine])
            gone = unit + parts - self.problem.places[machine]
            unload = machine + 1, gone % self.units
            yield _Lag(unload, load, travel, -(gone // self.units))

    def _lag(self, node: Node, activity: int, number: int, seconds: float) -> _Lag:
        """From the end of an activity to the begin of another one, that of this number from the
        begin of the cycle on.
        """
        return _Lag(node, (activity, number % self.units), seconds, number // self.units)

    def _windows(self) -> bool:
        """The soonest and the latest begin of every activity [s], and what comes before what;
        whether there may be a cycle.

        Windows narrow and orders follow from each other until nothing changes any more.
        """
        moving = {node: self.problem.activity(node).seconds[0] for node in self.nodes}
        first = self.first
        self.soonest = {}
        self.latest = {}
        for node in self.nodes:
            if node == first:
                self.soonest[node] = 0.0
                self.latest[node] = 0.0
                continue
            back = self._travel[node[0], first[0]]
            self.soonest[node] = moving[first] + self._travel[first[0], node[0]]
            self.latest[node] = self.most - moving[node] - back
        self.order = {(lag.start, lag.end) for lag in self.lags if lag.periods == 0}
        self.order |= {(first, node) for node in self.nodes[1:]}
        changed = True
        while changed:
            changed = False
            for one, other in permutations(self.nodes, 2):
                lead = moving[one] + self._travel[one[0], other[0]]
                if self.soonest[one] + lead > self.latest[other] + _SAME:
                    changed |= self._ordered(other, one)
                if (one, other) in self.order:
                    changed |= self._apart_by(one, other, lead, 0)
            for lag in self.lags:
                lead = moving[lag.start] + lag.seconds
                changed |= self._apart_by(lag.start, lag.end, lead, lag.periods)
            if any(self.soonest[node] > self.latest[node] + _SAME for node in self.nodes):
                return False
            if any((other, one) in self.order for one, other in self.order):
                return False
        return True

    def _ordered(self, one: Node, other: Node) -> bool:
        """One comes before the other; whether that is new."""
        before = [one, *(a for a, b in self.order if b == one)]
        after = [other, *(b for a, b in self.order if a == other)]
        known = len(self.order)
        self.order |= {(a, b) for a in before for b in after}
        return len(self.order) > known

    def _apart_by(self, one: Node, other: Node, seconds: float, periods: int) -> bool:
        """The begins differ by at least so much; whether that makes a window smaller."""
        soonest = self.soonest[one] + seconds - periods * self.most
        latest = self.latest[other] + periods * self.most - seconds
        new = soonest > self.soonest[other] + _SAME or latest < self.latest[one] - _SAME
        self.soonest[other] = max(soonest, self.soonest[other])
        self.latest[one] = min(latest, self.latest[one])
        return new

    def _follows(self, one: Node, other: Node) -> bool:
        """Whether one activity may be next after another: nothing has to come between."""
        if one[0] == other[0] and (one[0], other[0]) not in self.problem.hops:
            return False
        if other == self.first:
            return not any((one, node) in self.order for node in self.nodes)
        if (other, one) in self.order:
            return False
        return not any(
            (one, node) in self.order and (node, other) in self.order for node in self.nodes
        )

    def _cost(self, joules: float) -> int:
        """A variable that is 1: what is spent anyway."""
        return self.program.variable(1.0, 1.0, cost=self.price * joules)

    def _segments(self, curve: Curve, base: int, taken: int | None) -> dict[int, float]:
        """Terms of a duration on a curve; base: 1 where it counts; taken: the binary that says so,
        None: always.
        """
        terms = {base: curve.seconds[0]}
        for length, slope in curve.segments:
            more = self.program.variable(0.0, length, cost=self.price * slope)
            if taken is not None:
                self.program.row({more: 1.0, taken: -length}, high=0.0)
            terms[more] = 1.0
        return terms

    def _modes(self, modes: Sequence[WaitMode]) -> list[tuple[WaitMode, int, int]]:
        """Each mode with its choice and its seconds; at most one is chosen."""
        waits = []
        for mode in modes:
            chosen = self.program.binary(cost=self.price * mode.joules)
            longest = min(mode.longest, self.most)
            seconds = self.program.variable(0.0, longest, cost=self.price * mode.watts)
            self.program.row({seconds: 1.0, chosen: -longest}, high=0.0)
            self.program.row({seconds: 1.0, chosen: -mode.shortest}, low=0.0)
            waits.append((mode, chosen, seconds))
        if len(waits) > 1:
            self.program.row({chosen: 1.0 for _, chosen, _ in waits}, high=1.0)
        return waits

    def _successors(self) -> None:
        """Every activity is followed by one other."""
        program = self.program
        for node, other in permutations(self.nodes, 2):
            if not self._follows(node, other):
                continue
            curve = self.problem.hop(node, other[0])
            arc = node, other
            joules = 0.0 if curve is None else curve.joules[0]
            self.taken[arc] = program.binary(cost=self.price * joules)
            self.flow[arc] = program.variable(0.0, self.most)
            most = self.most if other == self.first else self.latest[other]
            program.row({self.flow[arc]: 1.0, self.taken[arc]: -most}, high=0.0)
            least = self.problem.activity(node).seconds[0] + self.soonest[node]
            least += 0.0 if curve is None else curve.seconds[0]
            program.row({self.flow[arc]: 1.0, self.taken[arc]: -least}, low=0.0)
            self.hop[arc] = (
                {} if curve is None else self._segments(curve, self.taken[arc], self.taken[arc])
            )
        for node in self.nodes:
            out = {x: 1.0 for (a, _), x in self.taken.items() if a == node}
            into = {x: 1.0 for (_, b), x in self.taken.items() if b == node}
            program.row(out, low=1.0, high=1.0)
            program.row(into, low=1.0, high=1.0)

    def _times(self) -> None:
        """What flows out of an activity is when the next one is reached."""
        for node in self.nodes:
            leaving: dict[int, float] = {self.start[node]: 1.0, **self.duration[node]}
            leaving |= {seconds: 1.0 for _, _, seconds in self.waits["after", node]}
            for arc, flow in self.flow.items():
                if arc[0] == node:
                    for variable, factor in self.hop[arc].items():
                        leaving[variable] = leaving.get(variable, 0.0) + factor
                    leaving[flow] = -1.0
            self.program.row(leaving, low=0.0, high=0.0)
            begin = self.period if node == self.first else self.start[node]
            reached = {flow: 1.0 for arc, flow in self.flow.items() if arc[1] == node}
            reached |= {seconds: 1.0 for _, _, seconds in self.waits["before", node]}
            self.program.row({**reached, begin: -1.0}, low=0.0, high=0.0)

    def _add_lag(self, lag: _Lag) -> None:
        """The row of a lag."""
        terms = self._end(lag.start, -1.0)
        terms[self.start[lag.end]] = terms.get(self.start[lag.end], 0.0) + 1.0
        self.program.row({**terms, self.period: float(lag.periods)}, low=lag.seconds)

    def _end(self, node: Node, factor: float) -> dict[int, float]:
        """Terms of the end of an activity, times a factor."""
        terms = {self.start[node]: 1.0, **self.duration[node]}
        return {variable: factor * value for variable, value in terms.items()}

    def _queue(self, machine: int, parts: int) -> None:
        """Where parts wait in a machine for others: when it begins with each of them."""
        if self.problem.places[machine] == self.problem.capacity[machine]:
            return
        process = self.problem.process[machine]
        begun = [self.program.variable(0.0) for _ in range(self.units)]
        for unit, begin in enumerate(begun):
            terms = self._end((machine, unit), -1.0)
            self.program.row({**terms, begin: 1.0}, low=0.0)
            before = unit - self.problem.capacity[machine]
            if before % self.units != unit:
                terms = {begin: 1.0, begun[before % self.units]: -1.0}
                self.program.row({**terms, self.period: -(before // self.units)}, low=process)
            gone = unit + parts
            unload = self.start[machine + 1, gone % self.units]
            terms = {unload: 1.0, begin: -1.0, self.period: gone // self.units}
            self.program.row(terms, low=process)

    def _at_once(self, machine: int, parts: int) -> None:
        """Who takes a part right after he brought it waits for the whole process: what the times
        say too, but only where successors are whole.
        """
        for unit in range(self.units):
            load = machine, unit
            unload = machine + 1, unit + parts
            if (load, unload) in self.taken:
                waits = [*self.waits["after", load], *self.waits["before", unload]]
                terms = {seconds: 1.0 for _, _, seconds in waits}
                terms[self.taken[load, unload]] = -self.problem.process[machine]
                self.program.row(terms, low=0.0)

    def _half(self) -> None:
        """Where the units are alike, the second one begins in the first half of the period."""
        if self.units > 1 and self.problem.alike:
            self.program.row({self.start[0, 1]: 1.0, self.period: -0.5}, high=0.0)

    def solve(
        self, stopped: Callable[[], bool] | None, limit: float
    ) -> tuple[SteadyCycle | None, float]:
        """A cycle below the limit, and what none can be below."""
        answer = self.program.solve(stopped=stopped, gap=1e-6, limit=limit)
        if answer.values is None or answer.cost >= limit:
            return None, answer.bound
        values = answer.values
        following = {a: b for (a, b), taken in self.taken.items() if values[taken] > 0.5}
        visits: list[Visit] = []
        node = self.first
        while len(visits) < len(self.nodes):
            hop = self.hop[node, following[node]]
            visits.append(
                Visit(
                    *node,
                    start=float(values[self.start[node]]),
                    seconds=_sum(self.duration[node], values),
                    hop=_sum(hop, values),
                    before=self._waited("before", node, values),
                    after=self._waited("after", node, values),
                )
            )
            node = following[node]
        period = float(values[self.period])
        cycle = SteadyCycle(tuple(visits), period, self.units, answer.cost, answer.bound, self.full)
        return cycle, answer.bound

    def _waited(self, where: str, node: Node, values: FloatArray) -> tuple[ModeWait, ...]:
        return tuple(
            ModeWait(mode.name, float(values[seconds]))
            for mode, chosen, seconds in self.waits[where, node]
            if values[chosen] > 0.5 and values[seconds] > 0.0
        )


def _shortest_travel(problem: SteadyProblem) -> dict[tuple[int, int], float]:
    """Least seconds from the end of each activity to the begin of each, over others or not."""
    count = len(problem.activities)
    units = range(UNITS_MAX)
    travel = {}
    for a in range(count):
        for b in range(count):
            curves = [problem.hop((a, unit), b) for unit in units]
            travel[a, b] = min(0.0 if curve is None else curve.seconds[0] for curve in curves)
    moving = [min(problem.activity((a, u)).seconds[0] for u in units) for a in range(count)]
    for over in range(count):
        for a in range(count):
            for b in range(count):
                longer = travel[a, over] + moving[over] + travel[over, b]
                travel[a, b] = min(travel[a, b], longer)
    return travel


def _sum(terms: Mapping[int, float], values: FloatArray) -> float:
    return float(sum(factor * values[variable] for variable, factor in terms.items()))
