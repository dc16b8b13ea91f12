"""`ir cell`: everything that is wrong with a cell file, its stations, and the bundled cells."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from pathlib import Path
from textwrap import indent
from typing import TYPE_CHECKING

from ir_description import (
    Cell,
    DescriptionFileError,
    Finding,
    UnknownNameError,
    bundled_cells,
    cell_file_errors,
    cell_file_line,
    check_cell,
    is_path,
    load_cell,
)

from ..errors import InputError
from ..suggestions import unknown_name
from ..terminal import table
from .cell_import import add_import
from .cell_worlds import add_export
from .output import (
    Columns,
    ProgressLine,
    Row,
    add_formats,
    number,
    print_csv,
    print_json,
    print_table,
    text,
)

if TYPE_CHECKING:
    from ..deep.mended import Suggestion

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
    """Add cell new, cell check, cell import, cell export and cell list."""
    cell = commands.add_parser("cell", help="begin and check cell files, list the bundled cells")
    verbs = cell.add_subparsers(dest="verb", required=True)
    check = verbs.add_parser(
        "check", help="everything that is wrong with a cell file, and its stations"
    )
    check.add_argument("file", metavar="CELL", help="a path, or the name of a bundled cell")
    check.add_argument(
        "--deep",
        action="store_true",
        help="also every configuration, lines in and out, and the program, with lines to paste",
    )
    add_formats(check, comma=False)
    check.set_defaults(run=run_check)
    new = verbs.add_parser(
        "new", help="begin a cell file: a robot, two tables and a program that plans"
    )
    new.add_argument("file", metavar="FILE", help="the file to write: my_cell.yaml")
    new.add_argument(
        "--robot", default="kr210_r2700_extra", metavar="ROBOT", help="ir robot list, or a file"
    )
    new.set_defaults(run=run_new)
    add_import(verbs)
    add_export(verbs)
    listing = verbs.add_parser("list", help="the bundled cells")
    add_formats(listing)
    listing.set_defaults(run=run_list)


def run_check(arguments: argparse.Namespace) -> int:
    """Print all errors of a file, else what is in it; exit code 1 where its program can't run."""
    cell = _readable(arguments.file)
    if cell is None:
        return 1
    from ir_planner.program import unknown_searches  # a planner, only for a cell that can be read
    from ir_planner.search import SEARCHES

    from ..deep.stations import stations_of

    stations = stations_of(cell)
    suggestions, configurations = _deep(cell) if arguments.deep else ([], [])
    findings: list[Finding | Suggestion] = [
        *check_cell(cell),
        *unknown_searches(cell, cell.program, SEARCHES),
        *suggestions,
    ]
    if arguments.json:
        listed = {"findings": [asdict(f) for f in findings if isinstance(f, Finding)]}
        listed["suggestions"] = [asdict(s) for s in suggestions]
        print_json(
            {"cell": cell.name, "stations": stations, "configurations": configurations, **listed}
        )
    else:
        _print_cell(cell)
        if stations:
            print_table(stations, STATIONS)
        if configurations:
            from ..deep.table import CONFIGURATIONS

            print_table(configurations, CONFIGURATIONS)
        for finding in findings:
            _print_finding(finding, arguments.file)
    unreached = any(not row["free"] for row in stations)
    return 1 if unreached or any(each.severity == "error" for each in findings) else 0


def run_new(arguments: argparse.Namespace) -> int:
    """Write a cell file to begin with."""
    from .cell_new import write_cell

    write_cell(Path(arguments.file), arguments.robot)
    return 0


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
        [
            machine.name,
            str(machine.zone.kind).lower(),
            str(len(machine.bodies)),
            machine.state or "-",
        ]
        for machine in cell.equipment
    ]
    tool = cell.tool.name if cell.tool else "none"
    sys.stdout.write(
        f"cell {cell.name}: robot {cell.robot.name}, tool {tool}; {len(cell.program)} steps\n"
    )
    if rows:
        sys.stdout.write(table(["equipment", "zone", "bodies", "state"], rows) + "\n")


def _print_finding(finding: Finding | Suggestion, file: str) -> None:
    """One line, with the place in the file, and what to paste there."""
    line = cell_file_line(file, finding.subject) if is_path(file) else 0
    place = f"{file}:{line}: " if line else ""
    sys.stdout.write(f"{place}{finding.severity}: {finding.subject}: {finding.sentence}\n")
    if pasted := getattr(finding, "yaml", ""):
        sys.stdout.write(indent(pasted, "    ") + "\n")


def _deep(cell: Cell) -> tuple[list[Suggestion], list[Row]]:
    from ..deep.check import suggestions_of
    from ..deep.table import configurations_of

    with ProgressLine() as line:
        line.show("deep check", 0, len(cell.stations), 0.0)
        return list(suggestions_of(cell)), configurations_of(cell)
