"""The joint cycle of least energy of several robots, each of which repeats its own program.

A robot does its movements in turn, with a wait before each. Where two robots could meet they share
a zone: a stretch of movements of the one, and one of the other, that never go on at the same time.
In every cycle each of them passes the zone once, so they take turns, and one number says who is
first: 0 or 1. Decided together: who is first in every zone, how the robots are shifted, the
duration of every movement on its convex curve, and how long and in which power modes they wait.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ir_planner.cycle import Curve, LinearProgram, ModeWait, WaitMode
from ir_values.arrays import FloatArray

Stopped = Callable[[], bool]
"""Whether a search has to end."""

NEVER: Stopped = lambda: False  # noqa: E731 - a default argument
_NO_WAIT = 1e-6  # s
_SERIAL = 2.0  # times the seconds of one robot after the other: no shortest cycle is longer


@dataclass(frozen=True)
class Lag:
    """The movement `later` begins at least so many seconds after `earlier` has ended."""

    earlier: int
    later: int
    seconds: float


@dataclass(frozen=True)
class ArmWork:
    """movements: the curve of each; standing: seconds of what is done before each, and its joules;
    modes: of the wait that may follow that. lags: between movements of the same cycle where the
    later one comes after the earlier one, else of one cycle and the next.
    """

    movements: tuple[Curve, ...]
    standing: tuple[tuple[float, float], ...]
    modes: tuple[tuple[WaitMode, ...], ...]
    lags: tuple[Lag, ...] = ()

    @property
    def shortest(self) -> float:
        """The least seconds of a cycle by itself."""
        moving = sum(curve.seconds[0] for curve in self.movements)
        return moving + sum(seconds for seconds, _ in self.standing)


@dataclass(frozen=True, order=True)
class ZoneStretch:
    """`count` movements of a robot from number `first` on, with the stops between them; over the
    end of its program it goes on at its begin.
    """

    robot: int
    first: int
    count: int


@dataclass(frozen=True, order=True)
class ExclusiveZone:
    """Two stretches that never go on at the same time. first: robots that have to pass it before
    the other one in every cycle; of both, no cycle is possible.
    """

    one: ZoneStretch
    other: ZoneStretch
    first: tuple[int, ...] = ()


@dataclass(frozen=True)
class ArmSchedule:
    """begin: when each movement begins [s from the begin of the first robot's cycle]; seconds: of
    each; waits: before each.
    """

    begin: tuple[float, ...]
    seconds: tuple[float, ...]
    waits: tuple[tuple[ModeWait, ...], ...]


@dataclass(frozen=True)
class JointCycle:
    """period [s], joules of all robots in it; bound: no schedule of these curves and zones takes
    less. later: of each zone, whether its second robot passes before the first one.
    """

    period: float
    joules: float
    bound: float
    arms: tuple[ArmSchedule, ...]
    later: tuple[bool, ...]


def shortest_joint(
    works: Sequence[ArmWork], zones: Sequence[ExclusiveZone], stopped: Stopped = NEVER
) -> JointCycle | None:
    """The shortest cycle; None where the zones leave none, or none was found before it was
    `stopped`.
    """
    alone = max(work.shortest for work in works)
    together = sum(work.shortest for work in works)
    lags = sum(lag.seconds for work in works for lag in work.lags)
    model = _Model(works, zones, (alone, _SERIAL * together + lags))
    return model.solve({model.period: 1.0}, stopped)


def cheapest_joint(
    works: Sequence[ArmWork],
    zones: Sequence[ExclusiveZone],
    period: float,
    stopped: Stopped = NEVER,
) -> JointCycle | None:
    """The cycle of least energy within a period [s]; None where there is none, or none was found
    before it was `stopped`.
    """
    model = _Model(works, zones, (period, period))
    return model.solve(model.costs, stopped)


class _Model:
    """The mixed-integer linear program."""

    def __init__(
        self, works: Sequence[ArmWork], zones: Sequence[ExclusiveZone], period: tuple[float, float]
    ) -> None:
        self._works = works
        self._zones = zones
        self._program = LinearProgram()
        self._high = period[1]
        self.period = self._program.variable(*period)
        self.costs: dict[int, float] = {}
        self._fixed = 0.0
        self._parts: list[list[list[tuple[int, float]]]] = []
        self._waits: list[list[list[tuple[int, int, WaitMode]]]] = []
        self._begin = [self._of_arm(k, work) for k, work in enumerate(works)]
        self._later = [self._of_zone(zone) for zone in zones]

    def _of_arm(self, robot: int, work: ArmWork) -> list[int]:
        """Begins of the movements of a robot, and of the first one of its next cycle: variables of
        the program, to which all others of the robot are added.

        A movement lasts its shortest time and what its cheaper parts add; a wait in exactly one
        mode follows.
        """
        program = self._program
        far = 0.0 if robot == 0 else self._high
        begin = [program.variable(-far, far)]
        self._parts.append([])
        self._waits.append([])
        count = len(work.movements)
        for k, curve in enumerate(work.movements):
            parts = []
            for length, slope in curve.segments:
                part = program.variable(0.0, length)
                self.costs[part] = slope
                parts.append((part, length))
            after = (k + 1) % count
            waits = self._waits_in(work.modes[after])
            standing_seconds, standing_joules = work.standing[after]
            fixed = curve.seconds[0] + standing_seconds
            self._fixed += curve.joules[0] + standing_joules
            end = program.variable(-np.inf, np.inf)
            terms = {end: 1.0, begin[-1]: -1.0}
            terms |= {part: -1.0 for part, _ in parts}
            terms |= {lasts: -1.0 for _, lasts, _ in waits}
            program.row(terms, low=fixed, high=fixed)
            begin.append(end)
            self._parts[robot].append(parts)
            self._waits[robot].append(waits)
        program.row({begin[-1]: 1.0, begin[0]: -1.0, self.period: -1.0}, low=0.0, high=0.0)
        for lag in work.lags:
            terms = {begin[lag.later]: 1.0, begin[lag.earlier]: -1.0}
            terms |= {part: -1.0 for part, _ in self._parts[robot][lag.earlier]}
            if lag.later <= lag.earlier:  # in the next cycle
                terms[self.period] = 1.0
            program.row(terms, low=lag.seconds + work.movements[lag.earlier].seconds[0])
        return begin

    def _end(self, stretch: ZoneStretch) -> tuple[dict[int, float], float]:
        """Terms and constant of the end of a stretch: of its last movement."""
        work = self._works[stretch.robot]
        count = len(work.movements)
        last = stretch.first + stretch.count - 1
        begin = self._begin[stretch.robot][last % count]
        terms = {begin: 1.0}
        if last >= count:
            terms[self.period] = 1.0
        for part, _ in self._parts[stretch.robot][last % count]:
            terms[part] = 1.0
        return terms, work.movements[last % count].seconds[0]

    def _of_zone(self, zone: ExclusiveZone) -> int:
        """Whether the second stretch is before the first one: it is passed in the period before."""
        program = self._program
        later = program.binary()
        for robot in zone.first:
            fixed = float(robot == zone.other.robot)
            program.row({later: 1.0}, low=fixed, high=fixed)
        back = program.variable(0.0, self._high)  # later x period
        program.row({back: 1.0, later: -self._high}, high=0.0)
        program.row({back: 1.0, self.period: -1.0}, high=0.0)
        program.row({back: 1.0, self.period: -1.0, later: -self._high}, low=-self._high)
        # end of one <= begin of other + back; end of other + back <= begin of one + period
        for ends, begins, sign in ((zone.one, zone.other, 1.0), (zone.other, zone.one, -1.0)):
            terms, seconds = self._end(ends)
            begin = self._begin[begins.robot][begins.first]
            terms[begin] = terms.get(begin, 0.0) - 1.0
            terms[back] = terms.get(back, 0.0) - sign
            if sign < 0.0:
                terms[self.period] = terms.get(self.period, 0.0) - 1.0
            program.row(terms, high=-seconds)
        return later

    def solve(self, costs: Mapping[int, float], stopped: Stopped) -> JointCycle | None:
        """The schedule of least costs."""
        for variable, cost in costs.items():
            self._program.cost[variable] = cost
        answer = self._program.solve(stopped=stopped)
        if answer.values is None:
            return None
        values = answer.values
        joules = self._fixed + sum(cost * values[k] for k, cost in self.costs.items())
        arms = [self._schedule(k, values) for k in range(len(self._works))]
        later = tuple(bool(values[variable] > 0.5) for variable in self._later)
        period = float(values[self.period])
        return JointCycle(period, float(joules), self._fixed + answer.bound, tuple(arms), later)

    def _waits_in(self, modes: Sequence[WaitMode]) -> list[tuple[int, int, WaitMode]]:
        """A wait in exactly one of the modes: for each that the period has time for the variable
        that chooses it, the one that says how long it lasts [s], and the mode.
        """
        program = self._program
        waits = []
        for mode in modes:
            longest = min(mode.longest, self._high)
            if mode.shortest > longest:
                continue
            chosen = program.binary()
            lasts = program.variable(0.0, longest)
            # as long as the mode may last where it is chosen, else 0
            program.row({lasts: 1.0, chosen: -longest}, high=0.0)
            program.row({lasts: 1.0, chosen: -mode.shortest}, low=0.0)
            self.costs[chosen] = mode.joules
            self.costs[lasts] = mode.watts
            waits.append((chosen, lasts, mode))
        program.row({chosen: 1.0 for chosen, _, _ in waits}, low=1.0, high=1.0)
        return waits

    def _schedule(self, robot: int, values: FloatArray) -> ArmSchedule:
        """Begins, durations and waits [s] of a robot's movements, from all variables' values."""
        begins = tuple(float(values[k]) for k in self._begin[robot][:-1])
        work = self._works[robot]
        seconds = []
        for curve, parts in zip(work.movements, self._parts[robot], strict=True):
            longer = sum(float(values[part]) for part, _ in parts)
            seconds.append(curve.seconds[0] + longer)
        waits: list[tuple[ModeWait, ...]] = []
        for options in self._waits[robot]:
            _, lasts, mode = next(each for each in options if values[each[0]] > 0.5)
            length = float(values[lasts])
            waits.append((ModeWait(mode.name, length),) if length > _NO_WAIT else ())
        # the wait after the last movement is before the first one of the next cycle
        return ArmSchedule(begins, tuple(seconds), (waits[-1], *waits[:-1]))


# The zones of a pair of robots, from what could meet. A robot's activities in turn are: a stop (0),
# the movement after it (1), the next stop (2) .. Pairs of activities that could meet are cells of a
# torus. Nothing passes between cells that share a side, so they are one zone, and with it the
# rectangle that holds them.


def zones_of(
    robots: tuple[int, int],
    counts: tuple[int, int],
    meeting: Mapping[tuple[int, int], Iterable[int]],
) -> tuple[ExclusiveZone, ...]:
    """Zones of two robots of `counts` movements. meeting: pairs of activities that could meet, with
    the robots that have to pass first; where a stop could, so must the movements beside it. A zone
    whose stretch is a whole program is passed by no cycle.
    """
    around = 2 * counts[0], 2 * counts[1]
    groups = [_Group((a, 1), (b, 1), frozenset(first)) for (a, b), first in sorted(meeting.items())]
    k = 0
    while k < len(groups):
        joined = next((j for j in range(k) if groups[k].touches(groups[j], around)), None)
        if joined is None:
            k += 1
            continue
        groups[joined] = groups[joined].with_(groups.pop(k), around)
        k = joined
    return tuple(sorted(group.zone(robots, counts) for group in groups))


Span = tuple[int, int]  # the first activity, and how many


@dataclass(frozen=True)
class _Group:
    one: Span
    other: Span
    first: frozenset[int]

    def touches(self, group: _Group, around: tuple[int, int]) -> bool:
        """Whether a side is shared: they overlap along one program, and at least follow each other
        along the other one.
        """
        near = [
            _nearness(own, its, count)
            for own, its, count in zip(
                (self.one, self.other), (group.one, group.other), around, strict=True
            )
        ]
        return min(near) > 0 and max(near) > 1

    def with_(self, group: _Group, around: tuple[int, int]) -> _Group:
        """The rectangle of both."""
        one = _span_of_both(self.one, group.one, around[0])
        other = _span_of_both(self.other, group.other, around[1])
        return _Group(one, other, self.first | group.first)

    def zone(self, robots: tuple[int, int], counts: tuple[int, int]) -> ExclusiveZone:
        """The zone in movements of the two robots instead of groups."""
        stretches = [
            ZoneStretch(robot, span[0] // 2, min((span[1] + span[0] % 2 + 1) // 2, count))
            for robot, span, count in zip(robots, (self.one, self.other), counts, strict=True)
        ]
        return ExclusiveZone(stretches[0], stretches[1], tuple(sorted(self.first)))


def _nearness(one: Span, other: Span, around: int) -> int:
    """2: they overlap, 1: they follow each other, 0: something lies between."""
    ahead = (other[0] - one[0]) % around
    behind = (one[0] - other[0]) % around
    if ahead < one[1] or behind < other[1]:
        return 2
    return int(ahead == one[1] or behind == other[1])


def _span_of_both(one: Span, other: Span, around: int) -> Span:
    """The shortest span of two that touch."""
    spans = []
    for a, b in ((one, other), (other, one)):
        ahead = (b[0] - a[0]) % around
        if ahead <= a[1]:
            spans.append((a[0], min(max(a[1], ahead + b[1]), around)))
    return min(spans, key=lambda span: span[1])
