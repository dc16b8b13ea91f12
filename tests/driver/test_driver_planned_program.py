"""Generated programs of bundled cells in the simulated robot: every step, and the whole, costs
what was planned; the tool goes where it was planned.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
import pytest

from ir_description import Cell, ProgramStep, cell_to_yaml, load_cell
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import PlannedMovement
from ir_planner.planner import Planner
from ir_sim_driver.controller.simulation import Simulation, make_simulation
from ir_sim_driver.motion.goal import ErrorCode, TrajectoryGoal
from ir_sim_driver.plant.loads import carried

# whichever is larger
STEP_SHARE = 0.01
STEP_JOULES = 10.0
TOTAL_SHARE = 0.01
TOOL = 0.001  # m
LONGEST_PAUSE = 2.0  # s: the rest is stepped for nothing


@dataclass(frozen=True)
class Drawn:
    """A program of a cell, drawn by seed: -1 is the cell's own, with short pauses on motors, -2
    what of it takes a part and leaves it.
    """

    cell: str
    seed: int


FEW = (Drawn("demo", -2),)
MORE = (
    Drawn("demo", -1),
    Drawn("cnc_door", 1),
    Drawn("table_columns", 0),
    Drawn("demo", 0),
    Drawn("open", 0),
    Drawn("open", 1),
    Drawn("deep_box", 0),
    Drawn("cnc_door", 0),
)


def cell_of(drawn: Drawn) -> Cell:
    """The cell with the program that is drawn: stations and postures, with dwells of up to 2 s."""
    cell = load_cell(drawn.cell)
    if drawn.seed < 0:
        steps = tuple(_shortened(step) for step in cell.program)
        handling = tuple(step for step in steps if step.attach or step.detach)
        return replace(cell, program=steps if drawn.seed == -1 else handling)
    rng = np.random.default_rng([drawn.seed, *drawn.cell.encode()])
    names = [*(station.name for station in cell.stations), "park"]
    chosen: list[ProgramStep] = []
    while len(chosen) < 5:
        name = str(rng.choice(names))
        if not chosen or chosen[-1].target != name:
            kind = "POSTURE" if name == "park" else "STATION"
            dwell = float(np.round(rng.choice([0.0, 0.2, rng.uniform(0.5, LONGEST_PAUSE)]), 2))
            chosen.append(ProgramStep(kind, name, dwell))
    return replace(cell, program=tuple(chosen))


def _shortened(step: ProgramStep) -> ProgramStep:
    if step.kind == "PAUSE":
        return replace(step, dwell=min(step.dwell, LONGEST_PAUSE), power_mode="STAND_ON_MOTORS")
    return replace(step, dwell=min(step.dwell, LONGEST_PAUSE))


def drive(simulation: Simulation, movement: PlannedMovement) -> None:
    """A step on the simulated robot, without real time."""
    if movement.trajectory is None:
        simulation.run(movement.duration)
        return
    simulation.execute(simulation.vet(TrajectoryGoal(movement.trajectory), 0), 0)
    outcomes = []
    while not outcomes:
        simulation.step()
        outcomes = simulation.take_outcomes()
    (outcome,) = outcomes
    assert outcome.code is ErrorCode.SUCCESSFUL
    assert outcome.max_tool_deviation < TOOL


@pytest.mark.parametrize(
    "drawn",
    [*FEW, *(pytest.param(each, marks=pytest.mark.long) for each in MORE)],
    ids=lambda drawn: f"{drawn.cell} {drawn.seed}",
)
def test_every_step_and_the_whole_cost_what_was_planned(drawn: Drawn) -> None:
    cell = cell_of(drawn)
    planner = Planner(
        clock=itertools.repeat(0.0).__next__
    )  # its clock stands still: no ceiling cuts the plan
    planner.set_cell(text=cell_to_yaml(cell))
    plan = planner.plan_program(options=PlanOptions(seed=0), start=np.array(cell.park))
    assert plan.status.ok, plan.status.message
    simulation = make_simulation(cell)
    simulation.backend.reset(np.array(cell.park))
    simulation.executor.hold(np.array(cell.park))
    simulation.run(1.5)  # the controller has settled, the capacitor is empty
    begin = simulation.mains.energy()
    before = begin
    wrong = []
    for movement in plan.movements:
        if movement.load != simulation.load.text:
            simulation.set_load(carried(cell, movement.load))
        drive(simulation, movement)
        measured = simulation.mains.energy() - before
        planned = movement.report.energy
        before += measured
        if abs(measured - planned) > max(STEP_JOULES, STEP_SHARE * planned):
            wrong.append(
                f"{movement.kind} {movement.to_station}: {planned:.0f} J planned, {measured:.0f} J"
            )
    assert wrong == []
    assert before - begin == pytest.approx(plan.report.energy, rel=TOTAL_SHARE)
    assert len(plan.movements) >= 5
