"""A cycle time is a constraint: seconds go where they save most, judged by enumeration and by
laws.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import Cell, PowerData
from ir_msgs_py.modes import TransitionTimes
from ir_msgs_py.options import PlanOptions
from ir_planner import Planner
from ir_planner.checks import Consumption
from ir_planner.errors import RequestError
from ir_planner.program.cost_bounds import Rates
from ir_planner.program.cycle_time import CycleTask, shared_out
from ir_planner.program.movement_fronts import (
    FASTEST,
    LADDER,
    FrontPoint,
    Ladder,
    TimeValues,
    convex_front,
)
from ir_planner.program.program import plan_program
from ir_planner.program.request import ProgramPlan, ProgramRequest
from ir_planner.program.standby import plan_standby
from ir_planner.program.station_graph import HopPart
from ir_planner.request.context import Work
from ir_planner.scene.planning_scene import load_text, scene_with
from ir_planner.timing import Movement

BASE = 600.0  # W, while a program moves


class Invented:
    """What the distribution of time looks at, with invented seconds and joules."""

    fixed_time = False

    def __init__(self, seconds: float, joules: float) -> None:
        self.seconds = seconds
        self.joules = joules
        base = BASE * seconds
        self.trajectory = self
        self.duration = seconds
        self.energy = SimpleNamespace(total=joules + base, base=base)
        self.consumption = Consumption(seconds, 0.0, joules + base, base)


def invented(seconds: float, joules: float) -> Movement:
    return cast(Movement, Invented(seconds, joules))


class Values:
    """Fronts of invented parts, in the place of TimeValues."""

    def __init__(self, fronts: list[list[tuple[float, float]]]) -> None:
        self.points = {
            HopPart(k, "across", 0, 0): [FrontPoint.of(invented(*point)) for point in front]
            for k, front in enumerate(fronts)
        }

    def fronts(self) -> dict[HopPart, list[FrontPoint]]:
        """Convex ones."""
        return {part: convex_front(points) for part, points in self.points.items()}

    def slower(self, movement: Movement, seconds: float) -> Movement | None:
        """On the front between its points, flat beyond the slowest."""
        front = next(
            front for front in self.fronts().values() if any(p.movement is movement for p in front)
        )
        joules = np.interp(seconds, [p.seconds for p in front], [p.joules for p in front])
        return invented(seconds, float(joules))


@st.composite
def invented_fronts(draw: st.DrawFn) -> list[list[tuple[float, float]]]:
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    fronts = []
    for _ in range(draw(st.integers(1, 4))):
        count = int(rng.integers(1, 5))
        seconds = 1.0 + np.cumsum(rng.uniform(0.05, 0.5, count))
        fronts.append(list(zip(seconds, rng.uniform(500.0, 3000.0, count), strict=True)))
    return fronts


@given(invented_fronts(), st.floats(0.0, 3.0), st.floats(50.0, 900.0))
@settings(deadline=None)
def test_no_choice_of_points_with_a_wait_costs_less(
    fronts: list[list[tuple[float, float]]], more: float, watts: float
) -> None:
    values = Values(fronts)
    seconds = sum(min(t for t, _ in front) for front in fronts) + more
    task = CycleTask(seconds, lambda left: watts * left, values.slower)
    found = shared_out(cast(TimeValues, values), task)
    assert found is not None
    used = sum(cast(Any, movement).seconds for movement in found.movements.values())
    assert used + found.wait == pytest.approx(seconds)
    energy = sum(movement.energy.total for movement in found.movements.values())
    assert found.energy == pytest.approx(energy + watts * found.wait)
    for choice in itertools.product(*fronts):
        total = sum(t for t, _ in choice)
        if total <= seconds:
            cost = sum(e + BASE * t for t, e in choice) + watts * (seconds - total)
            assert found.energy <= cost + 1e-6 or (found.wait == 0.0 and seconds - total < 0.05)


@given(invented_fronts())
@settings(deadline=None)
def test_a_front_is_convex_and_nothing_lies_below_it(
    fronts: list[list[tuple[float, float]]],
) -> None:
    for points in fronts:
        front = convex_front([FrontPoint.of(invented(*point)) for point in points])
        t = np.array([p.seconds for p in front])
        e = np.array([p.joules for p in front])
        assert (np.diff(t) > 0.0).all()
        assert (np.diff(e) < 0.0).all()
        assert (np.diff(np.diff(e) / np.diff(t)) >= -1e-9).all()
        for seconds, joules in points:
            assert joules >= np.interp(seconds, t, e) - 1e-9


def test_too_short_a_time_has_no_answer() -> None:
    values = Values([[(1.0, 100.0)], [(2.0, 100.0)]])
    assert (
        shared_out(cast(TimeValues, values), CycleTask(2.9, lambda left: 0.0, values.slower))
        is None
    )


ACROSS_PART = HopPart(0, "across", 0, 0)


class Rung:
    """The movement of one part at one value, in the place of Movements."""

    def __init__(self, seconds: float, joules: float) -> None:
        self.found = invented(seconds, joules)
        self.context = SimpleNamespace(work=SimpleNamespace(exhausted=False))

    def plan(self, parts: list[HopPart], improvement: int) -> list[Movement]:
        return [self.found for _ in parts]

    def movement(self, part: HopPart) -> Movement:
        return self.found


class Rungs:
    """A ladder whose movement at one rung, `poor`, takes three times the joules."""

    first = 2
    improvement = 0

    def __init__(self, poor: int) -> None:
        self.rungs = [
            Rung(3.0 - 0.1 * k, (1000.0 + 50.0 * k) * (3.0 if k == poor else 1.0))
            for k in range(FASTEST + 1)
        ]
        self.own = self.rungs[self.first]
        self.asked = dict[int, Movement]()
        self.better = invented(self.rungs[poor].found.trajectory.duration, 1.0)

    def at(self, rung: int) -> Rung:
        return self.rungs[rung]

    def rates(self, rung: int) -> Rates:
        return Rates(0.0, 1.0) if rung == FASTEST else Rates(1.0, 500.0 * LADDER[rung])

    def from_others(self, rung: int, known: dict[HopPart, Movement]) -> dict[HopPart, Movement]:
        self.asked[rung] = known[ACROSS_PART]
        return {ACROSS_PART: self.better}


@pytest.mark.parametrize("poor", [1, 3, 7, FASTEST - 1])
def test_a_poor_movement_beside_the_cycle_time_is_optimised_again_from_a_better_one(
    poor: int,
) -> None:
    ladder = Rungs(poor)
    values = TimeValues(cast(Ladder, ladder), [ACROSS_PART])
    assert values.bracket(3.0 - 0.1 * poor + 0.05) == poor
    assert ladder.asked[poor] is not ladder.rungs[poor].found
    assert any(point.movement is ladder.better for point in values.fronts()[ACROSS_PART])


STATIONS = ("home", "gauge_measure", "park")


@pytest.fixture(scope="module")
def planned(demo_cell: Cell, power: PowerData) -> Callable[[float], ProgramPlan]:
    """The program in a cycle time [s], 0: free."""
    known: dict[float, ProgramPlan] = {}

    def plan(cycle_time: float) -> ProgramPlan:
        if cycle_time not in known:
            start = np.array(demo_cell.machine_home)
            options = PlanOptions(planning_time=60.0)
            request = ProgramRequest(demo_cell, power, STATIONS, start, options, cycle_time)
            work = Work(1_200_000, 1.0, lambda: 0.0)
            known[cycle_time] = plan_program(request, work)
        return known[cycle_time]

    return plan


@pytest.mark.long
def test_a_little_less_time_costs_little_more(planned: Callable[[float], ProgramPlan]) -> None:
    free = planned(0.0).report
    shorter = planned(0.97 * free.duration).report
    assert shorter.certified
    assert shorter.duration == pytest.approx(0.97 * free.duration, abs=1e-4)
    assert shorter.energy < 1.02 * free.energy


def test_energy_over_cycle_time_keeps_the_law_of_waiting(
    planned: Callable[[float], ProgramPlan], demo_cell: Cell, power: PowerData
) -> None:
    """E(T + d) <= E(T) + the cheapest wait of d; E of the drives never rises while nothing
    waits.
    """
    free = planned(0.0).report.duration
    scene = scene_with(demo_cell, load_text(demo_cell), power)
    park = np.array(demo_cell.park)
    times = [0.97 * free, free, 1.3 * free, 40.0 * free]
    energies = []
    for cycle_time in times:
        plan = planned(cycle_time)
        assert plan.status.ok, plan.status.message
        assert plan.report.certified
        assert plan.report.duration == pytest.approx(cycle_time, abs=1e-4)
        energies.append(plan.report.energy)
    for (t0, e0), (t1, e1) in itertools.combinations(zip(times, energies, strict=True), 2):
        wait = plan_standby(t1 - t0, park, scene, TransitionTimes()).energy
        assert e1 <= 1.005 * (e0 + wait), (t0, t1)
    assert planned(40.0 * free).movements[-1].power_mode == "STAND_ON_BRAKES>BUS_POWER_OFF"


@pytest.mark.long
def test_too_short_a_cycle_names_the_shortest(planned: Callable[[float], ProgramPlan]) -> None:
    with pytest.raises(RequestError, match="the shortest is") as refused:
        planned(1.0)
    shortest = float(str(refused.value).split("the shortest is ")[1].split(" s")[0])
    assert planned(shortest + 1e-3).status.ok


POINTS = 5


def test_the_front_of_a_program_keeps_the_law_of_waiting(demo_cell: Cell, power: PowerData) -> None:
    park = np.array(demo_cell.park)
    request = ProgramRequest(
        demo_cell,
        power,
        ("home", "park"),
        park,
        PlanOptions(planning_time=60.0),
        front_points=POINTS,
    )
    front = plan_program(request, Work(30_000, 1.0, lambda: 0.0)).front
    assert len(front) == POINTS
    assert len({plan.program_id for plan in front}) == POINTS
    assert all(plan.report.certified for plan in front)
    seconds, energy = (
        [getattr(plan.report, name) for plan in front] for name in ("duration", "energy")
    )
    assert seconds == sorted(seconds)
    assert energy[0] > 1.05 * min(energy)  # hurrying costs
    scene = scene_with(demo_cell, load_text(demo_cell), power)
    for a, b in itertools.combinations(range(POINTS), 2):
        wait = plan_standby(seconds[b] - seconds[a], park, scene, TransitionTimes()).energy
        assert energy[b] <= 1.005 * (energy[a] + wait)


@pytest.mark.long
def test_without_a_cycle_time_objective_energy_says_that_it_is_slow() -> None:
    planner = Planner("demo", clock=lambda: 0.0)
    stops = ("infeed_pick", "park")
    start = np.array(planner.cell.park)

    def plan(objective: str, cycle_time: float) -> ProgramPlan:
        options = PlanOptions(objective=objective, planning_time=100.0, max_iterations=10_000)
        return planner.plan_program(
            stations=stops, cycle_time=cycle_time, options=options, start=start
        )

    slow = plan("energy", 0.0)
    usual = plan("time_and_energy", 0.0)
    assert f"the movements take {slow.report.duration:.1f} s" in slow.status.message
    assert usual.status.message == ""
    short = plan("energy", usual.report.duration)
    assert short.status.message == ""
    assert slow.report.duration > 1.2 * short.report.duration
    assert slow.report.energy > short.report.energy


@pytest.mark.parametrize(
    ("cell", "stops", "seed"),
    [
        ("table_columns", ("mid", "tR", "side2", "park"), 16),
        ("cnc_door", ("cnc", "pal", "cncL", "press", "park"), 10),
        ("table_columns", ("side2", "side1", "mid", "tL", "tR", "park"), 21),
    ],
)
@pytest.mark.long
def test_no_cycle_time_that_the_fastest_program_keeps_is_refused(
    cell: str, stops: tuple[str, ...], seed: int
) -> None:
    """The cheapest chain may be too slow, and the one for time alone is not the fastest at all
    values.
    """
    planner = Planner(cell, clock=lambda: 0.0)

    def plan(objective: str, cycle_time: float) -> ProgramPlan:
        options = PlanOptions(objective=objective, seed=seed)
        return planner.plan_program(
            stations=stops,
            cycle_time=cycle_time,
            options=options,
            start=np.array(planner.cell.park),
        )

    cycle = 1.0002 * plan("time", 0.0).report.duration
    for objective in ("time_and_energy", "time"):
        found = plan(objective, cycle)
        assert found.status.ok, found.status.message
        assert found.report.certified
        assert found.report.duration == pytest.approx(cycle, abs=1e-4)
