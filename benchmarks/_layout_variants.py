"""Layout studies of cells that nobody tuned for: what bounds lose of an exhaustive grid of each.

A bundled cell is mirrored, turned and jittered by `_variants`; two of the things that a layout
study may move, the masses of parts and whether there is a cycle time are drawn with it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from _results import Claim, at_least, at_most, line_of
from _variants import variant

from ir_description import Cell, Equipment, cell_to_yaml, load_cell
from ir_studies import LayoutSettings, run_layout
from ir_studies.layout import Layouts

CELLS = ("demo", "kr6_bench", "ur10e_bench", "kr300_pallets", "open")
SEED = 14
STEPS = 5  # more placements than the search plans before it has a bound
EVERYTHING = 1000.0  # a margin that excludes nothing
SHARE = 0.2  # of the given placement's cycle when it is free: a cycle time has so much more
REACH = 0.12  # of the distance to the furthest station: how far things go
TURN_DEG = 20.0
PARK_DEG = 30.0
COUNT = 2  # per cell
STOPS = 3  # of a program: enough for carried parts and for a choice of configurations


@dataclass(frozen=True)
class Grid:
    """A generated study as a grid, free in time; timed: whether it is asked in a cycle time."""

    name: str
    settings: LayoutSettings
    timed: bool


def grids(cells: tuple[str, ...], count: int, steps: int, folder: Path) -> Iterator[Grid]:
    """`count` per cell; the same arguments give the same."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in cells:
        for number in range(count):
            yield grid(load_cell(name), number, steps, folder)


def grid(given: Cell, number: int, steps: int, folder: Path) -> Grid:
    """One of a cell: its variant is written beside the results."""
    cell = variant(given, SEED, number)
    file = folder / f"{cell.name}.yaml"
    file.write_text(cell_to_yaml(cell))
    rng = np.random.default_rng([SEED, number, *given.name.encode(), 1])
    masses = {
        part.name: (float(round(part.load.mass * rng.uniform(0.3, 1.2), 1)),) for part in cell.parts
    }
    settings = LayoutSettings(
        cell=str(file),
        carried=tuple(one.name for one in cell.equipment if _below_base(one, cell)),
        **_moved(cell, rng),
        payloads=masses,
        stations=tuple(station.name for station in cell.stations)[:STOPS],
        method="grid",
        steps=steps,
        keep=1,
        seeds=3,
        margin=0.0,
    )
    return Grid(cell.name, settings, bool(rng.random() < 0.5))


def _below_base(machine: Equipment, cell: Cell) -> bool:
    """Whether the robot stands on it."""
    return any(body.name in pair for body in machine.bodies for pair in cell.base_contacts)


def _moved(cell: Cell, rng: np.random.Generator) -> dict[str, Any]:
    """Two things that may move, and how far: the base, a machine with stations, the posture, the
    tool.
    """
    far = max(float(np.linalg.norm((s.pose - cell.base_pose)[:2, 3])) for s in cell.stations)
    machines = sorted({station.equipment for station in cell.stations})
    choices = [("base", part) for part in ("x", "y", "turn_deg")] + [
        ("park", "a1_deg"),
        ("park", "a2_deg"),
    ]
    choices += [(machine, part) for machine in machines for part in ("x", "y", "turn_deg")]
    choices += [("tool", "x"), ("tool", "a_deg")] if cell.tool is not None else []
    found: dict[str, dict[str, tuple[float, float]]] = {}
    for k in rng.choice(len(choices), 2, replace=False):
        owner, part = choices[k]
        most = PARK_DEG if owner == "park" else TURN_DEG if part.endswith("_deg") else REACH * far
        width = round(most * rng.uniform(0.5, 1.0), 2)
        found.setdefault(owner, {})[part] = (-width, width)
    own: dict[str, Any] = {
        name: found.pop(name) for name in ("base", "park", "tool") if name in found
    }
    return {**own, "equipment": found}


def grid_claims(folder: Path, *, quick: bool) -> list[Claim]:
    """What bounds lose, in all of them; quick: one of each of two small cells."""
    cells, count = (CELLS[1:3], 1) if quick else (CELLS, COUNT)
    asked = grids(cells, count, STEPS, folder / "cells")
    rows = [row for one in asked if (row := compared(one, folder)) is not None]
    enough = at_least(
        "generated grids with a possible placement", len(rows), "", 0.5 * count * len(cells)
    )
    if not rows:
        return [enough]
    total = {key: sum(row[key] for row in rows) for key in ("plans", "grid_plans", "below_bound")}
    deepest = max(0.0, *(row["percent_below"] for row in rows))
    print(line_of({**total, "percent_below": deepest}))
    worst = max(row["lost_percent"] - row["spread_percent"] for row in rows)
    name = f"layout, {len(rows)} generated grids"
    return [
        enough,
        at_most(f"{name}: best above the grid's beyond the spread", worst, "%", 1.0),
        at_most(f"{name}: share planned", total["plans"] / total["grid_plans"], "", 0.95),
    ]


def compared(one: Grid, folder: Path) -> dict[str, Any] | None:
    """A bounded search against the whole grid, None where no placement is possible."""
    place = folder / one.name
    settings = one.settings
    if one.timed:
        free = run_layout(replace(settings, plans=1, seeds=1), place / "free")
        seconds = [
            row["duration_s"]
            for known in free.known
            for row in known.plans.values()
            if row["solved"]
        ]
        if seconds:
            settings = replace(
                settings, cycle_times=(float(math.ceil((1.0 + SHARE) * seconds[0])),)
            )
    whole = run_layout(replace(settings, margin=EVERYTHING), place)
    bounded = run_layout(settings, place)
    if not any(math.isfinite(known.cost) for known in whole.known):
        print(f"{one.name}: no placement is possible", flush=True)
        return None
    row = {
        "layout": one.name,
        "moved": " ".join(v.name for v in settings.variables),
        **of_grid(bounded, whole),
    }
    print(line_of(row), flush=True)
    return row


def of_grid(bounded: Layouts, whole: Layouts) -> dict[str, Any]:
    """What was left out, and what of it costs less than its bound."""
    best = least(bounded)
    grid_best = least(whole)
    planned = [known for known in bounded.known if math.isfinite(known.cost)]
    coarse, cost = np.array([[known.coarse, known.cost] for known in planned]).T
    slope = np.clip(np.polyfit(coarse, cost, 1)[0], 0.0, 1.0) if bounded.settings.in_cycles else 1.0
    above = float(np.min(cost - slope * coarse))
    seen = {known.placement.key for known in bounded.known if known.planned}
    left = [k for k in whole.known if math.isfinite(k.cost) and k.placement.key not in seen]
    below = [(slope * known.coarse + above - known.cost) / known.cost for known in left]
    spread = max(
        one.spread("cost_j") / one.mean("cost_j")
        for own in whole.finals
        for one in own
        if one.solved
    )
    return {
        "best_j": best,
        "lost_percent": 100.0 * (best / grid_best - 1.0),
        "spread_percent": 100.0 * spread,
        "placements": len(whole.known),
        "plans": len(planned),
        "grid_plans": len(planned) + len(left),
        "below_bound": sum(one > 0.0 for one in below),
        "percent_below": 100.0 * max(below, default=0.0),
    }


def least(found: Layouts) -> float:
    """Cost of the best placement."""
    return min(one.cost for one in found.known if math.isfinite(one.cost))
