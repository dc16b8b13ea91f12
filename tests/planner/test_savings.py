"""Savings name their baseline and hold the time equal: movements, pauses, total."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import astuple, replace
from typing import cast

import numpy as np
import pytest

from ir_description import Cell, PowerData
from ir_description.robot import ROBOTS
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import MovementKind, PlannedMovement, TrajectoryReport
from ir_planner import Planner
from ir_planner.program.choice import Choice
from ir_planner.program.movement_fronts import Ladder
from ir_planner.program.movements import Movements
from ir_planner.program.program import plan_program, prepared
from ir_planner.program.request import ProgramPlan, ProgramRequest, nobody
from ir_planner.program.savings import CommonProgram, common_program, nearest_chain, savings_of
from ir_planner.program.station_chain import layers_of
from ir_planner.program.station_graph import StationChain
from ir_planner.request import Journal, Work
from ir_planner.search.registry import registered
from ir_planner.service.exit_paths import EXIT_SEARCHES
from ir_planner.settings import PlannerSettings
from ir_values.arrays import FloatArray

STATIONS = ("home", "infeed_pick", "gauge_measure", "park")


@pytest.fixture(scope="module")
def request_(demo_cell: Cell, power: PowerData) -> ProgramRequest:
    options = PlanOptions(planning_time=60.0)
    return ProgramRequest(demo_cell, power, STATIONS, np.array(demo_cell.machine_home), options)


@pytest.fixture(scope="module")
def movements(request_: ProgramRequest) -> Movements:
    journal = Journal(Work(10**7, np.inf, lambda: 0.0), 0)
    route, context = prepared(request_, journal)
    layers = layers_of(route, request_.start, context, EXIT_SEARCHES, nobody)
    return Movements(route, layers, context, registered())


@pytest.fixture(scope="module")
def common(request_: ProgramRequest, movements: Movements) -> CommonProgram:
    """It needs the layers alone: the chain of the request doesn't matter."""
    nowhere = StationChain([], 0.0, 0.0, 0.0)
    return common_program(Choice(request_, Ladder(movements, 0), nowhere))


@pytest.fixture(scope="module")
def planned(request_: ProgramRequest) -> Callable[[float], ProgramPlan]:
    """The program in a cycle time [s], 0: free, with what it saves."""

    def plan(cycle_time: float) -> ProgramPlan:
        work = Work(2_000_000, 1.0, lambda: 0.0)
        return plan_program(replace(request_, cycle_time=cycle_time, savings=True), work)

    return plan


def test_what_programs_are_compared_by_is_what_they_are_reported_with(
    common: CommonProgram,
) -> None:
    """Durations and energies, carried charge included, are known without the rest of a report."""
    for until in (0.0, 120.0):
        full, brief = (
            each(common.found, until=until)
            for each in (common.choice.steps, common.choice.energies)
        )
        costs = [
            [
                (step.duration, step.report.energy, step.report.base_energy, step.power_mode)
                for step in steps
            ]
            for steps in (full, brief)
        ]
        assert costs[0] == costs[1]
    for movement in common.found.values():
        for name, value in movement.consumption._asdict().items():
            assert getattr(movement.report, name) == value


def test_the_common_program_goes_to_the_nearest_configuration_every_time(
    movements: Movements,
) -> None:
    chosen = nearest_chain(movements).chosen
    here = movements.layers[0][0].departure
    for hop, k in enumerate(chosen[1:]):
        weights = movements.route.arriving(hop).weights
        away = [float(np.abs(node.arrival - here) @ weights) for node in movements.layers[hop + 1]]
        assert away[k] == min(away)
        here = movements.layers[hop + 1][k].departure


def test_a_movement_of_the_common_program_is_a_straight_segment_at_full_speed(
    common: CommonProgram,
) -> None:
    across = [m for m in common.steps() if m.kind == MovementKind.REGIONAL]
    assert (common.across, common.around) == (len(across), 0)
    for movement in across:
        trajectory = movement.trajectory
        assert trajectory is not None
        assert movement.report.certified
        q = trajectory.sample(np.linspace(0.0, trajectory.duration, 50)).q
        along = q[-1] - q[0]
        share = (q - q[0]) @ along / (along @ along)
        assert np.abs(q - q[0] - share[:, None] * along).max() < 1e-6  # all joints at once
        most = 1.0 - PlannerSettings().torque_reserve
        assert (
            0.93 * most < np.max(movement.report.torque_ratio) <= most
        )  # the share is 0.98 of it, or 0.95


