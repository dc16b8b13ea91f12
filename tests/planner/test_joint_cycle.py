"""The joint cycle of several robots on drawn curves and zones: its laws, and a judge that knows the
zones and the schedule alone.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from scipy.optimize import linprog

from ir_planner.cycle import Curve, WaitMode
from ir_planner.robots.joint_cycle import (
    ArmWork,
    ExclusiveZone,
    JointCycle,
    ZoneStretch,
    cheapest_joint,
    shortest_joint,
    zones_of,
)

MODES = (
    WaitMode("motors", 0.0, 20.0, 0.0, 900.0),
    WaitMode("brakes", 1.5, 1e4, 900.0, 300.0),
)
ROUNDING = 1e-5  # of seconds and joules


def drawn_curve(rng: np.random.Generator) -> Curve:
    begin = rng.uniform(0.8, 2.5)
    seconds = begin + np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 1.5, 3))])
    joules = rng.uniform(800.0, 6000.0) * (begin / seconds) ** 2 + rng.uniform(200, 600) * seconds
    return Curve.below(zip(seconds.tolist(), joules.tolist(), strict=True))


def drawn_work(rng: np.random.Generator, count: int) -> ArmWork:
    return ArmWork(
        tuple(drawn_curve(rng) for _ in range(count)),
        tuple((float(s), 900.0 * float(s)) for s in rng.uniform(0.0, 0.6, count)),
        (MODES,) * count,
    )


def drawn(seed: int, robots: int = 2) -> tuple[list[ArmWork], list[ExclusiveZone]]:
    """Robots with a zone or two between each pair of neighbours, none over the end of a program."""
    rng = np.random.default_rng([seed, robots])
    works = [drawn_work(rng, int(rng.integers(4, 7))) for _ in range(robots)]
    zones = []
    for k in range(robots - 1):
        for side in range(int(rng.integers(1, 3))):
            stretches = [
                ZoneStretch(robot, 2 * side, int(rng.integers(1, 3))) for robot in (k, k + 1)
            ]
            zones.append(ExclusiveZone(stretches[0], stretches[1]))
    return works, zones


def cheapest(works: list[ArmWork], zones: list[ExclusiveZone], period: float) -> JointCycle:
    found = cheapest_joint(works, zones, period)
    assert found is not None
    return found


def stretch_times(cycle: JointCycle, stretch: ZoneStretch) -> tuple[float, float]:
    arm = cycle.arms[stretch.robot]
    last = stretch.first + stretch.count - 1
    return arm.begin[stretch.first], arm.begin[last] + arm.seconds[last]


def judge(cycle: JointCycle, works: list[ArmWork], zones: list[ExclusiveZone]) -> float:
    """Joules of a schedule; what isn't right about it fails."""
    joules = 0.0
    for arm, work in zip(cycle.arms, works, strict=True):
        count = len(work.movements)
        for k, curve in enumerate(work.movements):
            assert curve.seconds[0] - ROUNDING <= arm.seconds[k] <= curve.seconds[-1] + ROUNDING
            joules += curve.at(arm.seconds[k])
            after = arm.begin[(k + 1) % count] + (cycle.period if k + 1 == count else 0.0)
            between = after - arm.begin[k] - arm.seconds[k] - work.standing[(k + 1) % count][0]
            waits = arm.waits[(k + 1) % count]
            assert sum(wait.seconds for wait in waits) == pytest.approx(between, abs=ROUNDING)
            joules += work.standing[(k + 1) % count][1]
            for wait in waits:
                mode = next(m for m in MODES if m.name == wait.mode)
                assert mode.shortest - ROUNDING <= wait.seconds <= mode.longest + ROUNDING
                joules += mode.joules + mode.watts * wait.seconds
    for zone in zones:
        one, other = (stretch_times(cycle, each) for each in (zone.one, zone.other))
        for shift in range(-3, 4):
            moved = [time + shift * cycle.period for time in other]
            assert moved[0] >= one[1] - ROUNDING or moved[1] <= one[0] + ROUNDING
    return joules


@pytest.mark.sampled
@pytest.mark.parametrize(
    "seed", [*range(2), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(2, 6))]
)
@pytest.mark.parametrize("robots", [2, 3])
def test_schedules_keep_their_zones_and_cost_what_they_say(seed: int, robots: int) -> None:
    works, zones = drawn(seed, robots)
    fastest = shortest_joint(works, zones)
    assert fastest is not None
    judge(fastest, works, zones)
    assert fastest.period >= max(work.shortest for work in works) - ROUNDING
    for factor in (1.001, 1.1, 1.4):
        cycle = cheapest(works, zones, factor * fastest.period)
        assert judge(cycle, works, zones) == pytest.approx(cycle.joules, rel=1e-6)
        assert cycle.bound <= cycle.joules * (1.0 + 1e-6)
    assert cheapest_joint(works, zones, 0.99 * fastest.period) is None


