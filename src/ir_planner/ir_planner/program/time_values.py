"""The movements of one chain at many values of a second, and the cheapest choice among them for a time.

What a second is worth decides how fast a movement is: planned at the same value, all movements of a program
trade seconds for joules at the same rate, which is the best distribution of the time there is. Values stand
on a fixed ladder, so that two requests that differ in their cycle time choose among the same movements.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_planner.program.bounds import Rates
from ir_planner.program.movements import Failure, Movements, cost_of
from ir_planner.program.request import StageError
from ir_planner.program.station_graph import Part
from ir_planner.timing import Movement

_LEAST = 250.0  # W: a second less of moving and more of waiting on brakes saves more than that
_STEP = 2.0**0.5  # between two rungs: a mixture of neighbours is within about a percent of the rung between
_RUNGS = 14  # up to 22 kW, where movements are as fast as they can be within a percent
LADDER = tuple(_LEAST * _STEP**k for k in range(_RUNGS))
FASTEST = _RUNGS  # the rung on which time alone counts


@dataclass(frozen=True, eq=False)
class Point:
    """A certified movement of a part, with its seconds and the drives' joules."""

    movement: Movement
    seconds: float
    joules: float

    @staticmethod
    def of(movement: Movement) -> "Point":
        """The point of a movement."""
        report = movement.report
        return Point(movement, movement.trajectory.duration, cost_of(report, Rates(1.0, 0.0)))


@dataclass(frozen=True)
class SlowDown:
    """From a point of a part to the next slower one: seconds more, joules less."""

    part: Part
    to: int
    seconds: float
    joules: float


class TimeValues:
    """Points of the parts of one chain; `movements` are those of the chain's own request."""

    def __init__(self, movements: Movements, parts: Sequence[Part], improvement: int) -> None:
        self.parts, self.improvement = tuple(parts), improvement
        self._rungs: dict[int, Movements] = {}
        self._own = movements
        self._points: dict[Part, list[Point]] = {part: [] for part in self.parts}
        self._take(movements)

    def at(self, rung: int) -> Movements:
        """Movements at a rung of the ladder; their parts along the chain are planned."""
        if rung not in self._rungs:
            self._rungs[rung] = movements = self.movements(rung)
            self._take(movements)
        return self._rungs[rung]

    def movements(self, rung: int) -> Movements:
        """Movements at a rung, nothing planned yet."""
        own = self._own
        if rung == FASTEST:
            context = own.context.asking("time")
        else:
            asked = replace(own.context.asking("time_and_energy").options, time_value=LADDER[rung])
            context = replace(own.context, options=asked)
        return Movements(own.route, own.layers, context, own.searches)

    def seconds(self, rung: int) -> float:
        """How long the chain's movements take at a rung [s]."""
        found = self.at(rung).plan(self.parts, self.improvement)
        return sum(m.trajectory.duration for m in found if not isinstance(m, Failure))

    def own_seconds(self) -> float:
        """How long the movements of the chain's own request take [s]."""
        found = self._own.plan(self.parts, self.improvement)
        return sum(m.trajectory.duration for m in found if not isinstance(m, Failure))

    def _take(self, movements: Movements) -> None:
        for part, found in zip(self.parts, movements.plan(self.parts, self.improvement), strict=True):
            if not isinstance(found, Failure):
                self._points[part].append(Point.of(found))
            elif movements is self._own:
                raise StageError(found.status)

    def bracket(self, seconds: float) -> int:
        """Plan at neighbouring rungs between which the movements take `seconds`; the faster of both."""
        slow, fast = -1, FASTEST
        while fast - slow > 1:
            middle = (slow + fast) // 2
            slow, fast = (middle, fast) if self.seconds(middle) > seconds else (slow, middle)
        self.at(fast)
        return fast

    def fronts(self) -> dict[Part, list[Point]]:
        """The convex Pareto front of every part, fastest first."""
        return {part: convex_front(points) for part, points in self._points.items()}


def convex_front(points: Sequence[Point]) -> list[Point]:
    """Points below which no mixture of two others lies, fastest first: each slower one saves joules, and
    fewer per second than the one before.
    """
    front: list[Point] = []
    for point in sorted(points, key=lambda p: (p.seconds, p.joules)):
        if front and point.joules >= front[-1].joules:
            continue
        while len(front) > 1 and _saving(front[-2], front[-1]) <= _saving(front[-1], point):
            front.pop()
        front.append(point)
    return front


def _saving(fast: Point, slow: Point) -> float:
    """Joules saved per second between two points."""
    more = slow.seconds - fast.seconds
    return (fast.joules - slow.joules) / more if more > 0.0 else np.inf


def slow_downs(fronts: dict[Part, list[Point]]) -> list[SlowDown]:
    """All steps to slower points, those that save most joules per second first."""
    steps = [
        SlowDown(part, k + 1, b.seconds - a.seconds, a.joules - b.joules)
        for part, front in fronts.items()
        for k, (a, b) in enumerate(itertools.pairwise(front))
    ]
    return sorted(steps, key=lambda step: -step.joules / max(step.seconds, 1e-12))
