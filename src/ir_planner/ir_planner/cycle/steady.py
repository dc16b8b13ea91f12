"""The steady cycle of least energy of one robot that tends machines.

Parts go through machines 1 to m in order, each of which works on one part at a time. Activity a
takes a part at place a (0: infeed) and brings it to place a + 1 (m + 1: outfeed). In a cycle of k
units every activity is done k times. Chosen together: the order of the activities, the duration of
each and of the empty hops between them on convex curves of energy over duration, the waits, and
the power mode of each. The process of a machine may go on over the end of the cycle.

The model is a mixed-integer linear program: successors are 0 or 1, times flow along the successors
that are chosen (a time is zero where its hop isn't), a power mode is a range of a wait's length.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, pairwise

import numpy as np

from ir_planner.cycle.linear import LinearProgram
from ir_values.arrays import FloatArray

UNITS_MAX = 2
"""Most units of a cycle."""

Node = tuple[int, int]
"""An activity and which of its units, from 0."""
Arc = tuple[Node, Node]


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
    between; where one is missing, the next activity begins where the other ended. after, before:
    modes of a wait at the end of each activity and at the begin of each. process (m): seconds of
    the machines; the one of machine a + 1 lies between the activities a and a + 1. own, own_hops:
    curves of an activity of one unit, and of the hops after it by the activity that follows, where
    they aren't those of all units.
    """

    activities: tuple[Curve, ...]
    hops: Mapping[tuple[int, int], Curve]
    after: tuple[tuple[WaitMode, ...], ...]
    before: tuple[tuple[WaitMode, ...], ...]
    process: tuple[float, ...]
    own: Mapping[Node, Curve] = field(default_factory=dict)
    own_hops: Mapping[tuple[Node, int], Curve] = field(default_factory=dict)

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
    what no cycle within the period that was asked for can be below; units: parts a cycle.
    """

    visits: tuple[Visit, ...]
    period: float
    units: int
    joules: float
    bound: float

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
    return _Model(problem, units, period * units, fastest=False).solve(stopped)


def fastest_cycle(
    problem: SteadyProblem, *, units: int = 1, stopped: Callable[[], bool] | None = None
) -> SteadyCycle | None:
    """The shortest cycle; its joules and its bound are seconds."""
    return _Model(problem, units, problem.longest * units, fastest=True).solve(stopped)


class _Model:
    """The linear program of a problem within a period [s] of the whole cycle."""

    def __init__(self, problem: SteadyProblem, units: int, period: float, *, fastest: bool) -> None:
        self.problem = problem
        self.units = units
        self.most = period
        self.price = 0.0 if fastest else 1.0
        self.program = LinearProgram()
        count = len(problem.activities)
        self.nodes: list[Node] = [(a, u) for a in range(count) for u in range(units)]
        self.first = self.nodes[0]
        self._travel = _shortest_travel(problem)
        self.least = min(self._least_period(), period)
        self.period = self.program.variable(self.least, period, cost=float(fastest))
        self.start = {node: self._time(node) for node in self.nodes}
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
        self._first_unit()
        for machine in range(len(problem.process)):
            self._machine(machine)

    def _least_period(self) -> float:
        """What the busiest machine takes for its parts, from one load to the next."""
        busiest = 0.0
        for machine, process in enumerate(self.problem.process):
            shortest = [
                min(self.problem.activity((a, unit)).seconds[0] for unit in range(self.units))
                for a in (machine, machine + 1)
            ]
            own = process + sum(shortest) + self._travel[machine + 1, machine]
            busiest = max(busiest, own)
        return self.units * busiest

    def _time(self, node: Node) -> int:
        """When an activity starts, no sooner than the robot can be there and back in time."""
        if node == self.first:
            return self.program.variable(0.0, 0.0)
        soonest = self._soonest(node)
        return self.program.variable(soonest, max(self._latest(node), soonest))

    def _soonest(self, node: Node) -> float:
        first = self.problem.activity(self.first).seconds[0]
        return first + self._travel[self.first[0], node[0]]

    def _latest(self, node: Node) -> float:
        """Within the longest period; below 0 where that is too short."""
        back = self._travel[node[0], self.first[0]]
        return self.most - self.problem.activity(node).seconds[0] - back

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
        found = []
        for mode in modes:
            chosen = self.program.binary(cost=self.price * mode.joules)
            longest = min(mode.longest, self.most)
            seconds = self.program.variable(0.0, longest, cost=self.price * mode.watts)
            self.program.row({seconds: 1.0, chosen: -longest}, high=0.0)
            self.program.row({seconds: 1.0, chosen: -mode.shortest}, low=0.0)
            found.append((mode, chosen, seconds))
        if len(found) > 1:
            self.program.row({chosen: 1.0 for _, chosen, _ in found}, high=1.0)
        return found

    def _successors(self) -> None:
        """Every activity is followed by one other. The same one twice is none: its machine is
        full, or empty, in between.
        """
        program = self.program
        for node in self.nodes:
            for other in self.nodes:
                if node[0] == other[0]:
                    continue
                curve = self.problem.hop(node, other[0])
                arc = node, other
                joules = 0.0 if curve is None else curve.joules[0]
                self.taken[arc] = program.binary(cost=self.price * joules)
                self.flow[arc] = program.variable(0.0, self.most)
                most = self.most if other == self.first else self._latest(other)
                program.row({self.flow[arc]: 1.0, self.taken[arc]: -most}, high=0.0)
                least = self.problem.activity(node).seconds[0]
                least += 0.0 if curve is None else curve.seconds[0]
                least += 0.0 if node == self.first else self._soonest(node)
                program.row({self.flow[arc]: 1.0, self.taken[arc]: -least}, low=0.0)
                self.hop[arc] = (
                    {} if curve is None else self._segments(curve, self.taken[arc], self.taken[arc])
                )
        for node in self.nodes:
            out = {x: 1.0 for (a, _), x in self.taken.items() if a == node}
            into = {x: 1.0 for (_, b), x in self.taken.items() if b == node}
            program.row(out, low=1.0, high=1.0)
            program.row(into, low=1.0, high=1.0)
        self._one_tour()

    def _one_tour(self) -> None:
        """No activities are a tour of their own, in all their units."""
        count = len(self.problem.activities)
        for size in range(2, count):
            for own in combinations(range(count), size):
                inside = {
                    taken: 1.0
                    for (one, other), taken in self.taken.items()
                    if one[0] in own and other[0] in own
                }
                self.program.row(inside, high=float(size * self.units - 1))

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

    def _machine(self, machine: int) -> None:
        """A part is taken when its process is over, and the next one is brought after that."""
        process = self.problem.process[machine]
        loads = [(machine, unit) for unit in range(self.units)]
        over = {unit: self._shift() for unit in range(self.units)}
        turn = self._shift() if self.units > 1 else self.period
        for load in loads:
            unit = load[1]
            unload = (machine + 1, unit)
            ready = {self.start[unload]: 1.0, over[unit]: 1.0, self.start[load]: -1.0}
            for variable, factor in self.duration[load].items():
                ready[variable] = ready.get(variable, 0.0) - factor
            self.program.row(ready, low=process)
            following = loads[(unit + 1) % self.units]
            free = {self.start[following]: 1.0, self.start[unload]: -1.0, over[unit]: -1.0}
            for variable, factor in self.duration[unload].items():
                free[variable] = free.get(variable, 0.0) - factor
            free[turn] = free.get(turn, 0.0) + (1.0 if unit == self.units - 1 else -1.0)
            if unit < self.units - 1:
                free[self.period] = 1.0
            self.program.row(free, low=self._travel[machine + 1, machine])

    def _first_unit(self) -> None:
        """Where the units are alike, the second one begins in the first half of the period."""
        alike = not self.problem.own and not self.problem.own_hops
        if self.units > 1 and alike:
            self.program.row({self.start[0, 1]: 1.0, self.period: -0.5}, high=0.0)

    def _shift(self) -> int:
        """A time that is 0 or the period."""
        whole = self.program.binary()
        shift = self.program.variable(0.0, self.most)
        self.program.row({shift: 1.0, self.period: -1.0}, high=0.0)
        self.program.row({shift: 1.0, whole: -self.most}, high=0.0)
        self.program.row({shift: 1.0, self.period: -1.0, whole: -self.most}, low=-self.most)
        self.program.row({shift: 1.0, whole: -self.least}, low=0.0)
        self.program.row({shift: 1.0, self.period: -1.0, whole: -self.least}, high=-self.least)
        return shift

    def solve(self, stopped: Callable[[], bool] | None) -> SteadyCycle | None:
        answer = self.program.solve(stopped=stopped, gap=1e-6)
        if answer.values is None:
            return None
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
        return SteadyCycle(
            tuple(visits), float(values[self.period]), self.units, answer.cost, answer.bound
        )

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
