"""How soon is one regional movement known: a coarse solution, and the certified answer?

    python benchmarks/movement.py [--cell FILE]... [--variants N [--variant-seed N]] [--seeds N]
    [--quick]
                                  [--json FILE]

Every task of the cells, there and back, apart by whether its straight movement (PTP) is free.
Processor time, the least of the repetitions (the seed stays). Coarse: an estimate from the straight
segment where it is free, else from guesses of all classes; `first`: from the first free path alone.
Their costs, with the penalties of a coarse solution, are held against J of the answer. --variants:
instead of the cells, N of each that nobody tuned for.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from _regional_ours import UNHURRIED, asked, planner_of
from _regional_tasks import CELLS, Task, tasks_of
from _results import Claim, at_least, at_most, command_line, finish, line_of
from _variants import variant_files

from ir_kernels.collision import FREE
from ir_planner.checks import FreeSpace
from ir_planner.optimize import Refinement, estimate
from ir_planner.planner import Planner
from ir_planner.regional.exploration import first_paths
from ir_planner.request import Context, Work
from ir_planner.request.goals import Goal
from ir_planner.search import Ends, guesses

NEAR = 1.05  # of J of the answer
VARIANTS = Path("out/variants")


@dataclass(frozen=True)
class Row:
    """One task: ms of processor time; costs of coarse solutions over J [J] of the answer."""

    task: str
    free: bool
    first_ms: float
    first_over: float
    coarse_ms: float
    coarse_over: float
    answer_ms: float
    J: float


def least(repetitions: int, function: Callable[[], float]) -> tuple[float, float]:
    """Least milliseconds of processor time, and what the function returned."""
    times = []
    for _ in range(repetitions):
        begin = time.process_time()
        found = function()
        times.append(1e3 * (time.process_time() - begin))
    return min(times), found


def coarse(planner: Planner, task: Task, *, alone: bool) -> float:
    """Cost of the coarse solution: `alone` of the straight segment where it is free, of the first
    free path where not; else of the cheapest of guesses where the segment is not free.
    """
    options = asked(task)
    cell = task.scene.cell
    work = Work(planner.settings.max_iterations, time.monotonic() + UNHURRIED, time.monotonic)
    context = Context.of(task.scene, options, work)
    searches = planner.settings.searches
    ends = Ends(task.start, task.goal[None])
    space = FreeSpace.of(task.scene, task.margin, work)
    segment = np.stack([task.start, task.goal])
    if space.edges_free(segment[:1], segment[1:])[0]:
        return estimate([segment], Refinement(context)).cost
    if not alone:
        looks = guesses(task.start, task.goal, np.array(cell.park), space.low, space.high)
        return estimate(looks, Refinement(context)).cost
    paths = first_paths(ends, space, context, searches, briefly=True)
    paths = paths or first_paths(ends, space, context, searches, briefly=False)
    return estimate([path for _, path in paths][:1], Refinement(context)).cost


def answered(planner: Planner, task: Task) -> float:
    """J of the answer [J]."""
    report = planner.plan_regional(
        start=task.start, goal=Goal(configuration=task.goal), options=asked(task)
    ).report
    drives: float = report.energy - report.base_energy
    return drives + asked(task).time_value * report.duration


def measured(planner: Planner, task: Task, repetitions: int) -> Row:
    """All figures of one task."""
    space = FreeSpace.of(task.scene, task.margin, Work(1, np.inf, time.monotonic))
    found = task.scene.collision.certify_edges(task.start[None], task.goal[None], space.threshold)
    answer_ms, J = least(repetitions, lambda: answered(planner, task))
    first_ms, first = least(repetitions, lambda: coarse(planner, task, alone=True))
    coarse_ms, cheapest = least(repetitions, lambda: coarse(planner, task, alone=False))
    free = bool(found.verdict[0] == FREE)
    return Row(
        task.label, free, first_ms, _over(first, J), coarse_ms, _over(cheapest, J), answer_ms, J
    )


def _over(cost: float, J: float) -> float:
    return cost / J if J > 0.0 else float("inf")


def claims_of(rows: Sequence[Row]) -> list[Claim]:
    """Medians, apart by whether the PTP is free."""
    claims = []
    for free, name, bound in ((True, "PTP free", 15.0), (False, "PTP not free", 30.0)):
        some = [row for row in rows if row.free == free]
        if not some:
            continue
        near = 100.0 * float(np.mean([row.coarse_over <= NEAR for row in some]))
        first = 100.0 * float(np.mean([row.first_over <= NEAR for row in some]))
        claims += [
            at_most(
                f"{name}: certified answer, median",
                np.median([r.answer_ms for r in some]),
                "ms",
                bound,
            ),
            at_most(
                f"{name}: first coarse solution, median",
                np.median([r.first_ms for r in some]),
                "ms",
                2,
            ),
            at_least(f"{name}: it costs at most {NEAR} times the answer", first, "%", 95.0),
            at_most(
                f"{name}: coarse solutions of all classes, median",
                np.median([r.coarse_ms for r in some]),
                "ms",
                2.0,
            ),
            at_least(f"{name}: the best costs at most {NEAR} times the answer", near, "%", 95.0),
        ]
    return claims


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = command_line(__doc__, CELLS, 10, "3 repetitions of every third task")
    parser.add_argument(
        "--variants", type=int, default=0, help="mirrored, turned and jittered ones per cell"
    )
    parser.add_argument(
        "--variant-seed", type=int, default=0, help="what the variants are drawn from"
    )
    given = parser.parse_args()
    given.cell = given.cell or CELLS
    if given.variants:
        given.cell = variant_files(given.cell, given.variants, given.variant_seed, VARIANTS)
    return given


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    repetitions = min(given.seeds, 3) if given.quick else given.seeds
    rows = []
    for cell in given.cell:
        planner = planner_of(cell)
        for task in tasks_of(cell)[:: 3 if given.quick else 1]:
            row = measured(planner, task, repetitions)
            print(line_of(asdict(row)), flush=True)
            rows += [row] if row.J > 0.0 else []  # a variant's task may have no solution
    finish(given.json, [asdict(row) for row in rows], claims_of(rows))


if __name__ == "__main__":
    main()
