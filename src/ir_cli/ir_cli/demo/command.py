"""`ir demo`: its arguments, and its exit code: 0 when every check held."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ir_cli.environment import apply, own_domain
from ir_cli.terminal import Progress


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add demo."""
    demo = commands.add_parser("demo", help="plan, drive, record and explain a cell")
    demo.add_argument(
        "--cell", default="demo", help="a cell file, or the name of a bundled cell (demo)"
    )
    demo.add_argument(
        "--out", type=Path, default=Path("out"), help="folder for recording and report (out)"
    )
    demo.add_argument("--seed", type=int, default=0, help="seed of the planner (0)")
    demo.add_argument(
        "--plant",
        default="typical",
        help="the simulated plant: typical (default), typical:SEED, nominal (the data), or a file",
    )
    words = "the program's own pauses and the controller's own transitions (default: shortened)"
    demo.add_argument("--real-pauses", action="store_true", help=words)
    demo.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the demonstration; 0 only when every step and every check of the recording held."""
    apply(own_domain())
    from ir_cli.alone import alone

    from .story import Demonstration

    words = (arguments.cell, arguments.out, arguments.seed, arguments.plant)
    with alone(""):
        outcome = Demonstration(*words, Progress(), real_pauses=arguments.real_pauses).run()
    sys.stdout.write(outcome.text() + "\n")
    return 0 if outcome.ok else 1
