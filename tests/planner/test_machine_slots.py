"""Machines that hold several parts, as steps of a program: followed from the steps alone, no part
is taken before it is finished or out of its turn, no machine holds more than its places or works
on more than its capacity, and the line comes to the period of the cycle.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judge of the benchmark

from _steady_judge import drawn, drawn_curve

from ir_description import Cell, ProgramStep, cell_from_yaml, cell_to_yaml, load_cell
from ir_planner.cycle import (
    SteadyCycle,
    SteadyProblem,
    Visit,
    cheapest_cycle,
    fastest_cycle,
)
from ir_planner.flexible.cycle_program import (
    CycleLengths,
    MachineSlots,
    cycle_program,
    run_program,
)
from ir_planner.flexible.tending_cell import machines_of, with_copies, with_signals

CELL = load_cell("flexible")
MACHINES = 3
CYCLES = 6
ROUNDING = 5e-3  # s: a wait ends with its machine's work within a thousandth


def roomy(seed: int, capacities: list[int], buffers: list[int]) -> SteadyProblem:
    problem = drawn(seed, MACHINES, 3)
    rng = np.random.default_rng(seed)
    hops = {(a, a): drawn_curve(rng, 1.0, 3) for a in range(MACHINES + 1)}
    return replace(
        problem,
        hops={**problem.hops, **hops},
        capacities=tuple(capacities),
        buffers=tuple(buffers),
    )


def cell_of(problem: SteadyProblem) -> Cell:
    """The bundled cell with the machines of a problem."""
    places = dict(zip(machines_of(CELL)[1:-1], range(MACHINES), strict=True))
    machines = tuple(
        replace(
            machine,
            process=problem.process[places[machine.name]],
            capacity=problem.capacity[places[machine.name]],
            buffer=problem.places[places[machine.name]] - problem.capacity[places[machine.name]],
        )
        if machine.name in places
        else machine
        for machine in CELL.equipment
    )
    return replace(CELL, equipment=machines, program=(), signals=())


def written(problem: SteadyProblem, cycle: SteadyCycle, *, empty: bool) -> Cell:
    """The cell in which the steps of the cycle are written."""
    cell = cell_of(problem)
    assert cell.route is not None
    held = zip(cell.route.visits[1:-1], cycle.full, cycle.most, strict=True)
    places = [s if k < full and not empty else "" for s, full, most in held for k in range(most)]
    standing = with_copies(cell, dict(enumerate([*places, ""], 1)))
    fronts = {name: cell.station(name).pose for name in cell.route.visits}
    slots = MachineSlots(standing, cycle).finished(empty=empty)
    return with_signals(cell, standing, fronts, slots)


def lengths_of(problem: SteadyProblem, cycle: SteadyCycle) -> CycleLengths:
    """Those of the cycle; hops that it doesn't have are as fast as they can be."""
    nodes = {(visit.activity, visit.unit): visit.seconds for visit in cycle.visits}
    hops = {
        ((a, unit), b): curve.seconds[0]
        for (a, b), curve in problem.hops.items()
        for unit in range(cycle.units)
    }
    for visit, after in zip(cycle.visits, (*cycle.visits[1:], cycle.visits[0]), strict=True):
        hops[(visit.activity, visit.unit), after.activity] = visit.hop
    return CycleLengths(nodes, hops)


def transports(
    cell: Cell, steps: tuple[ProgramStep, ...], cycle: SteadyCycle, units: tuple[int, ...]
) -> list[Visit]:
    """The visits that the steps make."""
    assert cell.route is not None
    made = [cell.route.visits.index(step.target) for step in steps if step.attach]
    visits = {(visit.activity, visit.unit): visit for visit in cycle.visits}
    return [visits[node] for node in zip(made, units, strict=True)]


