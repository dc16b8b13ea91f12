"""`ir arena`: planners against each other, in the background of a night or two minutes."""

from __future__ import annotations

import argparse
import os
import sys
from contextlib import suppress
from pathlib import Path

from ir_studies import read_settings, run_arena
from ir_studies.arena import EXAMPLE, Entry

from ..errors import InputError
from .output import ProgressLine

MOST_WORKERS = 64


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add arena."""
    arena = commands.add_parser(
        "arena",
        help="planners against each other over cells, tasks and seeds; needs no ROS",
        description="Runs what the folder has no result of; the same command goes on after an interruption.",
    )
    arena.add_argument("settings", nargs="?", metavar="SETTINGS.yaml", help="what is compared")
    arena.add_argument("-o", "--output", default="out/arena", metavar="FOLDER", help="results (out/arena)")
    words = f"processes, 1 to {MOST_WORKERS} (as many as cores)"
    arena.add_argument("--workers", type=int, default=0, metavar="N", help=words)
    arena.add_argument("--parquet", action="store_true", help="also table.parquet; needs pyarrow")
    arena.add_argument("--example", action="store_true", help="print a settings file with all keys, and end")
    arena.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run, and print which files were written."""
    if arguments.example:
        sys.stdout.write(EXAMPLE)
        return 0
    if arguments.settings is None:
        raise InputError("SETTINGS.yaml is missing: ir arena --example prints one")
    if not 0 <= arguments.workers <= MOST_WORKERS:
        raise InputError(f"--workers is {arguments.workers}: it must be in 1 .. {MOST_WORKERS}")
    workers = arguments.workers or min(len(os.sched_getaffinity(0)), MOST_WORKERS)
    settings, folder = read_settings(arguments.settings), Path(arguments.output)
    made = [0, 0]

    def show(done: int, of: int, entry: Entry) -> None:
        made[:] = done, of
        line.show(f"{entry.cell} {entry.task} by {entry.planner}: run", done, of, 0.0)

    try:
        with ProgressLine() as line:
            finished = run_arena(settings, folder, workers, show, parquet=arguments.parquet)
    except KeyboardInterrupt:
        with suppress(BrokenPipeError):
            done = f" after run {made[0]} of {made[1]}" if made[1] else ""
            sys.stderr.write(f"stopped{done}: the same command goes on from there\n")
        raise
    solved, count = sum(one.solved for one in finished.runs), len(finished.runs)
    sys.stdout.write(f"{solved} of {count} runs solved\n")
    sys.stdout.writelines(f"{path}\n" for path in finished.files)
    return 0
