"""Robotic cells drawn at random that have a schedule by construction."""

from __future__ import annotations

from itertools import product

import numpy as np

from ir_studies.cells.instance import (
    Conflict,
    DynamicActivity,
    EnergyCurve,
    Handover,
    HopMovement,
    Instance,
    InstanceRobot,
    StaticActivity,
    StopLocation,
    TimeLag,
)

_DIGITS = 6
_SLACK = 0.15  # of the cycle, over the busiest robot's hidden schedule
_PER_ROBOT = 1000  # numbers of activities and points per robot
_APART = 3  # stops between one hand-over and the next


class _Draw:
    """One robot with a hidden schedule."""

    def __init__(self, index: int, rng: np.random.Generator, stops: int) -> None:
        self.index = index
        self.rng = rng
        self.modes = {k: [0.0, 3.0, 8.0][k] for k in range(int(rng.integers(1, 4)))}
        first = index * _PER_ROBOT
        self.stops = [self._stop(first + k, last=k == stops - 1) for k in range(stops)]
        self.hops: list[DynamicActivity] = []
        self.intervals: dict[int, tuple[float, float, int]] = {}  # start, end, choice
        self._free_order(first + stops)

    def _number(self, low: float, high: float) -> float:
        return round(float(self.rng.uniform(low, high)), _DIGITS)

    def _stop(self, number: int, *, last: bool) -> StaticActivity:
        places = []
        for k in range(1 if last else int(self.rng.integers(1, 4))):
            watts = self._number(50.0, 100.0)
            power = {mode: round(watts * 0.5**mode, _DIGITS) for mode in self.modes}
            places.append(StopLocation(k, number * 10 + k, power))
        least = self._number(0.2, 3.0)
        return StaticActivity(
            number, least, round(least + self._number(20.0, 40.0), _DIGITS), tuple(places), last
        )

    def _free_order(self, number: int) -> None:
        """Hops in the order of the stops, and others by which inner stops may change places."""
        count = len(self.stops)
        free = set(range(1, min(4, count - 1)))  # these may come in any order
        edges = {(k, (k + 1) % count) for k in range(count)}
        edges |= {(a, b) for a in free for b in free if a != b}
        if free:
            edges |= {(0, a) for a in free} | {(a, max(free) + 1) for a in free}
        for k, (a, b) in enumerate(sorted(edges)):
            moves = []
            for one in self.stops[a].places:
                for other in self.stops[b].places:
                    least = self._number(0.5, 2.0)
                    most = round(least * self._number(2.0, 8.0), _DIGITS)
                    terms = tuple(
                        (p, self._number(*span))
                        for p, span in ((-1, (150.0, 400.0)), (0, (10.0, 60.0)), (1, (40.0, 90.0)))
                    )
                    curve = EnergyCurve(terms, least, most)
                    moves.append(HopMovement(len(moves), one.point, other.point, curve))
            ends = (self.stops[a].number, self.stops[b].number)
            self.hops.append(DynamicActivity(number + k, *ends, tuple(moves)))

    def hidden(self) -> float:
        """Go through the stops in order with random choices; the time that it takes."""
        chosen = [int(self.rng.integers(len(stop.places))) for stop in self.stops]
        at = 0.0
        count = len(self.stops)
        for k in range(-1, count - 1):
            hop = next(
                h
                for h in self.hops
                if (h.start, h.end) == (self.stops[k].number, self.stops[k + 1].number)
            )
            stop = self.stops[k + 1]
            points = (
                self.stops[k].places[chosen[k]].point,
                stop.places[chosen[k + 1]].point,
            )
            move = next(m for m in hop.movements if (m.start, m.end) == points)
            took = move.curve.least * 1.2
            self.intervals[hop.number] = (at, at + took, move.number)
            at += took
            self.intervals[stop.number] = (at, at + stop.least * 1.1, chosen[k + 1])
            at += stop.least * 1.1
        return at


