"""Machines, curves and modes drawn at random for a robot that tends them, and brute force over its
cycles: an independent judge.

It knows nothing of linear programs over orders: every order is tried, every choice of modes, and
durations on a grid, or (where the grid would be too large) times by a linear program of SciPy's for
that one order and those modes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
from scipy.optimize import linprog

from ir_planner.cycle import Curve, SteadyProblem, WaitMode

MODES = (
    WaitMode("motors", 0.0, 20.0, 0.0, 900.0),
    WaitMode("brakes", 1.5, 1e4, 900.0, 300.0),
)
NONE = WaitMode("", 0.0, 0.0, 0.0, 0.0)


def drawn_curve(rng: np.random.Generator, low: float, points: int) -> Curve:
    """Energy that falls with the square of the speed, and watts that are always there."""
    begin = rng.uniform(low, 3.0 * low)
    seconds = begin + np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 1.5, points - 1))])
    joules = rng.uniform(800.0, 6000.0) * (begin / seconds) ** 2 + rng.uniform(200, 600) * seconds
    return Curve.below(zip(seconds.tolist(), joules.tolist(), strict=True))


def drawn(seed: int, machines: int, points: int = 4) -> SteadyProblem:
    rng = np.random.default_rng([seed, machines])
    count = machines + 1
    return SteadyProblem(
        activities=tuple(drawn_curve(rng, 2.0, points) for _ in range(count)),
        hops={
            (j, i): drawn_curve(rng, 1.0, points)
            for j in range(count)
            for i in range(count)
            if i not in (j, j + 1)
        },
        after=((),) * count,
        before=(MODES,) * count,
        process=tuple(rng.uniform(2.0, 30.0, machines).tolist()),
    )


def one_hop(problem: SteadyProblem) -> SteadyProblem:
    """The same with hops of one duration each, the shortest."""
    hops = {arc: Curve(curve.seconds[:1], curve.joules[:1]) for arc, curve in problem.hops.items()}
    return replace(problem, hops=hops)


def orders(activities: int, units: int = 1) -> Iterator[tuple[int, ...]]:
    """All cyclic orders in which every activity comes `units` times, activity 0 first."""
    left = {a: units - (a == 0) for a in range(activities)}

    def longer(order: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
        if len(order) == units * activities:
            yield order
        for a in left:
            if left[a] > 0:
                left[a] -= 1
                yield from longer((*order, a))
                left[a] += 1

    yield from longer((0,))


def least_by_orders(problem: SteadyProblem, period: float, units: int = 1) -> float:
    """Least joules of a cycle of so many units: every order, every number of parts that machines
    may have when it begins, every choice of a mode at every wait.
    """
    best = np.inf
    modes = [each if each == MODES[:1] else (*each, NONE) for each in problem.before]
    for order in orders(len(problem.activities), units):
        for full in product(*(range(places + 1) for places in problem.places)):
            pairs = list(stays(order, full, problem.places))
            if not pairs:
                continue
            for chosen in product(*(modes[a] for a in order)):
                found = _least_of_order(problem, period * units, order, chosen, pairs)
                best = min(best, found)
    return best


Stay = tuple[int, int, int, int]
"""A part in a machine: which machine, where in the order it comes and where it leaves, and after
how many whole cycles.
"""


def stays(order: tuple[int, ...], full: tuple[int, ...], places: tuple[int, ...]) -> Iterator[Stay]:
    """The parts in the machines, first in, first out, of a cycle that goes on and on; none where a
    machine would have too many or none to take.
    """
    inside = list(full)
    for a in order:
        if a > 0:
            inside[a - 1] -= 1
        if a < len(full):
            inside[a] += 1
        if any(not 0 <= parts <= most for parts, most in zip(inside, places, strict=True)):
            return
    for machine, parts in enumerate(full):
        loads = [k for k, a in enumerate(order) if a == machine]
        unloads = [k for k, a in enumerate(order) if a == machine + 1]
        for number, load in enumerate(loads):
            leaves = number + parts
            yield machine, load, unloads[leaves % len(loads)], leaves // len(loads)


def _least_of_order(
    problem: SteadyProblem,
    period: float,
    order: tuple[int, ...],
    chosen: tuple[WaitMode, ...],
    pairs: list[Stay],
) -> float:
    """Least joules of one order, with these modes before its activities. Unknown: for each place in
    the order the seconds and joules of activity and hop, and the wait before the activity; for each
    part in a machine when its process begins.
    """
    n = len(order)
    size = 5 * n + len(pairs)
    cost = np.zeros(size)
    rows: list[np.ndarray] = []
    right: list[float] = []
    bounds: list[tuple[float | None, float | None]] = []
    for k, a in enumerate(order):
        hop = problem.hops.get((a, order[(k + 1) % n]))
        for base, curve in ((5 * k, problem.activities[a]), (5 * k + 2, hop)):
            if curve is None:
                bounds += [(0.0, 0.0), (0.0, 0.0)]
                continue
            bounds += [(curve.seconds[0], curve.seconds[-1]), (None, None)]
            cost[base + 1] = 1.0
            corners = list(zip(curve.seconds, curve.joules, strict=True))
            for (s0, j0), (s1, j1) in pairwise(corners):
                slope = (j1 - j0) / (s1 - s0)
                row = np.zeros(size)
                row[base] = slope
                row[base + 1] = -1.0
                rows.append(row)
                right.append(slope * s0 - j0)
            if len(corners) == 1:
                bounds[-1] = (corners[0][1], None)
        cost[5 * k + 4] = chosen[k].watts
        bounds.append((chosen[k].shortest, chosen[k].longest))
    bounds += [(None, None)] * len(pairs)
    rows.append(_whole(n, size))
    right.append(period)
    for row, most in _machine_rows(problem, order, pairs):
        rows.append(row)
        right.append(most)
    fixed = sum(mode.joules for mode in chosen)
    answer = linprog(cost, A_ub=np.array(rows), b_ub=right, bounds=bounds, method="highs")
    if answer.status != 0 or answer.fun is None:
        return np.inf
    return float(answer.fun) + fixed


def _whole(n: int, size: int) -> np.ndarray:
    """The row of the cycle's length."""
    whole = np.zeros(size)
    for column in (0, 2, 4):
        whole[column : 5 * n : 5] = 1.0
    return whole


