"""`ir cell`: everything that is wrong with a cell file, its stations, and the bundled cells."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from textwrap import indent
from typing import TYPE_CHECKING

from ir_description import (
    Cell,
    DescriptionFileError,
    UnknownNameError,
    bundled_cells,
    cell_file_errors,
    check_cell,
    is_path,
    load_cell,
)

from ..errors import InputError
from ..suggestions import unknown_name
from ..terminal import table
from .output import Columns, ProgressLine, Row, add_formats, number, print_csv, print_json, print_table, text

if TYPE_CHECKING:
    from .deep import Suggestion

STATIONS: Columns = {
    "station": ("station", text),
    "load": ("load", text),
    "reached": ("reached", text),
    "free": ("free", text),
    "clearance": ("clearance mm", number(1, 1e3)),
    "obstacle": ("obstructed by", text),
}
CELLS: Columns = {
    "cell": ("cell", text),
    "robot": ("robot", text),
    "machines": ("machines", text),
    "stations": ("stations", text),
    "steps": ("steps", text),
}


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add cell check and cell list."""
    cell = commands.add_parser("cell", help="check cell files, list the bundled cells")
    verbs = cell.add_subparsers(dest="verb", required=True)
    check = verbs.add_parser("check", help="everything that is wrong with a cell file, and its stations")
    check.add_argument("file", metavar="CELL", help="a path, or the name of a bundled cell")
    check.add_argument(
        "--deep", action="store_true", help="also contacts, exits and the program, with lines to paste"
    )
    add_formats(check, comma=False)
    check.set_defaults(run=run_check)
    listing = verbs.add_parser("list", help="the bundled cells")
    add_formats(listing)
    listing.set_defaults(run=run_list)


def run_check(arguments: argparse.Namespace) -> int:
    """Print all errors of a file, else what is in it; exit code 1 where its program can't run."""
    cell = _readable(arguments.file)
    if cell is None:
        return 1
    from .stations import stations_of  # a planner, only for a cell that can be read

    findings, stations = check_cell(cell), stations_of(cell)
    suggestions = _suggestions(cell) if arguments.deep else []
    if arguments.json:
        listed = {"findings": [asdict(f) for f in findings], "suggestions": [asdict(s) for s in suggestions]}
        print_json({"cell": cell.name, "stations": stations, **listed})
    else:
        _print_cell(cell)
        if stations:
            print_table(stations, STATIONS)
        for finding in findings:
            sys.stdout.write(f"{finding.severity}: {finding.subject}: {finding.sentence}\n")
        for suggestion in suggestions:
            sys.stdout.write(f"{suggestion.severity}: {suggestion.subject}: {suggestion.sentence}\n")
            if suggestion.yaml:
                sys.stdout.write(indent(suggestion.yaml, "    ") + "\n")
    unreached = any(not row["free"] for row in stations)
    severities = [*(each.severity for each in findings), *(each.severity for each in suggestions)]
    return 1 if unreached or "error" in severities else 0


def run_list(arguments: argparse.Namespace) -> int:
    """Print the bundled cells."""
    if not (arguments.json or arguments.csv):
        sys.stdout.write("\n".join(bundled_cells()) + "\n")
        return 0
    rows: list[Row] = [
        {
            "cell": name,
            "robot": (cell := load_cell(name)).robot.name,
            "machines": len(cell.equipment),
            "stations": len(cell.stations),
            "steps": len(cell.program),
        }
        for name in bundled_cells()
    ]
    if arguments.json:
        print_json({"cells": rows})
    else:
        print_csv(rows)
    return 0


def _readable(name: str) -> Cell | None:
    """The cell, or None when all errors of its file have been printed."""
    try:
        return load_cell(name)
    except UnknownNameError as error:
        raise InputError(unknown_name("cell", name[:80], error.known, "ir cell list")) from error
    except DescriptionFileError as error:
        found = (cell_file_errors(name) if is_path(name) else ()) or (error,)
        for each in found:
            sys.stderr.write(f"ir: {each}\n")
        count = len(found)
        sys.stderr.write(f"ir: {count} error{'s' if count > 1 else ''}\n")
        return None


def _print_cell(cell: Cell) -> None:
    rows = [
        [machine.name, str(machine.zone.kind).lower(), str(len(machine.bodies)), machine.state or "-"]
        for machine in cell.equipment
    ]
    tool = cell.tool.name if cell.tool else "none"
    sys.stdout.write(f"cell {cell.name}: robot {cell.robot.name}, tool {tool}; {len(cell.program)} steps\n")
    if rows:
        sys.stdout.write(table(["equipment", "zone", "bodies", "state"], rows) + "\n")


def _suggestions(cell: Cell) -> list[Suggestion]:
    from .deep import suggestions_of

    with ProgressLine() as line:
        line.show("deep check", 0, len(cell.stations), 0.0)
        return list(suggestions_of(cell))
