"""Every movement of the bundled cells on the nominal plant, against the planner's model."""

from __future__ import annotations

from typing import Any

from _driven_movements import all_predicted, plant_by_cell
from _results import at_most
from _truth_section import Asked, Found

TITLE = "the nominal plant costs what the planner's model says, movement by movement"
# whichever is larger
SHARE = 0.01
JOULES = 10.0
QUICK = ("open",)


def measured(asked: Asked) -> Found:
    """Predicted and simulated energy of every movement."""
    rows: list[dict[str, Any]] = []
    every = all_predicted(QUICK if asked.quick else asked.cells)
    plants = plant_by_cell(every, "nominal")
    for each in every:
        movement = each.movement
        plant = plants[movement.cell.name]
        outcome = plant.drive(movement)
        off = outcome.energy - each.energy
        rows.append(
            {
                "cell": movement.cell.name,
                "movement": movement.name,
                "ended": outcome.code.name,
                "predicted_j": each.energy,
                "simulated_j": outcome.energy,
                "off_j": off,
                "share_of_bound": abs(off) / max(JOULES, SHARE * each.energy),
                "tool_mm": 1e3 * outcome.max_tool_deviation,
            }
        )
    worst = max(row["share_of_bound"] for row in rows)
    failed = sum(row["ended"] != "SUCCESSFUL" for row in rows)
    return Found(
        rows,
        [
            at_most(f"nominal plant, {len(rows)} movements: worst, of 1 % or 10 J", worst, "", 1.0),
            at_most("nominal plant: movements that did not end successful", failed, "", 0.0),
        ],
    )