def _machine_rows(
    problem: SteadyProblem, order: tuple[int, ...], pairs: list[Stay]
) -> Iterator[tuple[np.ndarray, float]]:
    """Rows at most so much: a process begins when its part is there and one of those that the
    machine works on at once is finished, and its part is taken after it.
    """
    n = len(order)
    size = 5 * n + len(pairs)
    whole = _whole(n, size)
    begins = [np.zeros(size)]  # of the activities, after the one at place 0 has begun
    for k in range(n - 1):
        begins.append(begins[-1].copy())
        begins[-1][[5 * k, 5 * k + 2, 5 * k + 9]] = 1.0
    own: dict[int, list[int]] = {}
    for index, (machine, load, unload, cycles) in enumerate(pairs):
        begun = np.zeros(size)
        begun[5 * n + index] = 1.0
        end = begins[load].copy()
        end[5 * load] = 1.0
        yield end - begun, 0.0
        yield begun - begins[unload] - cycles * whole, -problem.process[machine]
        own.setdefault(machine, []).append(5 * n + index)
    for machine, columns in own.items():
        for number, column in enumerate(columns):
            earlier = number - problem.capacity[machine]
            row = np.zeros(size)
            row[columns[earlier % len(columns)]] += 1.0
            row[column] -= 1.0
            yield row + (earlier // len(columns)) * whole, -problem.process[machine]


def least_on_grid(problem: SteadyProblem, period: float, points: int, step: float) -> float:
    """Least joules of a cycle of one unit: every order, every activity and hop at `points`
    durations, one wait at every `step` s, whichever it is; the other waits as short as the
    machines allow, each in its cheapest mode.
    """
    best = np.inf
    for order in orders(len(problem.activities)):
        n = len(order)
        curves = []
        for k, a in enumerate(order):
            curves += [problem.activities[a], problem.hops.get((a, order[(k + 1) % n]))]
        grids = [np.array([0.0]) if c is None else _between(c, points) for c in curves]
        rest = np.arange(0.0, max(problem.process) + step, step)
        *lengths, more = np.meshgrid(*grids, rest, indexing="ij")
        joules = sum(
            np.interp(length, c.seconds, c.joules)
            for c, length in zip(curves, lengths, strict=True)
            if c is not None
        )
        moving = sum(lengths)
        for longer in range(n):
            waits = _waits(problem, order, lengths, longer, more)
            standing = sum(
                _cheapest(problem.before[a], wait) for a, wait in zip(order, waits, strict=True)
            )
            late = moving + sum(waits) > period + 1e-9
            best = min(best, float(np.where(late, np.inf, joules + standing).min()))
    return best


def _between(curve: Curve, points: int) -> np.ndarray:
    """Durations of a curve; one where it has no other."""
    count = points if len(curve.seconds) > 1 else 1
    return np.linspace(curve.seconds[0], curve.seconds[-1], count)


def _waits(
    problem: SteadyProblem,
    order: tuple[int, ...],
    lengths: list[np.ndarray],
    longer: int,
    more: np.ndarray,
) -> list[np.ndarray]:
    """The shortest waits before the activities of a steady cycle, the one at place `longer` longer
    by `more`, by letting it run until nothing changes.
    """
    n = len(order)
    added = [more if k == longer else np.zeros_like(more) for k in range(n)]
    waits = added
    for _ in range(2 * n):
        waits = list(waits)
        for k, a in enumerate(order):
            if a == 0:
                continue
            since = np.zeros_like(lengths[0])
            i = order.index(a - 1)
            since = since + lengths[2 * i + 1]
            i = (i + 1) % n
            while i != k:
                since = since + waits[i] + lengths[2 * i] + lengths[2 * i + 1]
                i = (i + 1) % n
            waits[k] = np.maximum(problem.process[a - 1] - since, added[k])
    return waits


def _cheapest(modes: tuple[WaitMode, ...], seconds: np.ndarray) -> np.ndarray:
    best = np.where(seconds <= 1e-12, 0.0, np.inf)
    for mode in modes:
        fits = (seconds >= mode.shortest) & (seconds <= mode.longest)
        best = np.minimum(best, np.where(fits, mode.joules + mode.watts * seconds, np.inf))
    return best
