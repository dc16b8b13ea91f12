"""The cheapest steady cycle against brute force, and the laws that it keeps, on drawn machines,
curves and modes.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judge of the benchmark

from _steady_judge import MODES, drawn, drawn_curve, least_by_orders, least_on_grid, one_hop

from ir_planner.cycle import (
    SteadyCycle,
    SteadyProblem,
    cheapest_cycle,
    fastest_cycle,
    in_turn,
    shared_among,
)

EXACT = 1e-6  # both are exact: what solvers round


def cheapest(problem: SteadyProblem, period: float, units: int = 1) -> SteadyCycle:
    cycle = cheapest_cycle(problem, period=period, units=units)
    assert cycle is not None
    return cycle


def shortest(problem: SteadyProblem) -> float:
    cycle = fastest_cycle(problem)
    assert cycle is not None
    return cycle.period


def faults(problem: SteadyProblem, cycle: SteadyCycle) -> list[str]:
    """What a cycle that runs on and on would do wrong, from its visits alone."""
    found = []
    here = 0.0
    for visit, following in zip(cycle.visits, (*cycle.visits[1:], cycle.visits[0]), strict=True):
        waits = (*visit.after, *following.before)
        here += visit.seconds + visit.hop + sum(wait.seconds for wait in waits)
        begin = cycle.period if following is cycle.visits[0] else following.start
        if abs(here - begin) > 1e-5:
            found.append(f"activity {following.activity} is reached at {here}, not at {begin}")
    rounds = range(4)
    for machine, process in enumerate(problem.process):
        loads, unloads = (
            sorted(
                (visit.start + k * cycle.period, visit.seconds)
                for visit in cycle.visits
                for k in rounds
                if visit.activity == activity
            )
            for activity in (machine, machine + 1)
        )
        first = loads[0][0] + loads[0][1]
        unloads = [each for each in unloads if each[0] >= first - 1e-6]
        for load, following, unload in zip(loads[:-1], loads[1:], unloads, strict=False):
            if unload[0] - load[0] - load[1] < process - 1e-5:
                found.append(f"machine {machine} has {unload[0] - load[0] - load[1]} s")
            if unload[0] + unload[1] > following[0] + 1e-5:
                found.append(f"machine {machine} is full when the next part comes")
    return found


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("machines", "seed"),
    [
        (2, 0),
        (3, 0),
        *(pytest.param(*each, marks=pytest.mark.long) for each in ((2, 1), (2, 2), (3, 1))),
    ],
)
@pytest.mark.parametrize("over", [1.0001, 1.3])
def test_brute_force_over_all_orders_and_modes_agrees(
    machines: int, seed: int, over: float
) -> None:
    problem = drawn(seed, machines, 3)
    period = over * shortest(problem)
    cycle = cheapest(problem, period)
    assert cycle.joules == pytest.approx(least_by_orders(problem, period), rel=EXACT)
    assert cycle.bound == pytest.approx(cycle.joules, rel=EXACT)
    assert faults(problem, cycle) == []


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_brute_force_agrees_with_a_buffer_between_two_machines(seed: int) -> None:
    """A place where a part only lies, and where there is none the next one may be put."""
    problem = drawn(seed, 3, 3)
    problem = replace(problem, process=(problem.process[0], 0.0, problem.process[2]))
    period = 1.05 * shortest(problem)
    cycle = cheapest(problem, period)
    assert cycle.joules == pytest.approx(least_by_orders(problem, period), rel=EXACT)
    assert faults(problem, cycle) == []


@pytest.mark.parametrize(
    ("seed", "machines"),
    [(0, 3), *(pytest.param(*each, marks=pytest.mark.long) for each in ((1, 3), (0, 4), (1, 4)))],
)
def test_brute_force_agrees_for_cycles_of_two_parts(seed: int, machines: int) -> None:
    problem = roomy(seed, machines, (1,) * machines, (0,) * machines)
    period = 1.02 * shortest(problem)
    least = least_by_orders(problem, period, 2)
    cycle = cheapest(problem, period, 2)
    assert cycle.joules == pytest.approx(least, rel=EXACT)
    assert cycle.bound == pytest.approx(least, rel=EXACT)
    assert faults(problem, cycle) == []


ROOM = [((2, 1), (0, 0)), ((1, 1), (0, 1)), ((1, 2), (1, 0)), ((2, 2), (1, 1))]


def roomy(
    seed: int, machines: int, capacities: tuple[int, ...], buffers: tuple[int, ...]
) -> SteadyProblem:
    """Drawn machines with one power mode, among which robots also go straight back."""
    problem = drawn(seed, machines, 2)
    rng = np.random.default_rng([seed, 7])
    back = {(a, a): drawn_curve(rng, 1.0, 2) for a in range(machines + 1)}
    return replace(
        problem,
        hops={**problem.hops, **back},
        before=(MODES[:1],) * (machines + 1),
        process=tuple(rng.uniform(5.0, 40.0, machines).tolist()),
        capacities=capacities,
        buffers=buffers,
    )


@pytest.mark.parametrize("seed", [6, pytest.param(7, marks=pytest.mark.long)])
@pytest.mark.parametrize(("capacities", "buffers"), ROOM)
@pytest.mark.parametrize("units", [1, 2])
def test_brute_force_agrees_where_machines_hold_several_parts(
    seed: int, capacities: tuple[int, ...], buffers: tuple[int, ...], units: int
) -> None:
    problem = roomy(seed, 2, capacities, buffers)
    period = 1.01 * shortest(roomy(seed, 2, (1, 1), (0, 0)))
    least = least_by_orders(problem, period, units)
    cycle = cheapest(problem, period, units)
    assert cycle.joules == pytest.approx(least, rel=EXACT)
    assert cycle.bound == pytest.approx(least, rel=EXACT)


def test_two_parts_a_cycle_can_be_cheaper_than_one() -> None:
    problem = roomy(6, 2, (1, 2), (1, 0))
    period = 1.01 * shortest(roomy(6, 2, (1, 1), (0, 0)))
    one = cheapest(problem, period).joules
    assert cheapest(problem, period, 2).joules / 2.0 < 0.95 * one


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in (1, 2))]
)
@pytest.mark.parametrize("units", [1, 2])
def test_more_room_in_a_machine_never_makes_the_cycle_dearer(seed: int, units: int) -> None:
    problem = roomy(seed, 3, (1, 1, 1), (0, 0, 0))
    period = 1.01 * shortest(problem)
    before = cheapest(problem, period, units).joules
    for machine in range(3):
        more = tuple(2 if m == machine else 1 for m in range(3))
        one = tuple(int(m == machine) for m in range(3))
        buffered = cheapest(replace(problem, buffers=one), period, units).joules
        doubled = cheapest(replace(problem, capacities=more), period, units).joules
        assert buffered <= before * (1.0 + EXACT)
        assert doubled <= buffered * (1.0 + EXACT)  # who works on both at once needs no buffer


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_brute_force_agrees_for_four_machines(seed: int) -> None:
    problem = drawn(seed, 4, 3)
    period = 1.05 * shortest(problem)
    cycle = cheapest(problem, period)
    assert cycle.joules == pytest.approx(least_by_orders(problem, period), rel=EXACT)


@pytest.mark.parametrize("seed", range(3))
def test_a_fine_grid_of_durations_agrees(seed: int) -> None:
    problem = drawn(seed, 2, 2)
    period = 1.05 * shortest(problem)
    least = least_on_grid(problem, period, 4, 0.1)
    found = cheapest(problem, period).joules
    assert found <= least * (1.0 + EXACT)
    assert found == pytest.approx(least, rel=0.005)


@pytest.mark.parametrize(
    ("machines", "seed"),
    [
        (3, 0),
        pytest.param(4, 0, marks=pytest.mark.long),
        pytest.param(4, 1, marks=pytest.mark.long),
    ],
)
def test_a_fine_grid_agrees_for_more_machines_where_every_hop_has_one_duration(
    machines: int, seed: int
) -> None:
    problem = one_hop(drawn(seed, machines, 2))
    period = 1.05 * shortest(problem)
    least = least_on_grid(problem, period, 5, 0.2)
    found = cheapest(problem, period).joules
    assert found <= least * (1.0 + EXACT)
    assert found == pytest.approx(least, rel=0.005)


@pytest.mark.parametrize(("seed", "machines", "units"), [(0, 2, 1), (1, 3, 1), (2, 2, 2)])
def test_energy_per_part_never_rises_when_the_throughput_falls(
    seed: int, machines: int, units: int
) -> None:
    problem = drawn(seed, machines)
    least = np.inf
    for over in (1.0001, 1.05, 1.2, 1.6, 3.0):
        cycle = cheapest(problem, over * shortest(problem), units)
        assert faults(problem, cycle) == []
        assert cycle.joules / units <= least * (1.0 + EXACT)
        least = cycle.joules / units


@pytest.mark.parametrize("seed", range(4))
def test_a_faster_machine_never_makes_the_cycle_dearer(seed: int) -> None:
    problem = drawn(seed, 3)
    period = 1.02 * shortest(problem)
    before = cheapest(problem, period).joules
    for machine in range(3):
        process = list(problem.process)
        process[machine] *= 0.6
        faster = replace(problem, process=tuple(process))
        assert cheapest(faster, period).joules <= before * (1.0 + EXACT)


@pytest.mark.parametrize("seed", range(6))
def test_one_order_without_process_costs_its_movements_in_turn(seed: int) -> None:
    """What a program of these movements costs in at most that time: the curves say it alone."""
    problem = replace(drawn(seed, 1), process=(0.0,))
    together = in_turn([*problem.activities, problem.hops[1, 0]])
    assert shortest(problem) == pytest.approx(together.seconds[0])
    for over in (1.0001, 1.1, 1.5, 3.0):
        period = over * together.seconds[0]
        corners = [s for s in together.seconds if s < period]
        last = min(period, together.seconds[-1])
        least = min(together.at(seconds) for seconds in (*corners, last))
        assert cheapest(problem, period).joules == pytest.approx(least, rel=EXACT)


@pytest.mark.parametrize("seed", range(3))
def test_two_units_are_never_dearer_than_one(seed: int) -> None:
    problem = drawn(seed, 2)
    period = 1.02 * shortest(problem)
    two = cheapest(problem, period, 2)
    assert two.joules / 2.0 <= cheapest(problem, period).joules * (1.0 + EXACT)
    assert faults(problem, two) == []


def test_a_period_that_is_too_short_has_no_cycle() -> None:
    problem = drawn(0, 2)
    assert cheapest_cycle(problem, period=0.99 * shortest(problem)) is None


@pytest.mark.parametrize("seed", range(5))
def test_movements_in_turn_take_the_least_energy_of_their_time_together(seed: int) -> None:
    rng = np.random.default_rng(seed)
    curves = [drawn_curve(rng, 1.0, 4) for _ in range(3)]
    together = in_turn(curves)
    for seconds in np.linspace(together.seconds[0], together.seconds[-1], 7):
        taken = shared_among(curves, float(seconds))
        joules = sum(curve.at(each) for curve, each in zip(curves, taken, strict=True))
        assert sum(taken) == pytest.approx(seconds)
        assert joules == pytest.approx(together.at(float(seconds)))
        for _ in range(50):
            other = [rng.uniform(curve.seconds[0], curve.seconds[-1]) for curve in curves]
            spent = sum(curve.at(each) for curve, each in zip(curves, other, strict=True))
            assert spent >= together.at(sum(other)) - 1e-6
