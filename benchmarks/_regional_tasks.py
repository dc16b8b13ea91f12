"""Tasks of the regional benchmark: all of the cells, there and back, with the cost of answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ir_description import Cell, load_cell, load_power_data
from ir_planner.checks.energy import STEP_S, movement_energy
from ir_planner.scene.planning_scene import PlanningScene, load_text, scene_with
from ir_values.arrays import FloatArray

CELLS = ("open", "table_columns", "cnc_door", "deep_box")
S_M = 0.02  # m
SHARE_OF_ENDS = 0.8  # of the clearance at start and goal, where that is smaller
TIME_VALUE = 500.0  # W


@dataclass(frozen=True, eq=False)
class Task:
    """From start to goal (n,) rad in a scene that keeps `margin` [m]."""

    cell: str
    name: str
    scene: PlanningScene
    start: FloatArray
    goal: FloatArray
    margin: float

    @property
    def label(self) -> str:
        """Cell and task, as tables have it."""
        return f"{self.cell} {self.name}"


@dataclass(frozen=True)
class Cost:
    """J [J] = drive energy + 500 W x T, duration T [s]; energy [J] at the mains without the base
    load.
    """

    J: float
    duration: float
    energy: float

    @staticmethod
    def of(energy: float, duration: float) -> Cost:
        """From drive energy [J] and duration [s]."""
        return Cost(energy + TIME_VALUE * duration, duration, energy)


def scene_of(cell: str) -> PlanningScene:
    """A bundled cell or the cell of a file with its tool."""
    return scene_of_cell(load_cell(cell))


def scene_of_cell(cell: Cell) -> PlanningScene:
    """A cell with its tool."""
    return scene_with(cell, load_text(cell), load_power_data())


def tasks_of(cell: str) -> list[Task]:
    """Every task of a cell, there and back: `start->goal` and `goal->start`."""
    scene = scene_of(cell)
    described = scene.cell
    tasks = []
    for task in described.tasks:
        start, goal = (np.array(q, dtype=np.float64) for q in (task.start, task.goal))
        ends = float(scene.collision.min_distance(np.stack([start, goal])).distance.min())
        margin = min(S_M, SHARE_OF_ENDS * ends)
        first, _, last = task.name.partition("->")
        back = f"{last}->{first}" if last else f"{task.name} back"
        tasks.append(Task(described.name, task.name, scene, start, goal, margin))
        tasks.append(Task(described.name, back, scene, goal, start, margin))
    return tasks


def cost_of(trajectory: Any, scene: PlanningScene, step: float = STEP_S) -> Cost:
    """Cost of whatever has times, a duration and sample(t): the same joules for the project and its
    peers.
    """
    found = movement_energy(trajectory, scene, step)
    return Cost.of(found.total - found.base, trajectory.duration - float(trajectory.times[0]))
