"""Is the reported clearance of a movement at most the true one?

    python benchmarks/clearance.py [--cell FILE]... [--movements N] [--seeds N] [--quick] [--json
    FILE]

Movements of the cells' tasks, and of three variants of each cell, with the default work and as many
seeds as it takes; every different answer counts once. Beside `min_clearance` of each report stands
the least distance that Coal finds at configurations at most 0.0005 rad apart, over all pairs: it is
never below the true minimum by more than Coal's own tolerance, and above it by what may hide
between two configurations. Closes with one
line per figure: measured value, bound, holds or falls short.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from _regional_ours import asked, planner_of, run
from _regional_tasks import CELLS, scene_of, tasks_of
from _results import at_most, command_line, finish, line_of
from _second_opinion import SecondOpinion
from _variants import variant_files

TOLERANCE = 2e-6  # m: what Coal's iterations leave between it and the true distance
BELOW = 1e-4  # m by which a report may lie below the true minimum and still be useful
MOVEMENTS = 200
QUICK = 6
# mirrored, turned and jittered cells besides
PER_CELL = 3
VARIANTS = Path("out/variants")


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = command_line(__doc__, CELLS, 30, f"{QUICK} movements")
    parser.add_argument("--movements", type=int, default=MOVEMENTS, help=f"default: {MOVEMENTS}")
    given = parser.parse_args()
    if given.quick:
        given.movements = min(given.movements, QUICK)
    return given


def movements(cells: list[str], seeds: int, count: int) -> Iterator[dict[str, object]]:
    """A row per movement: reported clearance, Coal's least distance and their difference [m]."""
    tasks = [(name, task) for name in cells for task in tasks_of(name)]
    planners = {name: planner_of(name) for name in cells}
    opinions = {name: SecondOpinion(scene_of(name)) for name in cells}
    done = 0
    known = set[str]()
    for seed, (name, task) in ((seed, each) for seed in range(seeds) for each in tasks):
        if done == count:
            return
        found = run(planners[name], task, asked(task, seed))
        if found.trajectory is None or found.trajectory_id in known:
            continue
        known.add(found.trajectory_id)
        done += 1
        least, configurations = opinions[name].least_distance(found.trajectory)
        yield {
            "cell": task.cell,
            "task": task.name,
            "seed": seed,
            "configurations": configurations,
            "reported_mm": 1e3 * found.clearance,
            "coal_mm": 1e3 * least,
            "above_um": 1e6 * (found.clearance - least),
        }


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    rows = []
    cells = given.cell or [*CELLS, *variant_files(CELLS, PER_CELL, 0, VARIANTS)]
    for row in movements(cells, given.seeds, given.movements):
        rows.append(row)
        print(line_of(row), flush=True)
    above = np.array([row["above_um"] for row in rows], dtype=float) * 1e-6
    claims = [
        at_most(
            f"reports above the true clearance, of {len(rows)}", (above > TOLERANCE).sum(), "", 0
        ),
        at_most(
            "largest report less Coal's least distance", 1e6 * above.max(initial=-np.inf), "um", 2.0
        ),
        at_most(
            "report below Coal's least distance, worst",
            -1e6 * above.min(initial=np.inf),
            "um",
            1e6 * BELOW,
        ),
    ]
    finish(given.json, rows, claims)


if __name__ == "__main__":
    main()
