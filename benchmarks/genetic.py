"""How surely and how fast does the genetic correction get round what is in the way, and what matters in it?

    python benchmarks/genetic.py [--cell FILE]... [--seeds N] [--json FILE]

Every task there and back whose straight movement is not free, with the default settings and with one of them
changed. "first": until the first free way (no generation follows it), "all": until the different ways are
there, both in ms of processor time; W of the cheapest way as a multiple of the straight movement's, raw
and polished; work in edges.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from _regional_figures import Claim, at_least, at_most
from _regional_tasks import CELLS, Task, tasks_of
from kernels import commit, machine

from ir_planner.checks.free_space import FreeSpace
from ir_planner.request.work import Work
from ir_planner.scene.movement_cost import movement_cost, path_cost
from ir_planner.search.correction import Correction, corrected
from ir_planner.search.genetic_settings import GeneticSettings
from ir_planner.search.shortcuts import fewest_corners, pulled

DEFAULT = "default"
VARIANTS: dict[str, dict[str, Any]] = {
    DEFAULT: {},
    "spline of eq. 10": {"shape": "spline"},
    "1 via": {"vias": 1},
    "3 vias": {"vias": 3},
    "whole movement": {"margin": 10.0},
    "closely confined": {"margin": 0.1},
    "not parted": {"parting": 0.0},
    "one island": {"islands": 1},
    "population 96": {"population": 96},
    "population 24": {"population": 24},
}
EDGES = 60_000  # the planner's default budget


@dataclass(frozen=True)
class Search:
    """One search: solved, ms, ways, W as a multiple of the straight movement's (nan: nothing), work."""

    solved: bool
    first_ms: float
    all_ms: float
    ways: int
    raw: float
    polished: float
    work: int


def space_of(task: Task) -> FreeSpace:
    """Free space of a task with a budget of its own."""
    budget = Work(EDGES, time.perf_counter() + 60.0, time.perf_counter)
    return FreeSpace.of(task.scene, task.margin, budget)


def straight_is_free(task: Task) -> bool:
    """Whether there is nothing to correct."""
    return bool(space_of(task).edges_free(task.start[None], task.goal[None])[0])


def timed(task: Task, settings: GeneticSettings, seed: int) -> tuple[Correction, float, FreeSpace]:
    """A correction, its time in ms and the space it was charged to."""
    space = space_of(task)
    begin = time.process_time()
    found = corrected(task.start, task.goal, space, settings, np.random.default_rng(seed))
    return found, 1e3 * (time.process_time() - begin), space


def searched(task: Task, settings: GeneticSettings, seed: int) -> Search:
    """One seed."""
    _, first_ms, _ = timed(task, replace(settings, settle=0, ways=1), seed)
    found, all_ms, space = timed(task, settings, seed)
    work, weights = space.work.iterations, task.scene.weights
    if not found.ways:
        return Search(False, first_ms, all_ms, 0, np.nan, np.nan, work)
    straight = float(movement_cost(weights, task.start, task.goal))
    polished = [pulled(fewest_corners(way, space, weights), space, weights) for way in found.ways]
    cheapest = min(path_cost(weights, way) for way in polished)
    raw = path_cost(weights, found.ways[0])
    return Search(True, first_ms, all_ms, len(found.ways), raw / straight, cheapest / straight, work)


def row_of(cell: str, variant: str, searches: list[Search]) -> dict[str, Any]:
    """What a cell's searches say."""
    solved = [search for search in searches if search.solved]
    first = [search.first_ms for search in searches]
    whole = [search.all_ms for search in searches]

    def mean(values: list[float]) -> float:
        return round(float(np.mean(values)), 3) if values else float("nan")

    return {
        "cell": cell,
        "variant": variant,
        "solved": len(solved),
        "of": len(searches),
        "first_ms": round(float(np.median(first)), 2),
        "first_p95_ms": round(float(np.percentile(first, 95)), 1),
        "all_ms": round(float(np.median(whole)), 2),
        "all_p95_ms": round(float(np.percentile(whole, 95)), 1),
        "ways": mean([search.ways for search in solved]),
        "W": mean([search.raw for search in solved]),
        "W_polished": mean([search.polished for search in solved]),
        "work": round(float(np.mean([search.work for search in searches]))),
    }


def claims_of(rows: list[dict[str, Any]]) -> list[Claim]:
    """What the default settings are held to."""
    by_cell = {row["cell"]: row for row in rows if row["variant"] == DEFAULT}
    claims = [
        at_least(f"{cell}: corrected", 100.0 * by_cell[cell]["solved"] / by_cell[cell]["of"], "%", 100.0)
        for cell in ("open", "table_columns")
        if cell in by_cell
    ]
    if "open" in by_cell:
        claims.append(at_most("open: first free way, median", by_cell["open"]["first_ms"], "ms", 4.0))
    if "table_columns" in by_cell:
        found = by_cell["table_columns"]["all_p95_ms"]
        claims.append(at_most("table_columns: all ways, p95", found, "ms", 90.0))
    return claims


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cell", action="append", help=f"file or bundled cell; default: {', '.join(CELLS)}")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--json", type=Path, help="also write the results here")
    given = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for cell in given.cell or CELLS:
        tasks = [task for task in tasks_of(cell) if not straight_is_free(task)]
        for variant, changed in VARIANTS.items():
            settings = GeneticSettings(**changed)
            searches = [searched(task, settings, seed) for task in tasks for seed in range(given.seeds)]
            if searches:
                rows.append(row_of(tasks[0].cell, variant, searches))
                print("  ".join(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
    print()
    claims = claims_of(rows)
    for claim in claims:
        verdict = "holds" if claim.holds else "falls short"
        print(f"{claim.name:40s} {claim.value:10.4g} {claim.unit:4s} bound {claim.bound:<10.6g} {verdict}")
    if given.json:
        given.json.parent.mkdir(parents=True, exist_ok=True)
        result = {
            "machine": f"{machine()}, load {os.getloadavg()[0]:.1f}",
            "commit": commit(),
            "rows": rows,
            "claims": [asdict(claim) for claim in claims],
        }
        given.json.write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
