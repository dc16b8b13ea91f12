"""Does the planner's node grow? What calls of each service leave in memory, descriptors and
threads.

    python benchmarks/planner_soak.py [--cell NAME] [--seeds N] [--quick] [--json FILE]

The requests are those of tests/faults/test_hostile_requests.py: one that makes sense for each
service, and hostile ones. They go through the handlers of a node that publishes as always. The
first tenth fills the memories that are bounded in number and bytes; growth is counted from there.
"""

from __future__ import annotations

import importlib.util
import os
import time
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import rclpy
from _results import Claim, at_least, at_most, command_line, finish, line_of
from rclpy.parameter import Parameter

from ir_planner.node.node import PlannerNode

CASES = Path(__file__).resolve().parents[1] / "tests" / "faults" / "test_hostile_requests.py"
FIRST_SEED = 1_000  # none that a test uses
WARM = 0.1  # share of the calls
PAGE = os.sysconf("SC_PAGE_SIZE")


def hostile_requests() -> ModuleType:
    """The module of the tests."""
    spec = importlib.util.spec_from_file_location(CASES.stem, CASES)
    if spec is None or spec.loader is None:
        raise FileNotFoundError(str(CASES))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def taken() -> tuple[float, int, int]:
    """Resident memory [MB], open descriptors and threads of this process."""
    resident = int(Path("/proc/self/statm").read_text().split()[1]) * PAGE / 1e6
    return resident, len(os.listdir("/proc/self/fd")), len(os.listdir("/proc/self/task"))


def soaked(node: PlannerNode, cell: str, calls: int, seed: int) -> dict[str, Any]:
    """So many calls of each service, every second one hostile; what the process has more at the
    end.
    """
    cases = hostile_requests()
    rng = np.random.default_rng(seed)
    handlers = {
        name: node._requests.guarded(getattr(node._requests, name)) for name in cases.REQUESTS
    }
    began = time.process_time()
    before = taken()
    for call in range(calls):
        if call == int(WARM * calls):
            before = taken()
        for name, handler in handlers.items():
            request = cases.REQUESTS[name]
            if call % 2:
                request, _ = cases.disturbed(request, rng)
            handler(request, cases.RESPONSES[name]())
        node.planner.set_cell(cell)
    after = taken()
    return {
        "cell": cell,
        "seed": seed,
        "calls": calls * len(handlers),
        "megabytes": after[0],
        "grown": after[0] - before[0],
        "descriptors": after[1] - before[1],
        "threads": after[2] - before[2],
        "seconds": time.process_time() - began,
    }


def claims_of(rows: list[dict[str, Any]]) -> list[Claim]:
    """What grew, of all runs the most."""
    most = {key: max(row[key] for row in rows) for key in ("grown", "descriptors", "threads")}
    return [
        at_least("calls", sum(row["calls"] for row in rows), "", 1_000),
        at_most("memory more at the end of a run", most["grown"], "MB", 30.0),
        at_most("descriptors more", most["descriptors"], "", 0),
        at_most("threads more", most["threads"], "", 0),
    ]


def main() -> None:
    """Run the calls, print what they leave."""
    given = command_line(__doc__, ("demo",), 1, "100 calls of each service").parse_args()
    calls = 100 if given.quick else 5_000
    cells = given.cell or ["demo"]
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    rclpy.init()
    small = [
        Parameter(name, Parameter.Type.INTEGER, value)
        for name, value in (
            ("stored_trajectories", 50),
            ("stored_programs", 10),
            ("stored_megabytes", 20),
        )
    ]
    node = PlannerNode(
        parameter_overrides=[Parameter("cell", Parameter.Type.STRING, "demo"), *small]
    )
    node._requests.log = lambda sentence: None
    node._last_state.take(np.array(hostile_requests().HOME), time.monotonic())
    rows = []
    try:
        for cell in cells:
            for k in range(given.seeds):
                rows.append(soaked(node, cell, calls, FIRST_SEED + k))
                print(line_of(rows[-1]), flush=True)
    finally:
        node.destroy_node()
        rclpy.shutdown()
    finish(given.json, rows, claims_of(rows))


if __name__ == "__main__":
    main()
