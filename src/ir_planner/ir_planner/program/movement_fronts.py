"""Movements of one chain at many time values [W]: for every part a front of time and energy."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ir_kernels import portable
from ir_planner.program.cost_bounds import Rates
from ir_planner.program.movements import Failure, Movements, WarmStarts, cost_of, rates_of
from ir_planner.program.request import StageError
from ir_planner.program.station_graph import ACROSS, HopPart
from ir_planner.request import Context
from ir_planner.timing import Movement

# The movements of a program at many values of a second: a fixed ladder of them, so that requests
# that differ in their cycle time choose among the same movements.
#
# Movements are searched at the request's own value, at one in the middle of the ladder and for time
# alone; at the rungs beside these they are optimised again from the best of the movements there.
# Along service lines, which hardly change with the value, they are those of the searched rungs,
# slowed down.

# times the robot's price of a second: a second less of moving and more of waiting on brakes saves
# more than that
_LEAST = 0.5
# between two rungs: a mixture of neighbours is within about a percent of the rung between
_STEP = float(np.sqrt(2.0))
# up to 362 times (a KR 210: 181 kW): from 45 times on movements are within a percent of the
# fastest, but a cycle just above the shortest lies there, and the last of that percent costs more
# than anything before
_RUNGS = 20
LADDER = tuple(float(_LEAST * portable.power(_STEP, k)) for k in range(_RUNGS))
FASTEST = _RUNGS  # the rung on which time alone counts
_MIDDLE = 8  # 8 times: 4 kW
_REACH = 3.01  # rungs: paths change little over three times the value, and above the middle
_SAME = 1e-6  # rungs


@dataclass(frozen=True, eq=False)
class KnownMovements:
    """Movements of parts that are known whatever was planned."""

    movements: Mapping[HopPart, Movement]

    def movement(self, part: HopPart) -> Movement | None:
        """The movement of a part; None where none is known."""
        return self.movements.get(part)


class Ladder:
    """Movements by rung; own: those of the request. improvement: work of each movement."""

    def __init__(self, own: Movements, improvement: int) -> None:
        self.own = own
        self.improvement = improvement
        self._rungs: dict[tuple[int, int], Movements] = {}
        rates = rates_of(own.context)
        price = own.context.scene.cell.robot.time_value
        value = rates.second / rates.joule / price if rates.joule else np.inf
        searched = own.context.options.objective != "movement_cost"
        place = (
            float((portable.log(value) - portable.log(_LEAST)) / portable.log(_STEP))
            if value > 0.0
            else -np.inf
        )
        self._place = (float(FASTEST) if np.isinf(value) else place) if searched else -np.inf

    @property
    def first(self) -> int:
        """The rung nearest to the request's own value."""
        return int(np.clip(round(self._place), 0, FASTEST)) if np.isfinite(self._place) else 0

    def at(self, rung: int) -> Movements:
        """Movements at a rung."""
        return self._kept(rung, len(LADDER))

    def roughly(self, rung: int) -> Movements:
        """The same from those searched at the nearest value alone: to choose among many chains."""
        return self._kept(rung, 1)

    def _kept(self, rung: int, most: int) -> Movements:
        movements = self._searched(rung)[:most]
        key = rung, len(movements)
        if key not in self._rungs:
            self._rungs[key] = self._made(rung, movements)
        return self._rungs[key]

    def _made(self, rung: int, known: tuple[Movements, ...]) -> Movements:
        first = self.own
        if abs(rung - self._place) < _SAME:
            return first
        near = WarmStarts(known, self._lines(rung), self._scaling(rung))
        return Movements(first.route, first.layers, self._context(rung), first.searches, near)

    def _context(self, rung: int) -> Context:
        first = self.own.context
        if rung == FASTEST:
            return first.asking("time")
        robot = first.scene.cell.robot
        slower = replace(
            first.asking("time_and_energy").options, time_value=LADDER[rung] * robot.time_value
        )
        return replace(first, options=slower)

    def rates(self, rung: int) -> Rates:
        """What is minimised at a rung."""
        return rates_of(self._context(rung))

    def from_others(self, rung: int, known: Mapping[HopPart, Movement]) -> dict[HopPart, Movement]:
        """Movements across at a rung, by descent from given ones; those of the parts for which one
        is found. None where movements are not found by descent.
        """
        first = self.own
        again = Movements(
            first.route,
            first.layers,
            self._context(rung),
            first.searches,
            WarmStarts((KnownMovements(known),)),
        )
        if not again.descends:
            return {}
        planned = zip(known, again.plan(list(known), self.improvement), strict=True)
        return {part: movement for part, movement in planned if not isinstance(movement, Failure)}

    def _searched(self, rung: int) -> tuple[Movements, ...]:
        """Searched movements, of the nearest value first, from which those of a rung are optimised;
        none where these are searched. They are the same for every cycle time, so that a longer one
        knows what a shorter one does: the local minimum of one value may be better at another than
        that one's own.
        """
        places: dict[float, Movements | None] = {FASTEST: None}
        if abs(_MIDDLE - self._place) >= _REACH:
            places[_MIDDLE] = None
        places[self._place] = self.own
        nearest = sorted(places, key=lambda place: abs(place - rung))
        if rung in places or (rung < _MIDDLE and abs(nearest[0] - rung) >= _REACH):
            return ()
        searched = [place for place in nearest if np.isfinite(place)]
        return tuple(places[place] or self.at(int(place)) for place in searched)

    def _lines(self, rung: int) -> tuple[Movements, ...]:
        """Movements along service lines that are slowed down at a rung; none where they are
        searched.
        """
        if rung in (_MIDDLE, FASTEST):
            return ()
        if rung < self._place <= _MIDDLE:
            return (self.own,)
        return self.own, self.at(_MIDDLE if rung < _MIDDLE else FASTEST)

    def _scaling(self, rung: int) -> Movements | None:
        """Movements from whose time scaling faster ones along service lines are searched."""
        return self.own if -np.inf < self._place < rung else None


