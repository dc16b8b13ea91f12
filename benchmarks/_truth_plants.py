"""Typical plants that drive the movements of the cells: do they stay within the tube, at what
energy?
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from _driven_movements import all_predicted, plant_by_cell
from _over_seeds import over_seeds
from _results import at_least, at_most
from _truth_section import Asked, Found

TITLE = "typical plants: tracking, tube, and predicted against simulated energy before any fit"
QUICK = ("open",)
OBJECTIVES = ("time", "time_and_energy")
QUICK_OBJECTIVES = ("time",)


def measured(asked: Asked) -> Found:
    """A row for each plant and objective, over all movements of the cells."""
    rows: list[dict[str, Any]] = []
    cells = QUICK if asked.quick else asked.cells
    for objective in QUICK_OBJECTIVES if asked.quick else OBJECTIVES:
        every = all_predicted(cells, objective)
        work = partial(_driven, every, objective)
        rows += over_seeds(work, range(asked.seeds))
    kept = sum(row["movements"] - row["failed"] for row in rows) / sum(
        row["movements"] for row in rows
    )
    return Found(
        rows,
        [
            at_least(
                f"{asked.seeds} typical plants: share of movements driven in the tube",
                kept,
                "",
                1.0,
            ),
            at_most("their largest tool deviation", max(row["tool_mm"] for row in rows), "mm", 5.0),
        ],
    )


def _driven(every: Sequence[Any], objective: str, seed: int) -> dict[str, Any]:
    """What a plant makes of all movements; energies of those that ended successful."""
    plants = plant_by_cell(every, f"typical:{seed}")
    off = []
    tool = [0.0]
    error = [0.0]
    settling = [0.0]
    failed = 0
    for each in every:
        movement = each.movement
        plant = plants[movement.cell.name]
        outcome = plant.drive(movement)
        tool.append(outcome.max_tool_deviation)
        error.append(max(outcome.max_tracking_error))
        settling.append(outcome.settling_time)
        if outcome.code.name == "SUCCESSFUL":
            off.append(100.0 * (outcome.energy / each.energy - 1.0))
        else:
            failed += 1
    shares = np.array(off)
    return {
        "plant": f"typical:{seed}",
        "objective": objective,
        "movements": len(every),
        "failed": failed,
        "tool_mm": 1e3 * max(tool),
        "tracking_mrad": 1e3 * max(error),
        "settling_s": max(settling),
        "energy_off_median_percent": float(np.median(shares)),
        "energy_off_least_percent": float(shares.min()),
        "energy_off_most_percent": float(shares.max()),
    }
