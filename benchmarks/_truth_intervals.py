"""Do the 90 % intervals that the planner gives before any measurement hold what typical plants
draw?

The plants are drawn by the driver's own rules (docs/plant.md), which the planner's assumptions do
not know; they follow the commands exactly (`_tracked_run`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from _driven_movements import Predicted, all_predicted
from _over_seeds import over_seeds
from _results import at_least, at_most
from _tracked_run import TrackedRun
from _truth_section import Asked, Found

from ir_description import load_power_data
from ir_description.library import load_power_parameters
from ir_planner.checks import JouleInterval, interval, movement_spread
from ir_planner.scene import scene_with
from ir_sim_driver.plant import typical_plant

TITLE = "90 % intervals before any measurement, against simulated energies of typical plants"
QUICK = ("open",)
# share of energies that lie within
LEAST = 0.80
MOST = 0.97


def measured(asked: Asked) -> Found:
    """A row for each plant: which share of its movements lies within, below and above."""
    every = all_predicted(QUICK if asked.quick else asked.cells)
    bounds = [_interval(each) for each in every]
    rows: list[dict[str, Any]] = over_seeds(
        lambda seed: _held(every, bounds, seed), range(asked.seeds)
    )
    within = float(np.mean([row["within"] for row in rows]))
    widths = [(b.high - b.low) / each.energy for b, each in zip(bounds, every, strict=True)]
    rows.append(
        {
            "plant": "all",
            "parameters": load_power_parameters().name,
            "width": float(np.median(widths)),
        }
    )
    name = (
        f"energies of {asked.seeds} typical plants within the 90 % interval before any measurement"
    )
    return Found(rows, [at_least(name, within, "", LEAST), at_most(name, within, "", MOST)])


def _interval(each: Predicted) -> JouleInterval:
    movement = each.movement
    scene = scene_with(movement.cell, movement.load, load_power_data())
    return interval(each.energy, movement_spread(movement.trajectory, scene))


def _held(every: list[Predicted], bounds: list[JouleInterval], seed: int) -> dict[str, Any]:
    plants: dict[str, TrackedRun] = {}
    low = np.array([b.low for b in bounds])
    high = np.array([b.high for b in bounds])
    found = []
    for each in every:
        movement = each.movement
        cell = each.movement.cell
        if cell.name not in plants:
            plant = typical_plant(cell.robot, load_power_data(), seed)
            plants[cell.name] = TrackedRun(cell, plant, movement.load)
        run = plants[cell.name]
        run.hold(movement.load, scene_with(cell, movement.load, load_power_data()).loads)
        found.append(run.energy(movement.trajectory))
    energy = np.array(found)
    shares = {
        "within": np.mean((energy >= low) & (energy <= high)),
        "below": np.mean(energy < low),
        "above": np.mean(energy > high),
    }
    return {"plant": f"typical:{seed}", "movements": len(every)} | {
        k: float(v) for k, v in shares.items()
    }