# The movements of one chain at many values of a second: a Pareto front of time and energy for
# every part.
#
# What a second is worth decides how fast a movement is: planned at the same value, all movements
# of a program trade seconds for joules at the same rate, which is the best distribution of the
# time there is.
#
# A movement of one value may be in a poorer local minimum than that of another: near the cycle time
# that is asked for, such a one is optimised again from the better one.

# of the cost at a value: a movement that costs more than another one by that is optimised again
_POOR = 1e-3


class FrontPoint(NamedTuple):
    """A certified movement of a part, with its seconds and the drives' joules."""

    movement: Movement
    seconds: float
    joules: float

    @staticmethod
    def of(movement: Movement) -> "FrontPoint":
        """The point of a movement."""
        joules = cost_of(movement.consumption, Rates(1.0, 0.0))
        return FrontPoint(movement, movement.trajectory.duration, joules)

    def cost(self, rates: Rates) -> float:
        """What it costs by other rates."""
        return rates.joule * self.joules + rates.second * self.seconds


class SlowDown(NamedTuple):
    """From a point of a part to the next slower one: seconds more, joules less."""

    part: HopPart
    to: int
    seconds: float
    joules: float


class TimeValues:
    """Points of the parts of one chain on a ladder of values."""

    def __init__(self, ladder: Ladder, parts: Sequence[HopPart]) -> None:
        self.ladder = ladder
        self.parts = tuple(parts)
        self._points: dict[HopPart, list[FrontPoint]] = {part: [] for part in self.parts}
        self._seconds: dict[int, float] = {}
        self._exchanged: set[tuple[int, HopPart]] = set()
        self._own_seconds = self._take(ladder.own)

    def seconds(self, rung: int) -> float:
        """How long the chain's movements take at a rung [s]; they are planned there."""
        if rung not in self._seconds:
            self._seconds[rung] = self._take(self.ladder.at(rung))
        return self._seconds[rung]

    @property
    def shortest(self) -> float:
        """How long the fastest movements take that are known [s]."""
        return sum(min(point.seconds for point in points) for points in self._points.values())

    @property
    def fastest(self) -> dict[HopPart, Movement]:
        """The fastest movements that are known."""
        return {
            part: min(points, key=lambda p: p.seconds).movement
            for part, points in self._points.items()
        }

    @property
    def own_seconds(self) -> float:
        """How long the movements of the chain's own request take [s]."""
        return self._own_seconds

    def _take(self, movements: Movements) -> float:
        seconds = 0.0
        planned = movements.plan(self.parts, self.ladder.improvement)
        for part, answer in zip(self.parts, planned, strict=True):
            if not isinstance(answer, Failure):
                self._points[part].append(FrontPoint.of(answer))
                seconds += self._points[part][-1].seconds
            elif movements is self.ladder.own:
                raise StageError(answer.status)
            else:  # what is known has to do
                seconds += min(point.seconds for point in self._points[part])
        return seconds

    def bracket(self, seconds: float, first: int | None = None) -> int:
        """Plan at neighbouring rungs between which the movements take `seconds`; the faster of
        both. first:
        the rung to begin at, None: at the request's own value.
        """
        slow = -1
        fast = FASTEST
        work = self.ladder.own.context.work
        rung = self.ladder.first if first is None else first
        step = 1
        while True:  # in growing steps
            late = self.seconds(rung) > seconds
            slow, fast = (max(slow, rung), fast) if late else (slow, min(fast, rung))
            beyond = rung + step if late else rung - step
            if not slow < beyond < fast or work.exhausted:
                break
            rung = beyond
            step = 2 * step
        while fast - slow > 1 and not work.exhausted:
            middle = (slow + fast) // 2
            slow, fast = (middle, fast) if self.seconds(middle) > seconds else (slow, middle)
        self.seconds(fast)
        self._exchange(rung for rung in (slow, fast) if rung in self._seconds)
        return fast

    def _exchange(self, rungs: Iterable[int]) -> None:
        """Movements that cost more at a rung than one of another value does are optimised again
        from it.
        """
        ladder = self.ladder
        for rung in rungs:
            rates = ladder.rates(rung)
            poor = dict[HopPart, Movement]()
            for part, points in self._points.items():
                present = ladder.at(rung).movement(part)
                best = min(points, key=lambda point: point.cost(rates))
                if present is None or part.kind != ACROSS or (rung, part) in self._exchanged:
                    continue
                if best.cost(rates) < (1.0 - _POOR) * FrontPoint.of(present).cost(rates):
                    poor[part] = best.movement
            self._exchanged.update((rung, part) for part in poor)
            if poor and not ladder.own.context.work.exhausted:
                for part, rival in ladder.from_others(rung, poor).items():
                    self._points[part].append(FrontPoint.of(rival))

    def least(self, value: float) -> float:
        """What the chain costs at a value of a second [W], by all movements that are known."""
        return sum(
            min(p.joules + value * p.seconds for p in points) for points in self._points.values()
        )

    def fronts(self) -> dict[HopPart, list[FrontPoint]]:
        """The convex Pareto front of every part, fastest first."""
        return {part: convex_front(points) for part, points in self._points.items()}


def convex_front(points: Sequence[FrontPoint]) -> list[FrontPoint]:
    """Points below which no mixture of two others lies, fastest first: each slower one saves
    joules, and fewer per second than the one before.
    """
    front: list[FrontPoint] = []
    for point in sorted(points, key=lambda p: (p.seconds, p.joules)):
        if front and point.joules >= front[-1].joules:
            continue
        while len(front) > 1 and _saving(front[-2], front[-1]) <= _saving(front[-1], point):
            front.pop()
        front.append(point)
    return front


def _saving(fast: FrontPoint, slow: FrontPoint) -> float:
    """Joules saved per second between two points."""
    more = slow.seconds - fast.seconds
    return (fast.joules - slow.joules) / more if more > 0.0 else np.inf


def slow_downs(fronts: dict[HopPart, list[FrontPoint]]) -> list[SlowDown]:
    """All steps to slower points, those that save most joules per second first."""
    steps = [
        SlowDown(part, k + 1, b.seconds - a.seconds, a.joules - b.joules)
        for part, front in fronts.items()
        for k, (a, b) in enumerate(itertools.pairwise(front))
    ]
    return sorted(steps, key=lambda step: -step.joules / max(step.seconds, 1e-12))
