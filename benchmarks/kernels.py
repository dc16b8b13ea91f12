"""What the compiled core costs, beside Coal through Pinocchio, PyBullet and Pinocchio's RNEA in the same run.

    python benchmarks/kernels.py [--cell FILE]... [--seeds N] [--json FILE] [--build]

Best of several repetitions on one thread, unless a row says otherwise. Closes with one line per figure that
was asked for: measured value, bound, holds or falls short.
"""

from __future__ import annotations

import argparse
import json
import platform
import subprocess
from dataclasses import asdict
from pathlib import Path

import _kernels_build
import _kernels_dynamics
import _kernels_geometry
import _kernels_spline
from _kernels_dynamics import Claim, Row

from ir_description import bundled_cells


def machine() -> str:
    names = [line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name")]
    return f"{names[0].split(':')[1].strip()}, {len(names)} cores" if names else platform.processor()


def commit() -> str:
    done = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=False)
    return done.stdout.strip()


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else "")
    parser.add_argument(
        "--cell", action="append", help="cell file or name of a bundled one; default: all of them"
    )
    parser.add_argument("--seeds", type=int, default=1, help="how often everything is drawn anew")
    parser.add_argument("--json", type=Path, help="also write the results here")
    parser.add_argument("--build", action="store_true", help="also time a build from scratch")
    return parser.parse_args()


def main() -> None:
    given = arguments()
    rows: list[Row] = []
    claims: list[Claim] = []
    cells = given.cell or [name for name in bundled_cells() if name != "demo"]
    for seed in range(given.seeds):
        for part in (_kernels_geometry.measure(cells, seed), _kernels_dynamics.measure(seed)):
            rows += part[0]
            claims += part[1]
        rows += _kernels_spline.measure(cells, seed)
    part = _kernels_build.measure(given.build)
    rows += part[0]
    claims += part[1]
    for row in rows:
        print(f"{row.kernel + (' (' + row.peer + ')' if row.peer else ''):72s} {row.value:12.3f} {row.unit}")
    print()
    for claim in claims:
        verdict = "holds" if claim.holds else "falls short"
        print(f"{claim.name:64s} {claim.value:10.3g} {claim.unit:22s} bound {claim.bound:<8g} {verdict}")
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
