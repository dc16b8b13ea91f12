"""`ir study`: many plans of one cell, and what follows: where things should stand, statistics."""

from __future__ import annotations

import argparse
import sys

from ir_studies import KINDS, read_study

from ..errors import InputError
from .output import print_json
from .studying import add_study, settings_of, studied


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add study with a command per kind; the arena has a command of its own."""
    about = "where things should stand, statistics: many plans of one cell; needs no ROS"
    study = commands.add_parser("study", help=about)
    kinds = study.add_subparsers(dest="kind", required=True, metavar="KIND")
    for name, kind in KINDS.items():
        if name == "arena":
            continue
        one = kinds.add_parser(
            name,
            help=kind.about,
            description=f"{kind.about.capitalize()}. Makes what the folder has no result of; the "
            "same command goes on after an interruption.",
        )
        add_study(one, f"out/{name}")
        one.add_argument(
            "--json", action="store_true", help="print summary, files and table as JSON"
        )
    study.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run, and print what follows and which files were written."""
    kind = str(arguments.kind)
    if arguments.example:
        sys.stdout.write(KINDS[kind].example)
        return 0
    study = read_study(settings_of(arguments, f"ir study {kind}"))
    if study.kind != kind:
        raise InputError(f"these are settings of {study.kind}, not of {kind}")
    answer = studied(arguments, lambda means: study.run(arguments.output, means))
    if arguments.json:
        files = [str(path) for path in answer.files]
        print_json({"summary": answer.summary, "files": files, "table": answer.table})
        return 0
    sys.stdout.write(f"{answer.summary}\n")
    sys.stdout.writelines(f"{path}\n" for path in answer.files)
    return 0