def followed(
    cell: Cell, steps: tuple[ProgramStep, ...], visits: list[Visit], lengths: CycleLengths
) -> list[float]:
    """When parts leave [s]; what must not be fails. visits: of the transports, in order."""
    assert cell.route is not None
    stations = cell.route.visits
    start = cell.parts_at_start()
    there = {station: list(start.at(station)) for station in stations[1:-1]}
    done = {signal.follows: signal.name for signal in cell.signals if signal.process}
    ready = {signal.name: 0.0 for signal in cell.signals if signal.process and signal.initial}
    ends: dict[str, list[float]] = {station: [] for station in stations}
    left = []
    now = 0.0
    transport = iter(visits)
    visit = visits[0]
    moving = False
    for step in steps:
        if step.kind == "PAUSE":
            now += step.dwell
        elif step.attach:
            visit = next(transport)
            moving = True
            assert step.target == stations[visit.activity]
            assert [now >= ready.pop(s.name) - ROUNDING for s in step.wait_for] in ([], [True])
            if step.target in there:
                assert there[step.target].pop(0) == step.attach
        elif step.detach:
            if step.target in there:
                there[step.target].append(step.detach)
                machine = cell.machine(cell.station(step.target).equipment)
                assert len(there[step.target]) <= machine.places
        elif moving:
            moving = False
            now += lengths.activities[visit.activity, visit.unit]
            here = stations[visit.activity + 1]
            assert step.target == f"{here}.front"
            left += [now] if here == stations[-1] else []
            for signal in step.set_signals:
                machine = cell.machine(cell.station(here).equipment)
                busy = sorted(end for end in ends[here] if end > now)[-machine.capacity :]
                begin = busy[0] if len(busy) == machine.capacity else now
                assert done[signal.name] not in ready
                ready[done[signal.name]] = begin + machine.process
                ends[here].append(begin + machine.process)
        else:
            now += lengths.hop(visit, stations.index(step.target.removesuffix(".front")))
    return left


@settings(max_examples=5, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    capacities=st.lists(st.integers(1, 3), min_size=MACHINES, max_size=MACHINES),
    buffers=st.lists(st.integers(0, 2), min_size=MACHINES, max_size=MACHINES),
    over=st.sampled_from([1.001, 1.2]),
)
def test_parts_go_through_slots_in_turn_and_none_is_taken_too_soon(
    seed: int, capacities: list[int], buffers: list[int], over: float
) -> None:
    problem = roomy(seed, capacities, buffers)
    fastest = fastest_cycle(problem)
    assert fastest is not None
    once = cheapest_cycle(problem, period=over * fastest.period)
    assert once is not None
    cycle = once.repeated(once.turns)
    lengths = lengths_of(problem, cycle)
    for empty in (False, True):
        cell = written(problem, cycle, empty=empty)
        if empty:
            steps, units = run_program(cell, cycle, lengths, CYCLES)
        else:
            steps = cycle_program(cell, cycle)
            units = tuple(visit.unit for visit in cycle.visits)
        assert cell_from_yaml(cell_to_yaml(replace(cell, program=steps))).program == steps
        left = followed(cell, steps, transports(cell, steps, cycle, units), lengths)
        if empty:
            assert len(left) >= CYCLES * cycle.units
            last = left[-1] - left[-1 - cycle.units]
            assert last == pytest.approx(cycle.period, abs=ROUNDING * len(cycle.visits))


@pytest.mark.long
@settings(max_examples=3, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    capacities=st.lists(st.integers(1, 2), min_size=MACHINES, max_size=MACHINES),
    buffers=st.lists(st.integers(0, 1), min_size=MACHINES, max_size=MACHINES),
    machine=st.integers(0, MACHINES - 1),
)
def test_with_room_slower_lines_and_faster_machines_are_never_dearer(
    seed: int, capacities: list[int], buffers: list[int], machine: int
) -> None:
    problem = roomy(seed, capacities, buffers)
    fastest = fastest_cycle(problem)
    assert fastest is not None
    sooner = replace(
        problem,
        process=tuple(s * (0.6 if k == machine else 1.0) for k, s in enumerate(problem.process)),
    )
    least = np.inf
    for over in (1.001, 1.1, 1.5):
        cycle = cheapest_cycle(problem, period=over * fastest.period)
        quick = cheapest_cycle(sooner, period=over * fastest.period)
        assert cycle is not None
        assert quick is not None
        assert cycle.joules <= least * (1.0 + 2e-6)  # each is within a millionth of the least
        assert quick.joules <= cycle.joules * (1.0 + 2e-6)
        least = cycle.joules
