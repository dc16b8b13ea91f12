"""The torque reserve: how much robots that differ from their data need, and what leaving it costs.

The default of `torque_reserve` follows from the first row: the 99 % quantile, over drawn robots and
the fastest movements of the cells, of the largest share of the torque envelope that a robot needs
beyond what its data say, and TRACKING for the feedback itself, rounded up to a twentieth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from _cell_movements import CellMovement, movements_of, planner_in
from _results import Claim, at_most
from _truth_section import Asked, Found

from ir_description import PowerParameters, load_power_data
from ir_description.library import load_power_parameters
from ir_planner import PlannerSettings
from ir_planner.scene import Drives, scene_with, torque_use
from ir_values.arrays import FloatArray

TITLE = "torque that is left to the feedback"
TRACKING = 0.02  # of the envelope: what the feedback itself needs
QUANTILE = 0.99
ROBOTS_PER_SEED = 2
SAMPLES = 400  # per movement
OBJECTIVES = ("time", "time_and_energy")


def measured(asked: Asked) -> Found:
    """What the reserve has to be, and what it costs in seconds and joules."""
    found = Found()
    default = PlannerSettings().torque_reserve
    sheet = load_power_parameters()
    robots = [sheet.drawn(seed) for seed in range(ROBOTS_PER_SEED * asked.seeds)]
    for objective in OBJECTIVES:
        without = _planned(asked.cells, objective, 0.0)
        kept = _planned(asked.cells, objective, default)
        beyond = np.concatenate([_beyond(movement, robots) for movement in without])
        seconds, joules = _totals(without)
        longer, more = _totals(kept)
        row = {"objective": objective, "movements": len(without), "robots": len(robots)}
        quantiles = np.quantile(beyond, (0.5, QUANTILE, 1.0)).tolist()
        row |= dict(zip(("beyond 50 %", "beyond 99 %", "beyond most"), quantiles, strict=True))
        row |= {"reserve": default, "seconds %": 100.0 * (longer / seconds - 1.0)}
        found.rows.append(row | {"joules %": 100.0 * (more / joules - 1.0)})
        if objective == "time":
            needed = float(np.quantile(beyond, QUANTILE)) + TRACKING
            found.claims.append(_claim(needed, default))
    return found


def _claim(needed: float, default: float) -> Claim:
    return at_most(
        "torque beyond the plan's, 99 % quantile, with the feedback", needed, "", default
    )


def _planned(cells: Sequence[str], objective: str, reserve: float) -> list[CellMovement]:
    settings = PlannerSettings(torque_reserve=reserve)
    return [m for cell in cells for m in movements_of(planner_in(cell, settings), objective)]


def _totals(movements: list[CellMovement]) -> tuple[float, float]:
    return sum(m.trajectory.duration for m in movements), sum(m.report.energy for m in movements)


def _beyond(movement: CellMovement, robots: list[PowerParameters]) -> FloatArray:
    """Largest share of torque (R,) that each robot needs, less that of the data's robot."""
    scene = scene_with(movement.cell, movement.load, load_power_data())
    motion = movement.trajectory.sample(np.linspace(0.0, movement.trajectory.duration, SAMPLES))
    models = [scene, *(replace(scene, drives=Drives(parameters=robot)) for robot in robots)]
    use = np.array([torque_use(m.dynamics, motion.q, motion.qd, motion.qdd).max() for m in models])
    return np.asarray(use[1:] - use[0])
