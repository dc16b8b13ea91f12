"""Savings name their baseline and hold the time equal: movements, pauses, total."""

from __future__ import annotations

import time

import numpy as np
import pytest

from ir_description import Cell, PowerData
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import MovementKind, PlannedMovement, TrajectoryReport
from ir_planner.program.chain import layers_of
from ir_planner.program.common_program import common_program, nearest_chain
from ir_planner.program.movements import Movements
from ir_planner.program.program import prepared
from ir_planner.program.request import ProgramRequest
from ir_planner.program.saving_request import SavingPlan, plan_savings
from ir_planner.program.savings import Saving, savings_of
from ir_planner.request.journal import Journal
from ir_planner.request.work import Work
from ir_planner.search.registry import registered
from ir_planner.service.withdrawals import EXIT_SEARCHES

STATIONS = ("home", "infeed_pick", "gauge_measure", "park")


def no_progress(phase: str, done: int, total: int, cost: float) -> None:
    """Nobody listens."""


@pytest.fixture(scope="module")
def request_(demo_cell: Cell, power: PowerData) -> ProgramRequest:
    options = PlanOptions(planning_time=60.0)
    return ProgramRequest(demo_cell, power, STATIONS, np.array(demo_cell.machine_home), options)


@pytest.fixture(scope="module")
def movements(request_: ProgramRequest) -> Movements:
    journal = Journal(Work(10**7, np.inf, lambda: 0.0), 0)
    route, context = prepared(request_, journal)
    fastest = context.asking("time")
    layers = layers_of(route, request_.start, fastest, EXIT_SEARCHES, no_progress)
    return Movements(route, layers, fastest, registered())


@pytest.fixture(scope="module")
def saved(request_: ProgramRequest) -> SavingPlan:
    return plan_savings(request_, Work(2_000_000, time.monotonic() + 300.0, time.monotonic), no_progress)


def test_the_common_program_goes_to_the_nearest_configuration_every_time(movements: Movements) -> None:
    chosen = nearest_chain(movements).chosen
    here = movements.layers[0][0].outside
    for hop, k in enumerate(chosen[1:]):
        weights = movements.route.arriving(hop).weights
        away = [float(np.abs(node.outside - here) @ weights) for node in movements.layers[hop + 1]]
        assert away[k] == min(away)
        here = movements.layers[hop + 1][k].outside


def test_a_movement_of_the_common_program_is_a_straight_segment_at_full_speed(
    request_: ProgramRequest, movements: Movements
) -> None:
    common = common_program(request_, movements)
    across = [m for m in common.movements if m.kind == MovementKind.REGIONAL]
    assert (common.across, common.around) == (len(across), 0)
    for movement in across:
        trajectory = movement.trajectory
        assert trajectory is not None
        assert movement.report.certified
        q = trajectory.sample(np.linspace(0.0, trajectory.duration, 50)).q
        along = q[-1] - q[0]
        share = (q - q[0]) @ along / (along @ along)
        assert np.abs(q - q[0] - share[:, None] * along).max() < 1e-6  # all joints at once
        assert float(np.max(movement.report.torque_ratio)) > 0.93  # of the share 0.98 or the next one, 0.95


def test_both_programs_last_equally_long_and_the_planned_one_costs_less(
    saved: SavingPlan, request_: ProgramRequest, movements: Movements
) -> None:
    savings = saved.savings
    assert savings is not None
    common = common_program(request_, movements)
    seconds = sum(step.duration for step in common.movements)
    assert saved.plan.report.duration == pytest.approx(seconds, abs=1e-4)
    assert savings.movements.common == pytest.approx(sum(step.report.energy for step in common.movements))
    assert savings.total.planned == pytest.approx(saved.plan.report.energy)
    assert 0.0 < savings.total.share < 0.4
    assert saved.plan.report.certified
    assert "against synchronous S-curve PTP at 100 %" in savings.sentence


def test_the_three_figures_are_kept_apart() -> None:
    def step(kind: str, seconds: float, joules: float) -> PlannedMovement:
        return PlannedMovement(
            kind=MovementKind(kind),
            from_station="",
            to_station="",
            duration=seconds,
            report=TrajectoryReport(duration=seconds, energy=joules),
        )

    pause, regional = MovementKind.PAUSE, MovementKind.REGIONAL
    common = (step(regional, 2.0, 3000.0), step(pause, 60.0, 28_000.0), step(regional, 1.0, 1000.0))
    planned = (
        step(regional, 1.5, 2000.0),
        step(pause, 60.0, 20_000.0),
        step(regional, 1.0, 700.0),
        step(pause, 0.5, 300.0),  # the wait at the end belongs to the movements' time
    )
    savings = savings_of(common, planned, 2, 0)
    assert savings.movements == Saving(4000.0, 3000.0, 3.0)
    assert savings.movements.share == pytest.approx(0.25)
    assert savings.pauses == Saving(28_000.0, 20_000.0, 60.0)
    assert savings.total == Saving(32_000.0, 23_000.0, 63.0)
