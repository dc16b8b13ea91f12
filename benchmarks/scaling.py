"""How do time and memory grow with bodies, stops, configurations and trajectory points?

    python benchmarks/scaling.py [--cell FILE] [--seeds N] [--axis NAME]... [--most N] [--plot FILE]
    [--quick]
                                 [--json FILE]

Every step is measured in a process of its own: processor seconds of one call, and the memory that
it takes at most. The exponent is the slope of log(time) over log(size), fitted over the upper half
of the range: 1 is linear. Bodies: the cell is filled up with boxes, each a machine with a station
and an allowed contact. Stops: tours of the cell's stations. Configurations: the same tour while A4
and A6 may turn less and less. Points: waves of all joints, which last longer the more points they
have.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
from _results import Claim, at_most, command_line, finish
from _scaling_measure import measured
from _scaling_rows import Row, exponents, row_of
from _scaling_steps import QUICK, SIZES, STEPS, Step

CELL = "demo"
LARGEST_S = 60.0  # the largest sizes that requests may have are answered within this


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = command_line(__doc__, [CELL], 1, "smaller sizes")
    parser.add_argument("--axis", action="append", choices=list(SIZES), help="default: all")
    parser.add_argument("--most", type=float, default=np.inf, help="largest size")
    parser.add_argument("--plot", type=Path, help="write the picture here")
    return parser.parse_args()


def rows_of(step: Step, sizes: tuple[int, ...], cell: str, seeds: int) -> list[Row]:
    """One row per size; the first size that is refused or fails ends the step, with its
    sentence.
    """
    rows: list[Row] = []
    for size in sizes:
        found = [measured(partial(step.prepare, cell, size, seed)) for seed in range(seeds)]
        refused = [one for one in found if isinstance(one, str)]
        if refused:
            print(f"{step.axis:15s}{step.name:32s}{size:>8d}  {refused[0]}", flush=True)
            break
        row = row_of(step.axis, step.name, [one for one in found if not isinstance(one, str)])
        figures = f"{row.size:8.0f}{row.seconds:12.4f}{row.megabytes:10.1f}"
        print(f"{row.axis:15s}{row.step:32s}{figures}", flush=True)
        rows.append(row)
    return rows


def claims_of(rows: list[Row]) -> list[Claim]:
    """An exponent for every step, and the time at its largest size."""
    found = exponents(rows)
    claims = []
    for step in STEPS:
        mine = [row for row in rows if (row.axis, row.step) == (step.axis, step.name)]
        if len(mine) > 1:
            slope = found[step.axis, step.name]
            claims.append(at_most(f"{step.axis}: {step.name}", slope, "exponent", step.bound))
            top = f"{step.axis}: {step.name}, {mine[-1].size:.0f}"
            claims.append(at_most(top, mine[-1].seconds, "s", LARGEST_S))
    return claims


def main() -> None:
    """Measure, print, draw, write."""
    given = arguments()
    sizes = QUICK if given.quick else SIZES
    rows: list[Row] = []
    print(f"{'axis':15s}{'step':32s}{'size':>8s}{'seconds':>12s}{'MB':>10s}")
    for cell in given.cell or [CELL]:
        for step in STEPS:
            if step.axis in (given.axis or SIZES):
                chosen = tuple(size for size in sizes[step.axis] if size <= given.most)
                rows += rows_of(step, chosen, cell, given.seeds)
    if given.plot:
        from _scaling_plot import plot

        plot(rows, given.plot)
    finish(given.json, [asdict(row) for row in rows], claims_of(rows))


if __name__ == "__main__":
    main()
