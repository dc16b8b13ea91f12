"""How fast and how surely does the robot get into and out of machines?

    python benchmarks/service.py [--cell FILE]... [--seeds N] [--coal N] [--no-ros] [--json FILE]

At every station: configurations in closed form and by CCD from 32 starts; eq. (7) alone with literal and
inverse weighting; the whole movement. "way": found, shortened and proved as a path; "answer": with its time,
energy and the proof of the trajectory. Then Coal checks distances, the limits are sampled at 10 kHz, and the
node is asked.
"""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from _service_checks import clearance_left, largest_share, over_ros
from _service_stations import StationFigures, measured, scene_of
from kernels import commit, machine

from ir_description import load_cell

CELLS = ("cnc_door", "deep_box", "demo")


@dataclass(frozen=True)
class Claim:
    """A measured figure beside the bound it was asked to keep."""

    name: str
    value: float
    unit: str
    bound: float
    holds: bool


def at_most(name: str, value: float, unit: str, bound: float) -> Claim:
    """A claim that holds up to its bound."""
    return Claim(name, value, unit, bound, value <= bound)


def at_least(name: str, value: float, unit: str, bound: float) -> Claim:
    """A claim that holds from its bound on."""
    return Claim(name, value, unit, bound, value >= bound)


def claims_of(figures: list[StationFigures]) -> list[Claim]:
    """What the stations say."""
    free = [f for f in figures if f.free]
    runs = sum(len(f.ccd_ms) for f in free)
    claims = [
        at_most("closed form with clearances, per pose", max(f.analytic_ms for f in figures), "ms", 0.1),
        at_least("ccd finds a free one", 100.0 * sum(f.ccd_found for f in free) / runs, "%", 98.0),
        at_most("ccd, median", float(np.median([f.ccd_ms for f in free])), "ms", 20.0),
        at_least("withdrawals certified", 100.0 * sum(f.found for f in free) / runs, "%", 100.0),
    ]
    for what, kinds, bound in (
        ("semi-closed", ("SEMI_CLOSED",), 10.0),
        ("closed", ("CLOSED",), 50.0),
        ("open", ("OPEN",), 10.0),
    ):
        there = [f for f in free if f.zone in kinds]
        if there:
            way = float(np.median([f.way_ms for f in there]))
            answer = float(np.median([f.answer_ms for f in there]))
            claims.append(at_most(f"way found and proved, {what}, median", way, "ms", bound))
            claims.append(at_most(f"answer with time and energy, {what}, median", answer, "ms", bound))
    ways = np.concatenate([f.way_ms for f in free])
    answers = np.concatenate([f.answer_ms for f in free])
    claims.append(at_most("way found and proved, p95", float(np.percentile(ways, 95)), "ms", 250.0))
    claims.append(at_most("answer with time and energy, p95", float(np.percentile(answers, 95)), "ms", 250.0))
    return claims


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cell", action="append", help=f"file or bundled cell; default: {', '.join(CELLS)}")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--coal", type=int, default=1, help="movements per station that Coal checks")
    parser.add_argument("--no-ros", action="store_true", help="leave the node out")
    parser.add_argument("--json", type=Path, help="also write the results here")
    return parser.parse_args()


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    figures: list[StationFigures] = []
    shares, left, asked = [], [], 0
    for name in given.cell or CELLS:
        scene = scene_of(load_cell(name))
        for station in scene.cell.stations:
            figures.append(measured(scene, station, given.seeds))
            last = figures[-1]
            print("  ".join(f"{key} {value}" for key, value in last.row().items()), flush=True)
            shares += [largest_share(trajectory, scene) for trajectory in last.trajectories]
            for trajectory in last.trajectories[: given.coal]:
                least, count = clearance_left(trajectory, scene, station.name, last.margin)
                left.append(least)
                asked += count
    claims = claims_of(figures)
    if left:
        name = f"least distance beyond S_m by Coal, {asked} configurations"
        claims.append(at_least(name, min(left), "m", -1e-6))
    if shares:
        claims.append(at_most("largest share of a limit at 10 kHz", max(shares), "1", 1.0 + 1e-6))
    if not given.no_ros:
        stations = [f.station for f in figures if f.cell == figures[0].cell]
        extra, repeats = over_ros((given.cell or CELLS)[0], stations, min(given.seeds, 3))
        claims.append(
            at_most("over ROS, beyond the core's time, median", float(np.median(extra)), "ms", 20.0)
        )
        claims.append(at_least("same seed, same trajectory_id", 100.0 * repeats, "%", 100.0))
    print()
    for claim in claims:
        verdict = "holds" if claim.holds else "falls short"
        print(f"{claim.name:64s} {claim.value:10.4g} {claim.unit:4s} bound {claim.bound:<10.6g} {verdict}")
    if given.json:
        given.json.parent.mkdir(parents=True, exist_ok=True)
        rows: list[dict[str, Any]] = [figure.row() for figure in figures]
        result = {
            "machine": f"{machine()}, load {os.getloadavg()[0]:.1f}",
            "commit": commit(),
            "rows": rows,
            "claims": [asdict(claim) for claim in claims],
        }
        given.json.write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
