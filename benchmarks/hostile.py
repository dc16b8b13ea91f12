"""What does the driver survive: goals that run away, lost emergency stops, impossible loads,
floods?

    python benchmarks/hostile.py [--only PART]... [--seeds N] [--drivers N] [--quick] [--json FILE]

The cases and their independent judge are those of tests/faults, with other seeds: finite
differences of the executed positions against the robot's limits, presses of the emergency stop in
every mode amid a PLC's traffic, random loads on the physics, requests of every kind in any order,
deviations in every mode. Then the
node is flooded as a process of its own: what it loses, and its memory, descriptors, threads and
log. Stops are pressed amid two clients and a PLC on several drivers at once, each in a ROS domain
of its own.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from _hostile_floods import floods
from _hostile_node import attack, cells_row, killed_row
from _results import Claim, add_ending, at_least, at_most, finish, line_of

from ir_description import load_cell
from ir_msgs_py import names
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver import Driver, TrajectoryGoal, make_simulation

FAULTS = Path(__file__).resolve().parents[1] / "tests" / "faults"
FIRST_SEED = 1_000  # none that a test uses
HOUR = 3600.0  # s


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


def fuzz_row(cases: int, seed: int) -> dict[str, Any]:
    """Hostile requests of every kind, and how many laws were broken."""
    done, wrong = cases_of("test_fuzz_driver").attacked(cases, seed)
    return {
        "case": "fuzz",
        "seed": seed,
        "cases": cases,
        "taken": _taken(done),
        "broken": len(wrong),
    }


def _taken(done: Counter[str]) -> int:
    return sum(count for name, count in done.items() if not name.endswith("refused"))


def deviation_row(cases: int, seed: int) -> dict[str, Any]:
    """Deviations in every mode, and how many the supervision judged wrongly."""
    large, wrong = cases_of("test_fuzz_supervision").unseen(cases, seed)
    return {"case": "deviations", "seed": seed, "cases": cases, "large": large, "wrong": len(wrong)}


def law() -> ModuleType:
    """The walk and the sequences of tests/driver/test_stop_law.py."""
    return module_of("driver", "test_stop_law")


def module_of(folder: str, name: str) -> ModuleType:
    """A module of a folder of the tests."""
    spec = importlib.util.spec_from_file_location(name, FAULTS.parent / folder / f"{name}.py")
    if spec is None or spec.loader is None:
        raise FileNotFoundError(f"{name}.py is not in {FAULTS.parent / folder}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # its dataclasses look themselves up
    spec.loader.exec_module(module)
    return module


def writers_row(pairs: int) -> dict[str, Any]:
    """Pairs of writers of one file, and whether one of them lost anything without saying so."""
    lost = 0
    with tempfile.TemporaryDirectory() as folder:
        try:
            tested = module_of("recorder", "test_writer")
            tested.test_of_a_pair_of_writers_one_is_refused_and_nothing_is_lost(Path(folder), pairs)
        except AssertionError as error:
            print(error)
            lost = 1
    return {"case": "writers", "cases": pairs, "lost": lost}


def sequence_row(count: int, steps: int) -> dict[str, Any]:
    """Random sequences of a PLC, and how many differ from the table of docs/driver.md."""
    drawn = law().drawn
    wrong = [
        found for seed in range(FIRST_SEED, FIRST_SEED + count) if (found := drawn(steps, seed))
    ]
    for found in wrong[:3]:
        print(found)
    return {"case": "sequences", "cases": count, "steps": steps, "differ": len(wrong)}


def walk_rows(depth: int) -> Iterator[dict[str, Any]]:
    """All interleavings of PLC, two clients, program and modes to this depth, from each mode."""
    module = law()
    seen: dict[int, int] = {}
    for start in module.STARTS:
        began = time.process_time()
        states, steps, wrong = module.walked(start, depth, seen)
        for found in wrong[:3]:
            print(found)
        yield {
            "case": "interleavings",
            "start": start,
            "depth": depth,
            "states": states,
            "steps": steps,
            "wrong": len(wrong),
            "seconds": time.process_time() - began,
        }


def driving_row(seconds: float) -> dict[str, Any]:
    """Simulated driving without a pause, stepped: memory of this process after a tenth and at the
    end.
    """
    simulation = make_simulation(cases_of("test_runaway_goals").BARE, backend="ideal")
    driver = Driver(simulation)
    generator = np.random.default_rng(FIRST_SEED)
    home = np.array(simulation.cell.machine_home)
    stamp = 0
    early = 0.0
    while simulation.time < seconds:
        target = home + generator.uniform(-0.4, 0.4, 6)
        path = JointTrajectory.from_seconds(
            names.JOINT_NAMES, [2.5], target[None], np.zeros((1, 6))
        )
        simulation.execute(simulation.vet(TrajectoryGoal(path), stamp), stamp)
        for _ in range(1_300):
            stamp += 2_000_000
            driver.tick(stamp)
        simulation.notices.take()
        if simulation.time > 0.1 * seconds:
            early = early or memory()
    driver.close()
    return {"case": "driving", "s": seconds, "rss_mb_before": early, "rss_mb_after": memory()}


def memory() -> float:
    """Resident memory of this process [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 2**20


def stop_rows(count: int, drivers: int) -> Iterator[dict[str, Any]]:
    """Interleavings on nodes, on so many drivers at once; each has seeds of its own."""
    command = [sys.executable, str(Path(__file__).with_name("_hostile_stops.py"))]
    running = [
        subprocess.Popen(
            [*command, str(count // drivers + (k < count % drivers)), str(FIRST_SEED + k)],
            stdout=subprocess.PIPE,
            text=True,
        )
        for k in range(drivers)
    ]
    for process in running:
        *said, row = process.communicate()[0].splitlines() or [""]
        for line in said:
            print(line)
        if process.returncode != 0:
            raise ChildProcessError(f"stops on a node ended with {process.returncode}: {row}")
        yield json.loads(row)


@dataclass(frozen=True)
class Rows:
    """Rows of one part, and what claims say of them."""

    rows: Sequence[dict[str, Any]]

    def of(self, case: str) -> list[dict[str, Any]]:
        """Those of a case."""
        return [row for row in self.rows if row["case"] == case]

    def total(self, case: str, key: str) -> int:
        """A count over all rows of a case."""
        return sum(row[key] for row in self.of(case))

    def grown(self, case: str, key: str) -> float:
        """The largest difference of a figure after and before."""
        found = (float(row[f"{key}_after"] - row[f"{key}_before"]) for row in self.of(case))
        return max(found, default=0.0)

    def kept(self) -> float:
        """Memory after a flood, at most [% of before]."""
        shares = (row["rss_mb_after"] / row["rss_mb_before"] for row in self.of("flood"))
        return 100.0 * max(shares, default=0.0)

    def latest(self) -> float:
        """Delay of a press under a flood at p99.9, at most [ms]."""
        return max((row["p99.9_ms"] for row in self.of("press")), default=0.0)


Part = tuple[
    Callable[[argparse.Namespace], Iterator[dict[str, Any]]], Callable[[Rows], list[Claim]]
]


def _random(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    counts = (300, 84, 60, 300, 70) if given.quick else (4_000, 1_000, 500, 5_000, 500)
    makers = (goal_row, stop_row, load_row, fuzz_row, deviation_row)
    for seed in range(FIRST_SEED, FIRST_SEED + (1 if given.quick else given.seeds)):
        for make, count in zip(makers, counts, strict=True):
            yield make(count, seed)


def _of_random(rows: Rows) -> list[Claim]:
    return [
        at_least("goals that were accepted and judged", rows.total("goals", "accepted"), "", 10),
        at_most("goals beyond a limit", rows.total("goals", "beyond"), "", 0),
        at_most("emergency stops lost", rows.total("stops", "lost"), "", 0),
        at_least("loads carried", rows.total("loads", "carried"), "", 10),
        at_most("loads that made the physics fail", rows.total("loads", "failed"), "", 0),
        at_most("laws broken by requests of every kind", rows.total("fuzz", "broken"), "", 0),
        at_most("deviations judged wrongly", rows.total("deviations", "wrong"), "", 0),
    ]


def _of_sequences(rows: Rows) -> list[Claim]:
    differ = rows.total("sequences", "differ")
    return [
        at_least("sequences of a PLC", rows.total("sequences", "cases"), "", 2_000),
        at_most("sequences that differ from the table of stops", differ, "", 0),
    ]


def _of_interleavings(rows: Rows) -> list[Claim]:
    depth = min(row["depth"] for row in rows.of("interleavings"))
    wrong = rows.total("interleavings", "wrong")
    return [
        at_least("depth of all interleavings", depth, "", 8),
        at_most("interleavings that break the law of stops", wrong, "", 0),
    ]


def _of_files(rows: Rows) -> list[Claim]:
    return [
        at_least("pairs of writers", rows.total("writers", "cases"), "", 200),
        at_most("of them that lost anything", rows.total("writers", "lost"), "", 0),
    ]


def _clients(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    yield cells_row()
    yield killed_row(1 if given.quick else 5)


def _of_clients(rows: Rows) -> list[Claim]:
    went_on = rows.total("killed clients", "went_on")
    return [
        at_most("cells that ended the driver", rows.total("cells", "ended"), "", 0),
        at_most("killed clients whose goals went on", went_on, "", 0),
    ]


def _of_node(rows: Rows) -> list[Claim]:
    grown = {key: rows.grown("node", key) for key in ("rss_mb", "descriptors", "threads", "log_kb")}
    return [
        at_most("requests and presses of the node lost", rows.total("node", "lost"), "", 0),
        at_most("memory that the node gains, at most", grown["rss_mb"], "MB", 60.0),
        at_most("descriptors that the node gains, at most", grown["descriptors"], "", 2),
        at_most("threads that the node gains, at most", grown["threads"], "", 1),
        at_most("log that the node writes, at most", grown["log_kb"], "kB", 1_000.0),
    ]


def _of_stops(rows: Rows) -> list[Claim]:
    return [
        at_least("interleavings of stops on a node", rows.total("node stops", "cases"), "", 10_000),
        at_most("of them that break the law of stops", rows.total("node stops", "wrong"), "", 0),
    ]


def _of_floods(rows: Rows) -> list[Claim]:
    return [
        at_most("presses under floods lost", rows.total("press", "lost"), "", 0),
        at_most("presses under floods, p99.9", rows.latest(), "ms", 50.0),
        at_most("memory after a flood, of before", rows.kept(), "%", 120.0),
    ]


def _of_driving(rows: Rows) -> list[Claim]:
    return [at_most("memory that driving takes", rows.grown("driving", "rss_mb"), "MB", 5.0)]


def _driving(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    yield driving_row(HOUR / 12.0 if given.quick else HOUR)


def _sequences(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    yield sequence_row(50 if given.quick else 2_000, 200)


def _files(_given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    yield writers_row(200)


PARTS: dict[str, Part] = {
    "driving": (_driving, _of_driving),
    "random": (_random, _of_random),
    "sequences": (_sequences, _of_sequences),
    "interleavings": (lambda given: walk_rows(4 if given.quick else 8), _of_interleavings),
    "files": (_files, _of_files),
    "clients": (_clients, _of_clients),
    "node": (lambda given: attack(200, 12) if given.quick else attack(5_000, 334), _of_node),
    "stops": (
        lambda given: stop_rows(50 if given.quick else 10_000, given.drivers),
        _of_stops,
    ),
    "floods": (lambda given: floods(20 if given.quick else 1_000), _of_floods),
}


def main() -> None:
    """Run the parts, print their rows and claims."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", action="append", choices=PARTS, help="a part of it")
    parser.add_argument("--seeds", type=int, default=4, help="default: 4")
    parser.add_argument(
        "--drivers", type=int, default=2, help="drivers whose stops are pressed at once; default: 2"
    )
    add_ending(
        parser, "1 seed, 300 goals, 84 presses, 60 loads, 300 requests, 5 minutes of driving"
    )
    given = parser.parse_args()
    rows: list[dict[str, Any]] = []
    claims: list[Claim] = []
    for name in given.only or PARTS:
        make, claimed = PARTS[name]
        found = []
        for row in make(given):
            found.append(row)
            print(line_of(row), flush=True)
        rows += found
        claims += claimed(Rows(found))
    finish(given.json, rows, claims)


if __name__ == "__main__":
    main()
