"""A robot that tends a machine, driven without real time: what was planned, and late machines."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from ir_description import Cell, load_cell
from ir_description.cell import ProcessTimes
from ir_planner import Planner, SteadyPlan
from ir_recorder.analysis.tending import Tending, tending_of
from ir_studies.stepped_run import driven_program

# of a part, whichever is larger
SHARE = 0.01
JOULES = 10.0
LATE = 7.0  # s
WORK = 1000  # of a request: what is driven need not be the cheapest


def cell_of_one_machine() -> Cell:
    """The gauge of the flexible cell alone."""
    cell = load_cell("flexible")
    assert cell.route is not None
    machines = tuple(
        machine if machine.name == "gauge" else replace(machine, process=0.0)
        for machine in cell.equipment
    )
    visits = ("infeed_pick", "gauge_seat", "outfeed_place")
    return replace(cell, equipment=machines, route=replace(cell.route, visits=visits))


@cache
def planned(parts: int) -> SteadyPlan:
    planner = Planner(cell_of_one_machine(), clock=lambda: 0.0)
    return planner.plan_steady_cycle(cycles=parts, max_iterations=WORK)


def driven(parts: int, late: float) -> Tending:
    """The run with a machine that takes so many seconds more."""
    plan = planned(parts)
    assert plan.run is not None
    assert plan.run_cell is not None
    machines = tuple(
        replace(machine, process_times=ProcessTimes(machine.process, machine.process + late))
        if machine.process
        else machine
        for machine in plan.run_cell.equipment
    )
    cell = replace(plan.run_cell, equipment=machines)
    run = driven_program(cell, plan.run.movements)
    run.close()
    tending = tending_of(cell, run.steps, run.signals)
    assert tending is not None
    return tending


@pytest.mark.long
def test_every_part_needs_what_was_planned() -> None:
    tending = driven(2, 0.0)
    assert len(tending.parts) == 2
    for part in tending.parts:
        assert part.joules == pytest.approx(part.planned_joules, rel=SHARE, abs=JOULES)
        assert part.span.seconds == pytest.approx(part.planned_seconds, abs=0.1)
        assert not part.late
    (gauge,) = tending.machines
    assert [span.seconds for span in gauge.working] == pytest.approx([12.0] * 2, abs=0.02)


@pytest.mark.long
@pytest.mark.parametrize(
    ("process", "capacity", "buffer", "cycles"),
    [
        (12.0, 2, 1, 1),
        *(pytest.param(40.0, capacity, 1, 2, marks=pytest.mark.long) for capacity in (1, 2)),
    ],
)
def test_parts_in_a_machine_for_several_need_what_was_planned(
    process: float, capacity: int, buffer: int, cycles: int
) -> None:
    cell = cell_of_one_machine()
    machines = tuple(
        replace(machine, process=process, capacity=capacity, buffer=buffer)
        if machine.name == "gauge"
        else machine
        for machine in cell.equipment
    )
    planner = Planner(replace(cell, equipment=machines), clock=lambda: 0.0)
    plan = planner.plan_steady_cycle(cycles=cycles, max_iterations=WORK)
    assert plan.run is not None
    assert plan.run_cell is not None
    assert plan.cycle is not None
    assert max(plan.cycle.most) > 1
    run = driven_program(plan.run_cell, plan.run.movements)
    run.close()
    tending = tending_of(plan.run_cell, run.steps, run.signals)
    assert tending is not None
    assert len(tending.parts) >= cycles * plan.cycle.units
    for part in tending.parts:
        assert part.joules == pytest.approx(part.planned_joules, rel=SHARE, abs=JOULES)
        assert not part.late
    assert len(tending.machines) == plan.cycle.most[0]
    worked = sorted((s for m in tending.machines for s in m.working), key=lambda span: span.begin)
    for k, span in enumerate(worked):
        at_once = [other for other in worked[:k] if other.end > span.begin + 0.01]
        assert len(at_once) < capacity
        assert span.seconds <= process + 0.02


def test_a_late_machine_is_waited_for_and_named() -> None:
    tending = driven(1, LATE)
    (gauge,) = tending.machines
    late = sum(span.seconds - 12.0 for span in gauge.working)
    assert late > 0.0
    waited = sum(part.late.get("gauge", 0.0) for part in tending.parts)
    assert waited == pytest.approx(late, abs=0.1)
    longer = sum(part.span.seconds - part.planned_seconds for part in tending.parts)
    assert longer == pytest.approx(late, abs=0.3)
