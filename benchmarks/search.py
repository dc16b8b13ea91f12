"""How soon two trees find a way: time to a certified path for every task of the cells, in both directions.

    python benchmarks/search.py [--cell FILE]... [--seeds N] [--json FILE]

One thread, the whole call from Python, the cell's tool attached; S_m is 20 mm, or 80 % of the clearance of
the task's ends where that is less. Closes with one line per figure that was asked for: measured value, bound,
holds or falls short.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from _kernels_dynamics import Claim
from kernels import commit, machine

from ir_description import load_cell, load_power_data
from ir_kernels.search import BidirectionalTree
from ir_planner.scene.planning_scene import PlanningScene, load_text, scene_with

BOUNDS = {"open": 1.0, "table_columns": 2.0, "cnc_door": 10.0, "deep_box": 30.0}  # ms, of the median
SAFETY = 0.02
BUDGET = 100_000  # certified edges, about a second


@dataclass(frozen=True)
class Row:
    """Times [ms] of one task in one direction over the seeds; edges: the work of the median; failed: runs."""

    cell: str
    task: str
    median: float
    worst: float
    edges: float
    failed: int


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else "")
    parser.add_argument(
        "--cell", action="append", help="cell file or name of a bundled one; default: those with a bound"
    )
    parser.add_argument("--seeds", type=int, default=30, help="runs per task and direction")
    parser.add_argument("--json", type=Path, help="also write the results here")
    return parser.parse_args()


def measure(name: str, scene: PlanningScene, seeds: int) -> tuple[list[Row], list[float]]:
    """A row per task and direction, and the times [ms] of all runs."""
    robot = scene.cell.robot
    scale = np.maximum(np.sqrt(scene.weights / scene.weights[0]), 0.1)
    rows: list[Row] = []
    all_times: list[float] = []
    for task in scene.cell.tasks:
        ends = np.array([task.start, task.goal])
        clearance = float(scene.collision.min_distance(ends).distance.min())
        threshold = np.full(len(scene.collision.pairs), min(SAFETY, 0.8 * clearance))
        for label, (start, goal) in ((task.name, ends), (f"{task.name} back", ends[::-1])):
            times, edges, failed = [], [], 0
            for seed in range(seeds):
                begin = time.perf_counter()
                search = BidirectionalTree(
                    scene.collision, start, goal[None], threshold, robot.position_min, robot.position_max,
                    scale, seed,
                )  # fmt: skip
                found = search.grow(BUDGET)
                path = search.path
                times.append((time.perf_counter() - begin) * 1e3)
                edges.append(search.edges)
                failed += not (found and len(path) > 1)
            rows.append(
                Row(name, label, float(np.median(times)), max(times), float(np.median(edges)), failed)
            )
            all_times += times
    return rows, all_times


def main() -> None:
    given = arguments()
    power = load_power_data()
    rows: list[Row] = []
    claims: list[Claim] = []
    for name in given.cell or list(BOUNDS):
        cell = load_cell(name)
        scene = scene_with(cell, load_text(cell), power)
        found, times = measure(name, scene, given.seeds)
        rows += found
        median, failed = float(np.median(times)), sum(row.failed for row in found)
        bound = BOUNDS.get(name, float("inf"))
        claims.append(Claim(f"{name}: median time to a path", median, "ms", bound, median <= bound))
        claims.append(Claim(f"{name}: runs without one", failed, f"of {len(times)}", 0, failed == 0))
    print(f"{'cell':16s}{'task':24s}{'median ms':>10s}{'worst ms':>10s}{'edges':>8s}{'failed':>8s}")
    for row in rows:
        print(
            f"{row.cell:16s}{row.task:24s}{row.median:10.2f}{row.worst:10.2f}{row.edges:8.0f}{row.failed:8d}"
        )
    print()
    for claim in claims:
        verdict = "holds" if claim.holds else "falls short"
        print(f"{claim.name:48s} {claim.value:10.3g} {claim.unit:10s} bound {claim.bound:<8g} {verdict}")
    if given.json:
        given.json.parent.mkdir(parents=True, exist_ok=True)
        result = {
            "machine": machine(),
            "commit": commit(),
            "rows": [asdict(row) for row in rows],
            "claims": [asdict(claim) for claim in claims],
        }
        given.json.write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
