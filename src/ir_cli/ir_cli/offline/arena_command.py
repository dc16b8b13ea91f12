"""`ir arena`: planners against each other, in the background of a night or two minutes."""

from __future__ import annotations

import argparse
import sys

from ir_studies import read_settings, run_arena
from ir_studies.arena import EXAMPLE

from .studying import add_study, settings_of, studied


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add arena."""
    arena = commands.add_parser(
        "arena",
        help="planners against each other over cells, tasks and seeds; needs no ROS",
        description="Runs what the folder has no result of; the same command goes on after an interruption.",
    )
    add_study(arena, "out/arena")
    arena.add_argument("--parquet", action="store_true", help="also table.parquet; needs pyarrow")
    arena.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run, and print which files were written."""
    if arguments.example:
        sys.stdout.write(EXAMPLE)
        return 0
    settings = read_settings(settings_of(arguments, "ir arena"))
    finished = studied(
        arguments, lambda means: run_arena(settings, arguments.output, means, parquet=arguments.parquet)
    )
    sys.stdout.write(f"{finished.summary}\n")
    sys.stdout.writelines(f"{path}\n" for path in finished.files)
    return 0
