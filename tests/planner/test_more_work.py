"""More work never turns an answer into a refusal and never makes it cost more; a refusal says
why.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from ir_msgs_py.options import PlanOptions
from ir_planner import Planner, ProgramPlan, RequestError

WORK = (100, 2_000, 16_000, 64_000)  # max_iterations: too little, cut, and with all of it
SAME = 1e-9  # of the cost: rounding of sums
# of a duration: descents end where ten steps gain less than 1e-4, and programs with other
# configurations at their stations are different descents
SETTLED = 2e-4


@cache
def asked(cell: str) -> tuple[Planner, tuple[str, ...], float]:
    """A cell with two stations drawn and back to park, and the shortest time that takes [s]."""
    planner = Planner(cell, clock=lambda: 0.0)
    rng = np.random.default_rng([2, *cell.encode()])
    names = [station.name for station in planner.cell.stations]
    stops = (*(str(name) for name in rng.choice(names, min(2, len(names)), replace=False)), "park")
    fastest = planned(planner, stops, 0.0, PlanOptions(objective="time", planning_time=100.0))
    assert isinstance(fastest, ProgramPlan)
    return planner, stops, fastest.report.duration


@pytest.mark.long
@pytest.mark.parametrize(("cell", "longer"), [("demo", 1.5)])
def test_more_work_never_refuses_and_never_costs_more(cell: str, longer: float) -> None:
    keeps_its_answers(cell, longer)


@pytest.mark.long
@pytest.mark.parametrize("cell", ["cnc_door", "deep_box", "demo", "open", "table_columns"])
@pytest.mark.parametrize("longer", [0.0, 1.02, 1.5])
def test_more_work_never_refuses_and_never_costs_more_in_any_cell(cell: str, longer: float) -> None:
    keeps_its_answers(cell, longer)


def keeps_its_answers(cell: str, longer: float) -> None:
    """longer: cycle time over the shortest; 0: free."""
    planner, stops, shortest = asked(cell)
    found = False
    least = np.inf
    for most in WORK:
        options = PlanOptions(max_iterations=most, planning_time=100.0)
        plan = planned(planner, stops, longer * shortest, options)
        if isinstance(plan, str):
            assert not found, f"{most}: {plan}"
            assert "max_iterations ended before all was tried" in plan
            assert not plan.split("; max_iterations")[0].rstrip().endswith(":")
            continue
        found = True
        if plan.info.iterations < most * len(stops):  # nothing was left out for lack of work
            assert cost(plan, options, longer) <= least * (1.0 + SAME)
            least = cost(plan, options, longer)
    assert found
    assert longer or np.isfinite(
        least
    )  # a cycle hardly longer than the shortest may use all the work


@pytest.mark.parametrize(("cell", "seed"), [("deep_box", 84), ("cnc_door", 3)])
def test_no_budget_is_exceeded_and_none_refuses_what_a_smaller_one_planned(
    cell: str, seed: int
) -> None:
    keeps_its_budgets(cell, seed, 5)


@pytest.mark.long
@pytest.mark.parametrize("cell", ["cnc_door", "deep_box", "demo", "open", "table_columns"])
@pytest.mark.parametrize("seed", range(4))
def test_no_budget_is_exceeded_in_any_cell(cell: str, seed: int) -> None:
    keeps_its_budgets(cell, seed, 16)


def keeps_its_budgets(cell: str, seed: int, count: int) -> None:
    """Budgets are drawn, from hardly any work to enough, for stations that are drawn too."""
    planner = Planner(cell, clock=lambda: 0.0)
    rng = np.random.default_rng([seed, *cell.encode()])
    names = [station.name for station in planner.cell.stations]
    stops = (*(str(name) for name in rng.choice(names, min(2, len(names)), replace=False)), "park")
    found = False
    for most in (
        np.sort(np.exp(rng.uniform(np.log(20.0), np.log(3_000.0), count))).astype(int).tolist()
    ):
        options = PlanOptions(max_iterations=most, planning_time=1000.0, seed=seed)
        plan = planner.plan_program(
            stations=stops, options=options, start=np.array(planner.cell.park)
        )
        assert plan.info.iterations <= most * len(stops)
        assert plan.status.ok or not found, f"{most}: {plan.status.message}"
        found |= plan.status.ok


@pytest.mark.long
@pytest.mark.parametrize(("cell", "seed"), [("cnc_door", 2)])
def test_own_laws_of_the_joints_make_no_program_slower(cell: str, seed: int) -> None:
    no_slower_with_own_laws(cell, seed)


@pytest.mark.long
@pytest.mark.parametrize("cell", ["cnc_door", "deep_box", "demo", "open", "table_columns"])
@pytest.mark.parametrize("seed", range(3))
def test_own_laws_of_the_joints_make_no_program_slower_in_any_cell(cell: str, seed: int) -> None:
    no_slower_with_own_laws(cell, seed)


def no_slower_with_own_laws(cell: str, seed: int) -> None:
    """The fastest program of stations that are drawn, among them those that a withdrawal leads out
    of.
    """
    planner = Planner(cell, clock=lambda: 0.0)
    rng = np.random.default_rng([seed, *cell.encode()])
    names = [station.name for station in planner.cell.stations]
    stops = (*(str(name) for name in rng.choice(names, min(2, len(names)), replace=False)), "park")
    plans = [
        planned(
            planner,
            stops,
            0.0,
            PlanOptions(objective="time", timing=timing, seed=seed, planning_time=100.0),
        )
        for timing in ("synchronous", "asynchronous")
    ]
    assert all(isinstance(plan, ProgramPlan) for plan in plans)
    common, own = (plan for plan in plans if isinstance(plan, ProgramPlan))
    assert own.report.duration <= common.report.duration * (1.0 + SETTLED)
    assert own.info.timing == "asynchronous" or own.program_id == common.program_id


def planned(
    planner: Planner, stops: tuple[str, ...], cycle: float, options: PlanOptions
) -> ProgramPlan | str:
    """The program, or the sentence of the refusal."""
    try:
        plan = planner.plan_program(
            stations=stops, cycle_time=cycle, options=options, start=np.array(planner.cell.park)
        )
    except RequestError as error:
        return str(error)
    assert not plan.info.truncated
    return plan if plan.status.ok else plan.status.message


def cost(plan: ProgramPlan, options: PlanOptions, longer: float) -> float:
    """J of the movements; in a cycle time the joules of all."""
    if longer:
        return plan.report.energy
    reports = [step.report for step in plan.movements if not step.is_pause]
    return sum(r.energy - r.base_energy + options.time_value * r.duration for r in reports)


@pytest.mark.long
def test_a_program_is_planned_with_little_work_and_takes_no_more_than_allowed() -> None:
    """Service lines, known without any work, leave it to the movements and the searches of
    stations.
    """
    planner = Planner("demo", clock=lambda: 0.0)
    options = PlanOptions(max_iterations=1_500, planning_time=100.0)
    plan = planner.plan_program(options=options, start=np.array(planner.cell.machine_home))
    assert plan.status.ok, plan.status.message
    assert not plan.info.truncated
    assert plan.info.iterations <= 1_500 * len(planner.cell.program)


@pytest.mark.long
@pytest.mark.parametrize("cell", ["open", "table_columns"])
def test_a_movement_that_more_work_finds_is_refused_for_the_work(cell: str) -> None:
    """Whether a path or a duration is what little work doesn't find."""
    planner = Planner(cell, clock=lambda: 0.0)
    rng = np.random.default_rng([3, *cell.encode()])
    robot = planner.cell.robot
    refused = 0
    for _ in range(12):
        ends = np.array(planner.cell.machine_home) + rng.uniform(-1.5, 1.5, (2, robot.n))
        start, goal = np.clip(ends, robot.position_min, robot.position_max)
        fastest = planner.plan_regional(start=start, goal=goal, objective="time")
        if not fastest.status.ok:
            continue
        for most in (300, 3_000):
            options = PlanOptions(duration=1.01 * fastest.report.duration, max_iterations=most)
            try:
                said = planner.plan_regional(start=start, goal=goal, options=options).status.message
            except RequestError as error:
                said = str(error)
            refused += bool(said)
            assert not said or "max_iterations" in said, said
    assert refused > 0
