"""What does the driver survive: goals that run away, lost emergency stops, loads that no wrist can carry?

    python benchmarks/hostile.py [--seeds N] [--quick] [--json FILE]

The cases and their independent judge are those of tests/faults, with other seeds: finite differences of the
executed positions against the robot's limits, presses of the emergency stop amid a PLC's traffic, random
loads on the physics.
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from pathlib import Path
from types import ModuleType
from typing import Any

from _results import Claim, add_ending, at_least, at_most, finish, line_of

from ir_description import load_cell

FAULTS = Path(__file__).resolve().parents[1] / "tests" / "faults"
FIRST_SEED = 1_000  # none that a test uses


def cases_of(name: str) -> ModuleType:
    """A module of tests/faults."""
    spec = importlib.util.spec_from_file_location(name, FAULTS / f"{name}.py")
    if spec is None or spec.loader is None:
        raise FileNotFoundError(f"{name}.py is not in {FAULTS}")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def goal_row(cases: int, seed: int) -> dict[str, Any]:
    """Random goals of all kinds, and how many of them moved the robot beyond a limit."""
    began = time.process_time()
    accepted, beyond = cases_of("test_runaway_goals").judged(cases, seed)
    seconds = time.process_time() - began
    return {
        "case": "goals",
        "seed": seed,
        "cases": cases,
        "accepted": accepted,
        "beyond": len(beyond),
        "seconds": seconds,
    }


def stop_row(presses: int, seed: int) -> dict[str, Any]:
    """Presses of the emergency stop, and how many of them were lost."""
    lost = cases_of("test_emergency_stops").lost(presses, seed)
    return {"case": "stops", "seed": seed, "cases": presses, "lost": len(lost)}


def load_row(cases: int, seed: int) -> dict[str, Any]:
    """Random loads, and how many of them made the physics fail."""
    carried, wrong = cases_of("test_hostile_loads").survivors(load_cell("open"), cases, seed)
    return {"case": "loads", "seed": seed, "cases": cases, "carried": carried, "failed": len(wrong)}


def claims_of(rows: list[dict[str, Any]]) -> list[Claim]:
    """Counts over all seeds."""

    def total(case: str, key: str) -> int:
        return sum(row[key] for row in rows if row["case"] == case)

    return [
        at_least("goals that were accepted and judged", total("goals", "accepted"), "", 10),
        at_most("goals beyond a limit", total("goals", "beyond"), "", 0),
        at_most("emergency stops lost", total("stops", "lost"), "", 0),
        at_least("loads carried", total("loads", "carried"), "", 10),
        at_most("loads that made the physics fail", total("loads", "failed"), "", 0),
    ]


def main() -> None:
    """Run the cases, print the counts."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=4, help="default: 4")
    add_ending(parser, "1 seed, 300 goals, 60 presses, 60 loads")
    given = parser.parse_args()
    goals, presses, loads = (300, 60, 60) if given.quick else (4_000, 1_000, 500)
    rows: list[dict[str, Any]] = []
    for k in range(1 if given.quick else given.seeds):
        seed = FIRST_SEED + k
        for row in (goal_row(goals, seed), stop_row(presses, seed), load_row(loads, seed)):
            rows.append(row)
            print(line_of(row), flush=True)
    finish(given.json, rows, claims_of(rows))


if __name__ == "__main__":
    main()
