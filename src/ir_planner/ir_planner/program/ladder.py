"""The movements of a program at many values of a second: a fixed ladder of them, so that requests
that differ in their cycle time choose among the same movements.

Movements are searched at the request's own value, at one in the middle of the ladder and for time
alone; at the rungs beside these they are optimised again from the best of the movements there.
Along service lines, which hardly change with the value, they are those of the searched rungs,
slowed down.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ir_kernels import portable
from ir_planner.program.bounds import Rates
from ir_planner.program.movements import Failure, Movements, Near, rates_of
from ir_planner.program.station_graph import Part
from ir_planner.request import Context
from ir_planner.timing import Movement

_LEAST = 250.0  # W: a second less of moving and more of waiting on brakes saves more than that
# between two rungs: a mixture of neighbours is within about a percent of the rung between
_STEP = float(np.sqrt(2.0))
# up to 181 kW: from 22 kW on movements are within a percent of the fastest, but a cycle just above
# the shortest lies there, and the last of that percent costs more than anything before
_RUNGS = 20
LADDER = tuple(float(_LEAST * portable.power(_STEP, k)) for k in range(_RUNGS))
FASTEST = _RUNGS  # the rung on which time alone counts
_MIDDLE = 8  # 4 kW
_REACH = 3.01  # rungs: paths change little over three times the value, and above the middle
_SAME = 1e-6  # rungs


@dataclass(frozen=True, eq=False)
class Kept:
    """Movements of parts that are known whatever was planned."""

    movements: Mapping[Part, Movement]

    def movement(self, part: Part) -> Movement | None:
        """The movement of a part; None where none is known."""
        return self.movements.get(part)


class Ladder:
    """Movements by rung; own: those of the request. improvement: work of each movement."""

    def __init__(self, own: Movements, improvement: int) -> None:
        self.own = own
        self.improvement = improvement
        self._rungs: dict[tuple[int, int], Movements] = {}
        rates = rates_of(own.context)
        value = rates.second / rates.joule if rates.joule else np.inf
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
        known = self._searched(rung)[:most]
        key = rung, len(known)
        if key not in self._rungs:
            self._rungs[key] = self._made(rung, known)
        return self._rungs[key]

    def _made(self, rung: int, known: tuple[Movements, ...]) -> Movements:
        own = self.own
        if abs(rung - self._place) < _SAME:
            return own
        near = Near(known, self._lines(rung), self._scaling(rung))
        return Movements(own.route, own.layers, self._context(rung), own.searches, near)

    def _context(self, rung: int) -> Context:
        own = self.own.context
        if rung == FASTEST:
            return own.asking("time")
        asked = replace(own.asking("time_and_energy").options, time_value=LADDER[rung])
        return replace(own, options=asked)

    def rates(self, rung: int) -> Rates:
        """What is minimised at a rung."""
        return rates_of(self._context(rung))

    def from_others(self, rung: int, known: Mapping[Part, Movement]) -> dict[Part, Movement]:
        """Movements across at a rung, by descent from given ones; those of the parts for which one
        is found. None where movements are not found by descent.
        """
        own = self.own
        again = Movements(
            own.route, own.layers, self._context(rung), own.searches, Near((Kept(known),))
        )
        if not again.descends:
            return {}
        planned = zip(known, again.plan(list(known), self.improvement), strict=True)
        return {part: found for part, found in planned if not isinstance(found, Failure)}

    def _searched(self, rung: int) -> tuple[Movements, ...]:
        """Searched movements, of the nearest value first, from which those of a rung are optimised;
        none where these are searched. They are the same for every cycle time, so that a longer one
        knows what a
        shorter one does: the local minimum of one value may be better at another than that one's
        own.
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
