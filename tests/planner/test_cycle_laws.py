"""Laws of a program's energy over its cycle time, on programs drawn in several cells.

E(T + d) <= E(T) + the cheapest wait of d. The drives' energy never rises with T while the wait at
the end
stays in its mode: where a wait gets long enough for a deeper one, hurrying into it is cheaper at
the mains, which costs the drives more.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from ir_msgs_py.options import PlanOptions
from ir_planner import Planner, ProgramPlan
from ir_planner.program.movements import optimised_near
from ir_planner.regional import search_regional
from ir_planner.request import Context, Work
from ir_planner.scene import PlanningScene
from ir_planner.search import SEARCHES
from ir_planner.timing import Movement

POINTS = 6
LAW = 1e-3  # of E: movements are compared at a ladder of values
DRAWN = 6  # cycle times
ROUNDING = 1e-3  # of J: slower movements are compared at some durations
RISE = 5e-3  # of the drives' energy: parts are exchanged for others, whose paths differ


@pytest.mark.parametrize(
    "cell", ["demo", *(pytest.param(c, marks=pytest.mark.long) for c in ("open", "table_columns"))]
)
def test_energy_over_cycle_time_keeps_its_laws(cell: str) -> None:
    planner = Planner(cell, clock=lambda: 0.0)
    park = np.array(planner.cell.park)
    rng = np.random.default_rng([1, *cell.encode()])
    names = [station.name for station in planner.cell.stations]
    stops = (*(str(name) for name in rng.choice(names, 2, replace=False)), "park")
    options = PlanOptions(planning_time=100.0, max_iterations=10_000)
    plan = planner.plan_program(stations=stops, options=options, start=park, front_points=POINTS)
    assert plan.status.ok, plan.status.message
    front = plan.front
    assert len(front) == POINTS
    assert front[-1].report.duration == pytest.approx(2.0 * plan.report.duration, rel=1e-2)
    for point in front:
        assert point.report.certified
        assert all(step.report.certified for step in point.movements)
    for before, after in itertools.combinations(front, 2):
        d = after.report.duration - before.report.duration
        assert d > 0.0
        wait = planner.standby(d, q=park).energy
        assert after.report.energy <= (1.0 + LAW) * (before.report.energy + wait)
        if wait_mode(before) == wait_mode(after):
            assert drive_energy(after) <= (1.0 + RISE) * drive_energy(before)


def wait_mode(plan: ProgramPlan) -> str:
    """Mode of the wait at the end; "": on motors, or none."""
    last = plan.movements[-1]
    return last.power_mode.replace("STAND_ON_MOTORS", "") if last.is_pause else ""


def drive_energy(plan: ProgramPlan) -> float:
    """Joules of the drives while the program moves."""
    return sum(
        step.report.energy - step.report.base_energy for step in plan.movements if not step.is_pause
    )


@pytest.mark.long
@pytest.mark.parametrize("cell", ["demo", "open", "table_columns", "cnc_door"])
def test_energies_of_drawn_cycle_times_keep_the_law(cell: str) -> None:
    """Each is asked for alone: what one knows of fast movements, a longer one must know too."""
    planner = Planner(cell, clock=lambda: 0.0)
    park = np.array(planner.cell.park)
    rng = np.random.default_rng([2, *cell.encode()])
    names = [station.name for station in planner.cell.stations]
    stops = (*(str(name) for name in rng.choice(names, min(3, len(names)), replace=False)), "park")

    def planned(objective: str, cycle_time: float) -> ProgramPlan:
        options = PlanOptions(objective=objective, planning_time=100.0)
        plan = planner.plan_program(
            stations=stops, cycle_time=cycle_time, options=options, start=park
        )
        assert plan.status.ok, plan.status.message
        return plan

    shortest = planned("time", 0.0).report.duration
    times = np.sort(rng.uniform(1.01, 2.0, DRAWN)) * shortest
    energies = [planned("energy", float(cycle)).report.energy for cycle in times]
    for (t0, e0), (t1, e1) in itertools.combinations(zip(times, energies, strict=True), 2):
        wait = planner.standby(float(t1 - t0), q=park).energy
        assert e1 <= (1.0 + LAW) * (e0 + wait), (t0, t1)


@pytest.mark.long
def test_a_movement_at_a_value_costs_no_more_than_known_ones_slowed(
    scene_of: Callable[[str], PlanningScene],
) -> None:
    """Whatever they were searched for: the fastest one may be in a better class than the one of
    little J.
    """
    scene = scene_of("table_columns")
    rng = np.random.default_rng(3)
    for task in rng.choice(np.array(scene.cell.tasks, dtype=object), 1, replace=False):
        known = [searched(scene, task, objective) for objective in ("time", "time_and_energy")]
        for value in np.exp(rng.uniform(np.log(300.0), np.log(16_000.0), 2)):
            asked = replace(
                known[0].context.options, objective="time_and_energy", time_value=float(value)
            )
            context = replace(known[0].context, options=asked)
            found = optimised_near(known, context)
            assert found is not None
            assert found.prove().certified
            for other, slower in itertools.product(known, np.linspace(1.0, 3.0, 9)):
                same = replace(other, context=context).stretched_by(float(slower))
                assert worth(found, value) <= (1.0 + ROUNDING) * worth(same, value)


def searched(scene: PlanningScene, task: object, objective: str) -> Movement:
    """The movement of a task by an objective."""
    work = Work(400_000, 1.0, lambda: 0.0, improvement=1000)
    context = Context.of(scene, PlanOptions(objective=objective, planning_time=100.0), work)
    start, goal = (np.array(getattr(task, end)) for end in ("start", "goal"))
    _, found = search_regional(start, goal, context, SEARCHES)
    assert found is not None
    return found


def worth(movement: Movement, value: float) -> float:
    """Drive energy and what its seconds are worth at a value [W]."""
    report = movement.report
    return float(report.energy - report.base_energy + value * report.duration)
