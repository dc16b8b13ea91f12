"""`ir arena`: planners against each other, in the background of a night or two minutes."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace

from ir_studies import read_settings, run_arena
from ir_studies.arena import EXAMPLE, ArenaSettings, arena_settings

from .studying import add_study, settings_of, studied

_FOLDER = "out/arena"
_QUICK_FOLDER = "out/arena_quick"
_QUICK_S = 0.2  # of processor per run: 550 runs of the example take two minutes on two cores


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add arena."""
    arena = commands.add_parser(
        "arena",
        help="planners against each other over cells, tasks and seeds; needs no ROS",
        description="Runs what the folder has no result of; the same command goes on after an "
        "interruption.",
    )
    add_study(arena, _FOLDER)
    words = (
        f"one seed and {_QUICK_S:g} s per run, in {_QUICK_FOLDER}; without SETTINGS.yaml "
        "those of --example"
    )
    arena.add_argument("--quick", action="store_true", help=words)
    arena.add_argument("--parquet", action="store_true", help="also table.parquet; needs pyarrow")
    arena.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run, and print which files were written."""
    if arguments.example:
        sys.stdout.write(EXAMPLE)
        return 0
    settings, folder = asked(arguments)
    finished = studied(
        arguments, lambda means: run_arena(settings, folder, means, parquet=arguments.parquet)
    )
    sys.stdout.write(f"{finished.summary}\n")
    sys.stdout.writelines(f"{path}\n" for path in finished.files)
    return 0


def asked(arguments: argparse.Namespace) -> tuple[ArenaSettings, str]:
    """The settings, and the folder of the results."""
    if not arguments.quick:
        return read_settings(settings_of(arguments, "ir arena")), str(arguments.output)
    named = arguments.settings is not None
    settings = read_settings(arguments.settings) if named else arena_settings(EXAMPLE, str)
    folder = _QUICK_FOLDER if arguments.output == _FOLDER else str(arguments.output)
    return replace(settings, seeds=1, seconds=_QUICK_S), folder