def drawn(robots: int, stops: int, seed: int, conflicts: int = 12, handovers: int = 1) -> Instance:
    """A cell with a chain of hand-overs between its robots, so many between neighbours, and choices
    that exclude each other.
    """
    rng = np.random.default_rng((seed, robots, stops))
    draws = [_Draw(k, rng, stops) for k in range(robots)]
    totals = [draw.hidden() for draw in draws]
    cycle = round(max(totals) * (1.0 + _SLACK), _DIGITS)
    phases = [float(rng.uniform(0.0, cycle)) for _ in draws]
    for draw, total in zip(draws, totals, strict=True):
        closing = draw.stops[-1].number
        start, end, choice = draw.intervals[closing]
        draw.intervals[closing] = (start, end + cycle - total, choice)
        stop = draw.stops[-1]
        draw.stops[-1] = StaticActivity(stop.number, stop.least, cycle, stop.places, closes=True)
    lags = []
    fits = []
    for k, number in product(range(robots - 1), range(handovers)):
        giver = draws[k].stops[1 + _APART * number]
        taker = draws[k + 1].stops[1 + _APART * number + min(number, 1)]
        begin = phases[k] + draws[k].intervals[giver.number][0]
        taken = phases[k + 1] + draws[k + 1].intervals[taker.number][0]
        height = int(np.ceil((begin - taken) / cycle))
        lags.append(TimeLag(giver.number, taker.number, 0.0, height))
        back = int(np.ceil((taken - begin) / cycle)) + 1
        lags.append(TimeLag(taker.number, giver.number, 0.0, back))
        hidden = (
            draws[k].intervals[giver.number][2],
            draws[k + 1].intervals[taker.number][2],
        )
        others = [
            (a.number, b.number) for a in giver.places for b in taker.places if rng.random() < 0.5
        ]
        fits.append(Handover((giver.number, taker.number), frozenset([hidden, *others])))
    chosen = _exclusions(draws, phases, cycle, conflicts, rng) if robots > 1 else []
    made = tuple(
        InstanceRobot(f"robot {d.index}", tuple(d.stops), tuple(d.hops), d.modes) for d in draws
    )
    name = f"drawn_{robots}_{stops}_{seed}"
    return Instance(name, cycle, made, tuple(lags), tuple(fits), tuple(chosen))


def _exclusions(
    draws: list[_Draw], phases: list[float], cycle: float, count: int, rng: np.random.Generator
) -> list[Conflict]:
    """Pairs of choices of different robots that the hidden schedule keeps apart."""
    found: set[tuple[tuple[int, int], tuple[int, int]]] = set()
    for _ in range(100 * count):
        i, j = sorted(int(k) for k in rng.choice(len(draws), 2, replace=False))
        ends = []
        for k in (i, j):
            activities = [(s.number, len(s.places)) for s in draws[k].stops[:-1]]
            activities += [(h.number, len(h.movements)) for h in draws[k].hops]
            number, choices = activities[int(rng.integers(len(activities)))]
            ends.append((number, int(rng.integers(choices))))
        spans = [draws[k].intervals.get(end[0]) for k, end in zip((i, j), ends, strict=True)]
        together = all(
            span is not None and span[2] == end[1] for span, end in zip(spans, ends, strict=True)
        )
        if together and _overlap(spans, (phases[i], phases[j]), cycle):
            continue
        found.add((ends[0], ends[1]))
        if len(found) == count:
            break
    return [Conflict(*pair) for pair in sorted(found)]


def _overlap(
    spans: list[tuple[float, float, int] | None], phases: tuple[float, float], cycle: float
) -> bool:
    assert spans[0] is not None
    assert spans[1] is not None
    begin = (phases[1] + spans[1][0] - phases[0] - spans[0][0]) % cycle
    first = spans[0][1] - spans[0][0]
    second = spans[1][1] - spans[1][0]
    return begin < first + 1e-3 or begin + second > cycle - 1e-3
