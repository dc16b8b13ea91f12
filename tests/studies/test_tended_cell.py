"""A tended cell written for the public benchmark: read back and solved by another model, it costs
what the planner proves that no cycle can be below.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judge of the benchmark

from _cells_judge import energy, faults
from _steady_judge import drawn, drawn_curve

from ir_description import load_cell
from ir_planner import Planner
from ir_planner.cycle import SteadyCycle, SteadyProblem, WaitMode, cheapest_cycle, fastest_cycle
from ir_studies.cells import Instance, read_instances, solve_cell, tended_instance, written
from ir_studies.cells.tended_cell import cycle_instance

AGREED = 1e-4  # of the energy: hops of a millisecond
HOPS = 1e-3  # of the energy: the same where periods are short
MODES = (
    WaitMode("motors", 0.0, 1e4, 0.0, 900.0),
    WaitMode("brakes", 1.5, 1e4, 900.0, 300.0),
)


def roomy(
    seed: int, machines: int, capacities: tuple[int, ...], buffers: tuple[int, ...]
) -> SteadyProblem:
    """Drawn machines that hold several parts, among which robots also go straight back."""
    problem = drawn(seed, machines, 2)
    rng = np.random.default_rng([seed, 7])
    back = {(a, a): drawn_curve(rng, 1.0, 2) for a in range(machines + 1)}
    return replace(
        problem,
        hops={**problem.hops, **back},
        before=(MODES,) * (machines + 1),
        process=tuple(rng.uniform(5.0, 40.0, machines).tolist()),
        capacities=capacities,
        buffers=buffers,
    )


def read_again(instance: Instance, file: Path) -> Instance:
    file.write_text(written([instance]))
    (again,) = read_instances(file)
    return again


@pytest.mark.parametrize(
    ("seed", "capacities", "buffers", "units"),
    [
        (0, (1, 1), (0, 0), 2),
        (1, (2, 1), (0, 0), 1),
        (3, (1, 1), (1, 0), 1),
        *(
            pytest.param(*each, marks=pytest.mark.long)
            for each in (
                (2, (2, 1), (0, 1), 2),
                (4, (1, 2, 1), (0, 0, 0), 2),
                (5, (1, 1, 1), (2, 0, 1), 2),
                (6, (2, 2), (1, 1), 2),
                (7, (3, 1), (0, 1), 2),
            )
        ),
    ],
)
def test_a_cycle_of_several_parts_costs_the_same_in_the_other_model(
    seed: int,
    capacities: tuple[int, ...],
    buffers: tuple[int, ...],
    units: int,
    tmp_path: Path,
) -> None:
    problem = roomy(seed, len(capacities), capacities, buffers)
    shortest = fastest_cycle(problem)
    assert shortest is not None
    cycle = cheapest_cycle(problem, period=1.05 * shortest.period, units=units)
    assert cycle is not None
    assert_solved(problem, cycle, tmp_path / "cell.xml")


@pytest.mark.parametrize("seed", range(3))
def test_a_part_that_waits_in_a_machine_for_another_does_so_in_the_other_model(
    seed: int, tmp_path: Path
) -> None:
    """To leave with a part and come back with another is costly, and so is a second wait."""
    modes = (MODES[0], replace(MODES[1], joules=9000.0))
    problem = roomy(seed, 1, (1,), (1,))
    hops = {**problem.hops, (1, 0): problem.hops[1, 0].shifted(0.0, 3e4)}
    problem = replace(problem, process=(40.0,), before=(modes, modes), hops=hops)
    cycle = cheapest_cycle(problem, period=42.0, units=2)
    assert cycle is not None
    assert max(cycle.queued(0, 40.0, 1)) > 1.0
    assert_solved(problem, cycle, tmp_path / "cell.xml")


def assert_solved(problem: SteadyProblem, cycle: SteadyCycle, file: Path) -> None:
    """Written, read and solved, it costs the same, by a schedule that is valid by the file."""
    answer = solve_cell(read_again(cycle_instance("drawn", problem, cycle), file), 60.0)
    assert answer.gap == 0.0
    assert answer.schedule is not None
    assert answer.energy == pytest.approx(cycle.joules, rel=HOPS)
    rows = [
        (done.activity, done.choice, done.mode, done.start, done.duration)
        for done in answer.schedule.robots[0]
    ]
    element = ElementTree.parse(file).getroot().find("instance")
    assert element is not None
    assert faults(element, rows) == []
    assert energy(element, rows) == pytest.approx(answer.energy)


@pytest.mark.long
def test_another_model_finds_the_same_energy(tmp_path: Path) -> None:
    cell = load_cell("flexible")
    assert cell.route is not None
    machines = tuple(
        machine if machine.name in ("washer", "gauge") else replace(machine, process=0.0)
        for machine in cell.equipment
    )
    visits = ("infeed_pick", "washer_basket", "gauge_seat", "outfeed_place")
    cell = replace(cell, equipment=machines, route=replace(cell.route, visits=visits))
    plan = Planner(cell, clock=lambda: 0.0).plan_steady_cycle(parts_per_hour=50.0)
    assert plan.cycle is not None
    instance = read_again(tended_instance(plan), tmp_path / "cell.xml")
    assert instance.cycle == pytest.approx(plan.cycle.period, abs=1e-6)
    answer = solve_cell(instance, 120.0)
    assert answer.gap == 0.0
    least = plan.cycle.joules * (1.0 - plan.gap / 100.0)
    assert answer.energy == pytest.approx(least, rel=AGREED)
