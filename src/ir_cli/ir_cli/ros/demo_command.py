"""The command `ir demo`: its arguments, and which demonstration a cell gets."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ir_cli.output import Progress, add_renamed
from ir_cli.planning import sentences
from ir_cli.robots_plan import robots_of
from ir_cli.ros.demo import Demonstration, Tended
from ir_cli.ros.domain import apply, own_domain
from ir_cli.ros.robots_demo import RobotsDemonstration


def add_demo(demo: argparse.ArgumentParser) -> None:
    """Arguments of `ir demo`."""
    demo.add_argument(
        "--cell", default="demo", help="a cell file, or the name of a bundled cell (demo)"
    )
    output = demo.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("out"),
        metavar="FOLDER",
        help="folder for recording and report (out)",
    )
    add_renamed(demo, "--out", output)
    demo.add_argument("--seed", type=int, default=0, help="seed of the planner (0)")
    demo.add_argument(
        "--plant",
        default="typical",
        help="the simulated plant: typical (default), typical:SEED, nominal (the data), or a file",
    )
    words = "the program's own pauses and the controller's own transitions (default: shortened)"
    demo.add_argument("--real-pauses", action="store_true", help=words)
    words = "of a route, or several robots: a cycle makes at least so many (0: the most possible)"
    demo.add_argument("--parts-per-hour", type=float, default=0.0, metavar="R", help=words)
    words = "of the same: whole cycles, with a route after the line was filled (3)"
    demo.add_argument("--cycles", type=int, default=3, metavar="N", help=words)
    demo.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the demonstration; 0 only when every step and every check of the recording held."""
    apply(own_domain())

    from ir_cli.ros.domain import alone

    words = (arguments.output, arguments.seed, arguments.plant, Progress())
    cell = arguments.cell
    tended = Tended(arguments.parts_per_hour, arguments.cycles)
    real = arguments.real_pauses
    with alone(""), sentences():
        cells = robots_of(cell)
        demonstration = (
            Demonstration(cell, *words, real_pauses=real, tended=tended)
            if cells is None
            else RobotsDemonstration(cell, cells, *words, tended)
        )
        outcome = demonstration.run()
    sys.stdout.write(outcome.text() + "\n")
    return 0 if outcome.ok else 1
