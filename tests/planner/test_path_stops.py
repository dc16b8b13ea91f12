"""Programs with paths of the tool as stops: driven at their speed, in the configurations that cost
least.
"""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ir_description import Cell, load_cell
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import MovementKind
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner
from ir_planner.program.movements import Movements, cost_of, rates_of
from ir_planner.program.program import ProgramPlan, ProgramRequest, prepared
from ir_planner.program.station_chain import layers_of
from ir_planner.program.station_graph import ACROSS, ENTER, HopPart
from ir_planner.request import Journal, Work
from ir_planner.service import exit_searches
from ir_planner.settings import PlannerSettings

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from cartesian import seen
from program import Robot

STOPS = ("home", "bead", "park")


@pytest.fixture(scope="module")
def planner() -> Planner:
    return planner_of(straight(load_cell("kr6_bench")))


def planner_of(cell: Cell) -> Planner:
    return Planner("kr6_bench", clock=lambda: 0.0, read_cell=lambda *_: cell)


def straight(cell: Cell) -> Cell:
    """With the angle about the tool's axis given, so that there are few configurations."""
    (bead,) = cell.paths
    return replace(cell, paths=(replace(bead, path=replace(bead.path, free_angle=0.0)),))


@pytest.fixture(scope="module")
def plan(planner: Planner) -> ProgramPlan:
    return planned(planner, savings=True)


def planned(planner: Planner, cycle: float = 0.0, *, savings: bool = False) -> ProgramPlan:
    found = asked(planner, cycle, savings=savings)
    assert found.status.ok, found.status.message
    return found


def asked(planner: Planner, cycle: float = 0.0, *, savings: bool = False) -> ProgramPlan:
    options = PlanOptions(planning_time=60.0, max_iterations=3_000)
    return planner.plan_program(
        stations=STOPS,
        cycle_time=cycle,
        options=options,
        start=planner.cell.machine_home,
        savings=savings,
    )


def test_the_tool_is_driven_along_its_path_between_regional_movements(
    planner: Planner, plan: ProgramPlan
) -> None:
    kinds = [str(step.kind) for step in plan.movements]
    assert kinds == ["regional", "cartesian", "regional"]
    assert all(step.report.certified for step in plan.movements)
    along = plan.movements[1]
    assert (along.from_station, along.to_station) == ("bead", "bead")
    path = planner.cell.path("bead")
    found = seen(between_stops(along.trajectory), path, planner.scene())
    assert found.speed <= path.speed_tolerance
    assert found.error <= 1e-4
    touched = [(pair.body_a, pair.body_b) for pair in along.report.contacts]
    assert touched == [("gripper_body", "tray_out_top")]
    assert 0.005 <= along.report.contacts[0].distance < 0.02
    assert not plan.movements[0].report.contacts


def between_stops(trajectory: JointTrajectory | None) -> JointTrajectory:
    """The path without its approach and its retract, which it meets at corners."""
    assert trajectory is not None
    assert trajectory.velocities is not None
    first, last = np.flatnonzero(~trajectory.velocities.any(axis=1))[[1, 2]]
    kept = slice(first, last + 1)
    rows = (trajectory.positions[kept], trajectory.velocities[kept], trajectory.accelerations[kept])
    times = trajectory.times_ns[kept] - trajectory.times_ns[first]
    return JointTrajectory(trajectory.joint_names, times, *rows)


def test_the_robot_drives_it(planner: Planner, plan: ProgramPlan) -> None:
    robot = Robot(planner.cell)
    robot.plant.backend.reset(np.array(planner.cell.machine_home))
    robot.plant.executor.hold(np.array(planner.cell.machine_home))
    ended = robot.run(plan.movements)
    assert ended.ok, ended.message
    assert robot.took[1] == pytest.approx(plan.movements[1].report.energy, rel=0.03)


def test_a_cycle_time_leaves_its_duration(planner: Planner, plan: ProgramPlan) -> None:
    along = plan.movements[1]
    longer = planned(planner, 1.5 * plan.report.duration)
    assert [step.duration for step in longer.movements if step.kind == "cartesian"] == [
        along.duration
    ]


@pytest.mark.long
def test_a_cycle_that_only_the_path_would_fill_is_not_found_and_says_what_the_path_takes(
    planner: Planner, plan: ProgramPlan
) -> None:
    """No refusal: improving movements has spent the work, so the shortest that is known is named,
    and what no work shortens.
    """
    alone = plan.movements[1].duration
    found = asked(planner, alone)
    assert found.status.code is StatusCode.PLANNING_FAILED
    assert f"of which {alone:.3f} s are paths of the tool at their speed" in found.status.message
    shortest = re.search(r"the shortest is (\d+\.\d+) s", found.status.message)
    assert shortest is not None
    assert alone < float(shortest[1]) < plan.report.duration


def test_savings_are_over_a_common_program_that_drives_the_same_path(plan: ProgramPlan) -> None:
    assert plan.savings.available
    assert plan.savings.across == 2
    assert plan.common is not None
    assert plan.compared is not None
    for other in (plan.common, plan.compared):
        (along,) = [step for step in other.movements if step.kind == MovementKind.CARTESIAN]
        assert along.duration == plan.movements[1].duration


@pytest.mark.long
def test_no_other_configuration_along_the_path_costs_less(
    planner: Planner, plan: ProgramPlan
) -> None:
    cell = planner.cell
    start = np.array(cell.machine_home)
    options = PlanOptions(planning_time=60.0)
    request = ProgramRequest(cell, cell.robot.controller, STOPS, start, options)
    work = Work(200_000, 1.0, lambda: 0.0)
    route, context = prepared(request, Journal(work, 0))
    layers = layers_of(
        route, start, context, exit_searches(PlannerSettings().withdrawal), lambda *_: None
    )
    assert len(layers[2]) >= 8
    movements = Movements(route, layers, context, PlannerSettings().searches)
    rates = rates_of(context)
    costs = []
    for k in range(len(layers[2])):
        parts = [HopPart(1, ACROSS, 0, k), HopPart(1, ENTER, -1, k), HopPart(2, ACROSS, k, 0)]
        found = movements.plan(parts, 2_500)
        costs.append(
            sum(cost_of(one.report, rates) if hasattr(one, "report") else np.inf for one in found)
        )
    paid = sum(cost_of(step.report, rates) for step in plan.movements)
    assert paid <= min(costs) * 1.005
    assert paid < np.median(costs)  # the choice matters


def test_an_end_at_which_something_touches_is_refused(planner: Planner) -> None:
    cell = planner.cell
    (bead,) = cell.paths
    without = replace(cell, paths=(replace(bead, path=replace(bead.path, retract=0.0)),))
    refused = planner_of(without).plan_program(stations=STOPS, start=cell.machine_home)
    assert "along path bead" in refused.status.message
    assert "give it a retract" in refused.status.message
