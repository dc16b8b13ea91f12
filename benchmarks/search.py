"""How soon do two trees find a certified path, for every task of the cells and in both directions?

    python benchmarks/search.py [--cell FILE]... [--seeds N] [--boxes N [--boxes-seed N]] [--quick]
                                [--json FILE]

One thread, the whole call from Python, the cell's tool attached; S_m is 20 mm, or 80 % of the
clearance of the task's ends where that is less. --boxes: instead of these cells, N drawn ones of a
thousand boxes each, whole requests with the planner's default work, in processor time; solvable is
what a request solves with the same work, or trees of another seed with ten times as much. Closes
with one line per figure that was
asked for: measured value, bound, holds or falls short.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict, dataclass

import numpy as np
from _boxes import boxes_claims, boxes_rows
from _regional_tasks import Task, tasks_of
from _results import Claim, at_most, command_line, finish

from ir_kernels.search import BidirectionalTree

BOUNDS = {
    "open": 1.0,
    "table_columns": 2.0,
    "cnc_door": 10.0,
    "deep_box": 30.0,
}  # ms, of the median
BUDGET = 100_000  # certified edges, about a second


@dataclass(frozen=True)
class Row:
    """Times [ms] of one task in one direction over the seeds; edges: the work of the median;
    failed: runs.
    """

    cell: str
    task: str
    median: float
    worst: float
    edges: float
    failed: int


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = command_line(__doc__, list(BOUNDS), 30, "3 seeds; one cell of boxes, twice the work")
    parser.add_argument(
        "--boxes", type=int, default=0, help="cells of a thousand boxes, instead of others"
    )
    parser.add_argument("--boxes-seed", type=int, default=0, help="what they are drawn from")
    given = parser.parse_args()
    if given.quick:
        given.seeds, given.boxes = min(given.seeds, 3), min(given.boxes, 1)
    return given


def searched(task: Task, seed: int) -> tuple[float, int, bool]:
    """Milliseconds, certified edges and success of one search."""
    robot = task.scene.cell.robot
    model = task.scene.collision
    scale = np.maximum(np.sqrt(task.scene.weights / task.scene.weights[0]), 0.1)
    threshold = np.full(len(model.pairs), task.margin)
    low = robot.position_min
    high = robot.position_max
    begin = time.perf_counter()
    search = BidirectionalTree(
        model, task.start, task.goal[None], threshold, low, high, scale, seed
    )
    found = search.grow(BUDGET)
    path = search.path
    return 1e3 * (time.perf_counter() - begin), search.edges, bool(found and len(path) > 1)


def measured(task: Task, seeds: int) -> tuple[Row, list[float]]:
    """The row of a task, and the times [ms] of all runs."""
    times, edges, done = zip(*(searched(task, seed) for seed in range(seeds)), strict=True)
    median = float(np.median(times))
    worst = max(times)
    row = Row(task.cell, task.name, median, worst, float(np.median(edges)), seeds - sum(done))
    return row, list(times)


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    if given.boxes:
        boxes = boxes_rows(given.boxes, given.boxes_seed, more=2 if given.quick else 10)
        finish(given.json, boxes, boxes_claims(boxes))
        return
    rows: list[Row] = []
    claims: list[Claim] = []
    print(f"{'cell':16s}{'task':24s}{'median ms':>10s}{'worst ms':>10s}{'edges':>8s}{'failed':>8s}")
    for name in given.cell or list(BOUNDS):
        found = [measured(task, given.seeds) for task in tasks_of(name)]
        for row, _ in found:
            figures = f"{row.median:10.2f}{row.worst:10.2f}{row.edges:8.0f}{row.failed:8d}"
            print(f"{row.cell:16s}{row.task:24s}{figures}")
        times = [one for _, some in found for one in some]
        bound = BOUNDS.get(name, float("inf"))
        failed = sum(row.failed for row, _ in found)
        claims.append(
            at_most(f"{name}: median time to a path", float(np.median(times)), "ms", bound)
        )
        claims.append(at_most(f"{name}: runs without one", failed, f"of {len(times)}", 0))
        rows += [row for row, _ in found]
    finish(given.json, [asdict(row) for row in rows], claims)


if __name__ == "__main__":
    main()