def test_both_programs_last_equally_long_and_the_planned_one_costs_less(
    planned: Callable[[float], ProgramPlan], common: CommonProgram
) -> None:
    plan = planned(0.0)
    savings = plan.savings
    compared = plan.compared
    assert savings.available
    assert compared is not None
    assert savings.program_id == compared.program_id != plan.program_id
    seconds = sum(step.duration for step in common.steps())
    assert compared.report.duration == pytest.approx(seconds, abs=1e-4)
    assert savings.movements.common == pytest.approx(
        sum(step.report.energy for step in common.steps())
    )
    assert savings.total.planned == pytest.approx(compared.report.energy)
    assert 0.0 < savings.total.share < 0.4
    assert compared.report.certified
    assert "against synchronous S-curve PTP at 100 %" in savings.sentence
    assert f"the common program's {seconds:.2f} s" in savings.sentence


@pytest.mark.long
def test_in_a_longer_cycle_both_programs_wait(
    planned: Callable[[float], ProgramPlan], common: CommonProgram
) -> None:
    seconds = sum(step.duration for step in common.steps())
    plan = planned(seconds + 40.0)
    savings = plan.savings
    assert savings.program_id == plan.program_id  # the answer itself
    assert savings.movements.seconds == pytest.approx(plan.report.duration, abs=1e-4)
    assert savings.movements.planned == pytest.approx(plan.report.energy)
    assert savings.movements.common > sum(step.report.energy for step in common.steps())
    assert "the common program waits 40.00 s at its end" in savings.sentence


@pytest.mark.long
def test_a_cycle_that_the_common_program_cannot_keep_is_compared_in_its_own_time(
    planned: Callable[[float], ProgramPlan], common: CommonProgram
) -> None:
    seconds = sum(step.duration for step in common.steps())
    plan = planned(0.98 * seconds)
    assert plan.report.duration == pytest.approx(0.98 * seconds, abs=1e-4)
    assert plan.savings.movements.seconds == pytest.approx(seconds, abs=1e-4)
    assert f"which can't keep {0.98 * seconds:g} s" in plan.savings.sentence


def test_savings_that_nobody_asked_for_say_so(request_: ProgramRequest) -> None:
    plan = plan_program(
        replace(request_, stations=("home", "park")), Work(200_000, np.inf, lambda: 0.0)
    )
    assert plan.status.ok
    assert not plan.savings.available
    assert "not asked for" in plan.savings.sentence


def test_the_three_figures_are_kept_apart() -> None:
    def step(kind: str, seconds: float, joules: float) -> PlannedMovement:
        return PlannedMovement(
            kind=MovementKind(kind),
            from_station="",
            to_station="",
            duration=seconds,
            report=TrajectoryReport(duration=seconds, energy=joules),
        )

    pause = MovementKind.PAUSE
    regional = MovementKind.REGIONAL
    common = (step(regional, 2.0, 3000.0), step(pause, 60.0, 28_000.0), step(regional, 1.0, 1000.0))
    planned = (
        step(regional, 1.5, 2000.0),
        step(pause, 60.0, 20_000.0),
        step(regional, 1.0, 700.0),
        step(pause, 0.5, 300.0),  # the wait at the end belongs to the movements' time
    )
    program = CommonProgram(cast(Choice, None), {}, 1)
    share = np.random.default_rng(0).normal(
        0.0, 0.1, ROBOTS
    )  # of every step's joules: all are wrong alike

    def added(steps: Sequence[PlannedMovement]) -> list[FloatArray]:
        return [step.report.energy * share for step in steps]

    savings = savings_of(common, planned, 1, program, added)
    low, high = np.quantile(share, (0.05, 0.95))

    def saving(common: float, planned: float, seconds: float) -> tuple[float, ...]:
        saved = common - planned
        return common, planned, seconds, saved * (1.0 + low), saved * (1.0 + high)

    assert astuple(savings.movements) == pytest.approx(saving(4000.0, 3000.0, 3.0))
    assert savings.movements.share == pytest.approx(0.25)
    assert savings.movements.certain
    assert astuple(savings.pauses) == pytest.approx(saving(28_000.0, 20_000.0, 60.0))
    assert astuple(savings.total) == pytest.approx(saving(32_000.0, 23_000.0, 63.0))
    assert (savings.across, savings.around) == (0, 1)
    longer = savings_of(
        (*common, step(pause, 10.0, 5000.0)), planned, 1, program, added
    )  # both wait
    assert (longer.movements.common, longer.movements.planned, longer.movements.seconds) == (
        9e3,
        3e3,
        13.0,
    )
    assert longer.pauses == savings.pauses


def test_programs_and_savings_are_the_same_on_one_core_and_on_two(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answers = []
    for cores in ({0}, {0, 1}):
        monkeypatch.setattr(
            "ir_planner.program.movements.os.sched_getaffinity", lambda _, c=cores: c
        )
        planner = Planner("open", clock=lambda: 0.0)  # no ceiling cuts the plan
        park = np.array(planner.cell.park)
        plan = planner.plan_program(
            stations=("p1", "park"), start=park, savings=True, max_iterations=3_000
        )
        answers.append((plan.program_id, plan.savings, plan.info.iterations))
    assert answers[0] == answers[1]
    assert answers[0][1].available
