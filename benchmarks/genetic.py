"""How surely and how fast does the genetic correction find a free path, and which settings matter?

    python benchmarks/genetic.py [--cell FILE]... [--seeds N] [--quick] [--json FILE]

Every task there and back whose straight movement is not free, with the default settings and with
one of them changed. "first": until the first free path (no generation follows it), "all": until the
different paths are there, both in ms of processor time; W of the cheapest path as a multiple of the
straight movement's, raw and polished; work in edges.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from _regional_tasks import CELLS, Task, tasks_of
from _results import Claim, at_least, at_most, command_line, finish, line_of

from ir_planner.checks.free_space import FreeSpace
from ir_planner.request.context import Work
from ir_planner.scene.planning_scene import movement_cost, path_cost
from ir_planner.search.correction import Correction, corrected
from ir_planner.search.genetic import Genetic
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
    """One search: solved, ms, paths, W as a multiple of the straight movement's (nan: nothing),
    work.
    """

    solved: bool
    first_ms: float
    all_ms: float
    paths: int
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


def timed(task: Task, settings: Genetic, seed: int) -> tuple[Correction, float, FreeSpace]:
    """A correction, its time in ms and the space it was charged to."""
    space = space_of(task)
    begin = time.process_time()
    found = corrected(task.start, task.goal, space, settings, np.random.default_rng(seed))
    return found, 1e3 * (time.process_time() - begin), space


def searched(task: Task, settings: Genetic, seed: int) -> Search:
    """One seed."""
    _, first_ms, _ = timed(task, replace(settings, settle=0, paths=1), seed)
    found, all_ms, space = timed(task, settings, seed)
    work = space.work.iterations
    weights = task.scene.weights
    if not found.paths:
        return Search(False, first_ms, all_ms, 0, np.nan, np.nan, work)
    straight = float(movement_cost(weights, task.start, task.goal))
    polished = [
        pulled(fewest_corners(path, space, weights), space, weights) for path in found.paths
    ]
    cheapest = min(path_cost(weights, path) for path in polished)
    raw = path_cost(weights, found.paths[0])
    return Search(
        True, first_ms, all_ms, len(found.paths), raw / straight, cheapest / straight, work
    )


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
        "paths": mean([search.paths for search in solved]),
        "W": mean([search.raw for search in solved]),
        "W_polished": mean([search.polished for search in solved]),
        "work": round(float(np.mean([search.work for search in searches]))),
    }


def claims_of(rows: list[dict[str, Any]]) -> list[Claim]:
    """What the default settings are held to."""
    by_cell = {row["cell"]: row for row in rows if row["variant"] == DEFAULT}
    claims = [
        at_least(
            f"{cell}: corrected", 100.0 * by_cell[cell]["solved"] / by_cell[cell]["of"], "%", 100.0
        )
        for cell in ("open", "table_columns")
        if cell in by_cell
    ]
    if "open" in by_cell:
        claims.append(
            at_most("open: first free path, median", by_cell["open"]["first_ms"], "ms", 4.0)
        )
    if "table_columns" in by_cell:
        found = by_cell["table_columns"]["all_p95_ms"]
        claims.append(at_most("table_columns: all paths, p95", found, "ms", 90.0))
    return claims


def arguments() -> argparse.Namespace:
    """The command line."""
    given = command_line(
        __doc__, CELLS, 10, "1 seed, the default settings and two variants"
    ).parse_args()
    if given.quick:
        given.seeds = min(given.seeds, 1)
    return given


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    rows: list[dict[str, Any]] = []
    variants = dict(list(VARIANTS.items())[: 3 if given.quick else None])
    for cell in given.cell or CELLS:
        tasks = [task for task in tasks_of(cell) if not straight_is_free(task)]
        for variant, changed in variants.items():
            settings = Genetic(**changed)
            searches = [
                searched(task, settings, seed) for task in tasks for seed in range(given.seeds)
            ]
            if searches:
                rows.append(row_of(tasks[0].cell, variant, searches))
                print(line_of(rows[-1]), flush=True)
    finish(given.json, rows, claims_of(rows))


if __name__ == "__main__":
    main()
