"""`ir up`: the four nodes without a launch file, until Ctrl-C."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from ir_description import load_cell

from .nodes import cell_nodes
from .processes import NodeProcesses

LOOK_SECONDS = 0.5
"""Between two looks at the processes: a node that ended is reported within this."""


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add up."""
    up = commands.add_parser("up", help="start planner, driver, runner and recorder until Ctrl-C")
    up.add_argument("--cell", default="demo", help="a cell file, or the name of a bundled cell (demo)")
    up.add_argument(
        "--logs", type=Path, default=Path("out/log"), help="folder of the nodes' output (out/log)"
    )
    up.set_defaults(run=run_up)


def run_up(arguments: argparse.Namespace) -> int:
    """Start the nodes and watch them; an end of one of them ends all."""
    load_cell(arguments.cell)
    with NodeProcesses(arguments.logs, {}) as nodes:
        nodes.start(cell_nodes(arguments.cell))
        sys.stdout.write("planner, driver, runner and recorder run; Ctrl-C ends them\n")
        sys.stdout.flush()
        while True:
            nodes.check()
            time.sleep(LOOK_SECONDS)