@pytest.mark.parametrize("seed", range(4))
def test_without_a_zone_robots_cost_the_sum_of_both(seed: int) -> None:
    works, _ = drawn(seed)
    period = 1.2 * max(work.shortest for work in works)
    alone = [cheapest([work], [], period).joules for work in works]
    assert cheapest(works, [], period).joules == pytest.approx(sum(alone), rel=1e-6)


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(4))
def test_a_zone_never_makes_a_cycle_cheaper_and_the_order_of_robots_says_nothing(seed: int) -> None:
    works, zones = drawn(seed)
    fastest = shortest_joint(works, zones)
    assert fastest is not None
    period = 1.05 * fastest.period
    with_zones = cheapest(works, zones, period).joules
    assert with_zones >= cheapest(works, zones[:1], period).joules * (1.0 - 1e-6)
    assert with_zones >= cheapest(works, [], period).joules * (1.0 - 1e-6)
    turned = [
        ExclusiveZone(replace(zone.other, robot=0), replace(zone.one, robot=1)) for zone in zones
    ]
    other = shortest_joint(works[::-1], turned)
    assert other is not None
    assert other.period == pytest.approx(fastest.period, rel=1e-6)
    assert cheapest(works[::-1], turned, period).joules == pytest.approx(with_zones, rel=1e-5)


def test_the_best_order_is_that_of_all_orders() -> None:
    works, zones = drawn(3)
    fastest = shortest_joint(works, zones)
    assert fastest is not None
    period = 1.1 * fastest.period
    orders = product(*[(zone.one.robot, zone.other.robot) for zone in zones])
    found = [
        cheapest_joint(
            works, [replace(z, first=(f,)) for z, f in zip(zones, first, strict=True)], period
        )
        for first in orders
    ]
    least = min(each.joules for each in found if each is not None)
    assert cheapest(works, zones, period).joules == pytest.approx(least, rel=1e-6)


def least_by_orders(
    works: list[ArmWork], zones: list[ExclusiveZone], period: float, cycles: range
) -> float:
    """Least joules of two robots: every order in every zone, every mode of every wait, and for each
    a linear program of SciPy's. cycles: by how many the second robot may be late in a zone.
    """
    best = np.inf
    modes = [[None, *each] for work in works for each in work.modes]
    free = tuple(WaitMode("", 0.0, period, 0.0, 0.0) for _ in modes)
    for late in product(cycles, repeat=len(zones)):
        if not np.isfinite(least_of_order(works, zones, period, late, free)):
            continue
        for chosen in product(*modes):
            best = min(best, least_of_order(works, zones, period, late, chosen))
    return best


