"""The demonstration's program in the simulated robot: it costs what was planned, and the tool goes there."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from ir_description import load_cell
from ir_msgs_py.options import PlanOptions
from ir_planner.planner import Planner
from ir_sim_driver.controller.assembly import make_simulation
from ir_sim_driver.motion.goal import ErrorCode, TrajectoryGoal
from ir_sim_driver.plant.loads import carried

ENERGY_SHARE, ENERGY_JOULES = 0.05, 200.0  # whichever is larger
TOOL = 0.001  # m


@pytest.fixture(scope="module")
def program():
    """Movements of the planned program; the planner's clock stands still: no ceiling cuts the plan."""
    planner = Planner(itertools.repeat(0.0).__next__)
    cell = planner.set_cell("", "demo")
    plan = planner.plan_program((), 0.0, PlanOptions(seed=0), np.array(cell.park))
    assert plan.status.ok
    return plan.movements


def test_every_planned_movement_costs_and_goes_as_planned(program):
    cell = load_cell("demo")
    simulation = make_simulation(cell)
    simulation.backend.reset(np.array(cell.park))
    simulation.executor.hold(np.array(cell.park))
    driven = 0
    for movement in program:
        if movement.trajectory is None:
            continue
        if movement.load != simulation.load.text:
            simulation.set_load(carried(cell, movement.load))
        simulation.run(1.5)  # what the capacitor holds of the last movement feeds the holding torque
        simulation.execute(simulation.vet(TrajectoryGoal(movement.trajectory), 0), 0)
        outcomes = []
        while not outcomes:
            simulation.step()
            outcomes = simulation.take_outcomes()
        (outcome,) = outcomes
        assert outcome.code is ErrorCode.SUCCESSFUL
        assert outcome.max_tool_deviation < TOOL
        allowed = max(ENERGY_JOULES, ENERGY_SHARE * movement.report.energy)
        assert abs(outcome.energy - movement.report.energy) < allowed, movement.to_station
        driven += 1
    assert driven >= 4
