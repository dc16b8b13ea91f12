"""Movements of cells to judge: each task there and back, and each movement of the program."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ir_description import Cell
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner, PlannerSettings
from ir_planner.request import Goal
from ir_values.arrays import FloatArray

SHARE_OF_ENDS = 0.8  # of the clearance at start and goal, where that is less than S_m
S_M = 0.02  # m


@dataclass(frozen=True, eq=False)
class CellMovement:
    """A certified movement with its load ("gripper+gear") and its report."""

    cell: Cell
    name: str
    load: str
    trajectory: JointTrajectory
    report: TrajectoryReport


def planner_in(cell: str, settings: PlannerSettings) -> Planner:
    """A planner in a bundled cell or the cell of a file."""
    return Planner(cell, clock=time.monotonic, settings=settings)


def movements_of(planner: Planner, objective: str = "time_and_energy") -> Iterator[CellMovement]:
    """All movements of the planner's cell, planned with its defaults for an objective."""
    cell = planner.cell
    if cell.program:
        plan = planner.plan_program(
            options=PlanOptions(objective=objective), start=np.array(cell.park)
        )
        for step in plan.movements:
            if step.trajectory is not None:
                name = f"{step.from_station}->{step.to_station}"
                yield CellMovement(cell, name, step.load, step.trajectory, step.report)
    for task in cell.tasks:
        there = (task.start, task.goal)
        back = (task.goal, task.start)
        for ends, name in ((there, task.name), (back, f"{task.name} back")):
            options = PlanOptions(objective=objective, safety_distance=_margin(planner, ends))
            plan_of = planner.plan_regional(
                start=ends[0], goal=Goal(configuration=ends[1], text=name), options=options
            )
            if plan_of.trajectory is not None:
                load = planner.scene().load_text
                yield CellMovement(cell, name, load, plan_of.trajectory, plan_of.report)


def _margin(planner: Planner, ends: tuple[FloatArray, ...]) -> float:
    least = min(planner.check_state(q, safety_distance=0.0, max_pairs=1).min_distance for q in ends)
    return min(S_M, SHARE_OF_ENDS * float(least))
