"""What the compiled core costs, beside Coal through Pinocchio, PyBullet and Pinocchio's RNEA in the
same run.

    python benchmarks/kernels.py [--cell FILE]... [--seeds N] [--build] [--quick] [--json FILE]

Best of several repetitions on one thread, unless a row says otherwise. Closes with one line per
figure that
was asked for: measured value, bound, holds or falls short.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict

import _kernels_build
import _kernels_dynamics
import _kernels_geometry
import _kernels_spline
from _kernels_geometry import FULL, QUICK
from _kernels_rows import Row
from _results import Claim, command_line, finish

from ir_description import bundled_cells


def arguments() -> argparse.Namespace:
    """The command line."""
    cells = [name for name in bundled_cells() if name != "demo"]
    parser = command_line(__doc__, cells, 1, "the first cell alone, fewer repetitions")
    parser.add_argument("--build", action="store_true", help="also time a build from scratch")
    given = parser.parse_args()
    given.cell = given.cell or cells[: 1 if given.quick else None]
    return given


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    rows: list[Row] = []
    claims: list[Claim] = []
    effort = QUICK if given.quick else FULL
    for seed in range(given.seeds):
        for part in (
            _kernels_geometry.measure(given.cell, seed, effort),
            _kernels_dynamics.measure(seed),
        ):
            rows += part[0]
            claims += part[1]
        rows += _kernels_spline.measure(given.cell, seed)
    part = _kernels_build.measure(given.build)
    rows += part[0]
    claims += part[1]
    for row in rows:
        print(
            f"{row.kernel + (' (' + row.peer + ')' if row.peer else ''):72s} {row.value:12.3f} "
            f"{row.unit}"
        )
    finish(given.json, [asdict(row) for row in rows], claims)


if __name__ == "__main__":
    main()