def least_of_order(
    works: list[ArmWork],
    zones: list[ExclusiveZone],
    period: float,
    late: tuple[int, ...],
    chosen: tuple[WaitMode | None, ...],
) -> float:
    """Unknown: the begin of the second robot, then of each movement its seconds, its joules and the
    wait before it; the first robot's first movement begins at 0.
    """
    curves = [curve for work in works for curve in work.movements]
    firsts = (0, len(works[0].movements))
    size = 1 + 3 * len(curves)
    rows: list[np.ndarray] = []
    right: list[float] = []

    def at_most(row: np.ndarray, bound: float) -> None:
        rows.append(row)
        right.append(bound)

    cost = np.zeros(size)
    bounds: list[tuple[float | None, float | None]] = [(-period, period)]
    for k, (curve, mode) in enumerate(zip(curves, chosen, strict=True)):
        own = 1 + 3 * k
        cost[own + 1] = 1.0
        cost[own + 2] = 0.0 if mode is None else mode.watts
        bounds += [(curve.seconds[0], curve.seconds[-1]), (None, None)]
        bounds.append((0.0, 0.0) if mode is None else (mode.shortest, mode.longest))
        for (s0, j0), (s1, j1) in pairwise(zip(curve.seconds, curve.joules, strict=True)):
            row = np.zeros(size)
            row[own] = (j1 - j0) / (s1 - s0)
            row[own + 1] = -1.0
            at_most(row, row[own] * s0 - j0)
    begins: list[tuple[np.ndarray, float]] = []
    for robot, work in enumerate(works):
        here = np.zeros(size)
        here[0] = float(robot)
        still = 0.0
        for k in range(len(work.movements)):
            if k > 0:
                here = here.copy()
                still += work.standing[k][0]
                here[1 + 3 * (firsts[robot] + k - 1)] = 1.0
                here[3 + 3 * (firsts[robot] + k)] = 1.0
            begins.append((here, still))
        whole = np.zeros(size)
        own = slice(1 + 3 * firsts[robot], 1 + 3 * (firsts[robot] + len(work.movements)))
        whole[own][0::3] = 1.0
        whole[own][2::3] = 1.0
        standing = sum(seconds for seconds, _ in work.standing)
        at_most(whole, period - standing)
        at_most(-whole, standing - period)
    for zone, cycles in zip(zones, late, strict=True):
        spans = []
        for stretch in (zone.one, zone.other):
            first = firsts[stretch.robot] + stretch.first
            last = first + stretch.count - 1
            end = begins[last][0].copy()
            end[1 + 3 * last] += 1.0
            spans.append((begins[first], (end, begins[last][1])))
        (one, one_end), (other, other_end) = spans
        at_most(one_end[0] - other[0], other[1] - one_end[1] + cycles * period)
        at_most(other_end[0] - one[0], one[1] - other_end[1] + (1 - cycles) * period)
    fixed = sum(joules for work in works for _, joules in work.standing)
    fixed += sum(mode.joules for mode in chosen if mode is not None)
    answer = linprog(cost, A_ub=np.array(rows), b_ub=right, bounds=bounds, method="highs")
    return float(answer.fun) + fixed if answer.status == 0 else np.inf


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.long) for k in (1, 2, 3))])
@pytest.mark.parametrize("factor", [1.001, pytest.param(1.4, marks=pytest.mark.long)])
def test_brute_force_over_orders_and_modes_agrees(seed: int, factor: float) -> None:
    rng = np.random.default_rng([seed, 11])
    works = [drawn_work(rng, 2), drawn_work(rng, 3)]
    zones = [ExclusiveZone(ZoneStretch(0, 0, 1), ZoneStretch(1, int(rng.integers(2)), 1))]
    if seed > 1:
        zones.append(ExclusiveZone(ZoneStretch(0, 1, 1), ZoneStretch(1, 2, 1)))
    fastest = shortest_joint(works, zones)
    assert fastest is not None
    period = factor * fastest.period
    least = least_by_orders(works, zones, period, range(-1, 3))
    cycle = cheapest(works, zones, period)
    assert cycle.joules == pytest.approx(least, rel=1e-6)
    assert cycle.bound == pytest.approx(least, rel=1e-6)


def test_who_has_to_be_first_is_and_both_cannot_be() -> None:
    works, zones = drawn(1)
    for zone in zones:
        for first in (zone.one.robot, zone.other.robot):
            asked = [replace(zone, first=(first,))]
            cycle = shortest_joint(works, asked)
            assert cycle is not None
            assert cycle.later == (first == zone.other.robot,)
        both = [replace(zone, first=(zone.one.robot, zone.other.robot))]
        assert shortest_joint(works, both) is None


@pytest.mark.parametrize("seed", range(30))
def test_every_meeting_is_in_one_zone_and_zones_leave_something_between(seed: int) -> None:
    rng = np.random.default_rng(seed)
    counts = (int(rng.integers(3, 8)), int(rng.integers(3, 8)))
    cells = {
        (2 * int(rng.integers(counts[0])) + 1, 2 * int(rng.integers(counts[1])) + 1): ()
        for _ in range(int(rng.integers(1, 6)))
    }
    for a, b in list(cells):  # some stops with the movements beside them
        if rng.random() < 0.5:
            around = 2 * counts[0]
            cells |= {((a + step) % around, b): () for step in (1, 2)}
    zones = zones_of((4, 7), counts, cells)

    def within(stretch: ZoneStretch, activity: int, count: int) -> bool:
        return (activity - 2 * stretch.first - 1) % (2 * count) < 2 * stretch.count - 1

    for a, b in cells:
        held = [z for z in zones if within(z.one, a, counts[0]) and within(z.other, b, counts[1])]
        whole = any(z.one.count == counts[0] or z.other.count == counts[1] for z in zones)
        assert len(held) == 1 or whole
    again = zones_of((4, 7), counts, dict(reversed(list(cells.items()))))
    assert again == zones
    turned = zones_of((7, 4), counts[::-1], {(b, a): () for a, b in cells})
    assert sorted(ExclusiveZone(z.other, z.one) for z in turned) == list(zones)
