"""`ir cell`: cell files begun and checked, bundled cells listed."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from pathlib import Path
from textwrap import indent
from typing import TYPE_CHECKING

from ir_cli.errors import InputError, unknown_name
from ir_cli.output import (
    Columns,
    ProgressLine,
    Row,
    add_formats,
    number,
    print_csv,
    print_json,
    print_table,
    table,
    text,
)
from ir_cli.planning import add_cell
from ir_description import (
    Cell,
    DescriptionFileError,
    Finding,
    UnknownNameError,
    bundled_cells,
    bundled_robot_cells,
    cell_file_errors,
    cell_file_line,
    check_cell,
    is_path,
    load_cell,
)

if TYPE_CHECKING:
    from ir_cli.cell_mending import Suggestion

STATIONS: Columns = {
    "station": ("station", text),
    "load": ("load", text),
    "reached": ("reached", text),
    "free": ("free", text),
    "clearance": ("clearance mm", number(1, 1e3)),
    "obstacle": ("obstructed by", text),
}


def add_check(check: argparse.ArgumentParser) -> None:
    """Arguments of `ir check`."""
    add_cell(check)
    check.add_argument(
        "--deep",
        action="store_true",
        help="also every configuration, lines in and out, and the program, with lines to paste",
    )
    add_formats(check, comma=False)
    check.set_defaults(run=run_check)


def add_new(new: argparse.ArgumentParser) -> None:
    """Arguments of `ir new`."""
    new.add_argument("file", metavar="FILE", help="the file to write: my_cell.yaml")
    new.add_argument(
        "--robot", default="kr210_r2700_extra", metavar="ROBOT", help="ir robot list, or a file"
    )
    new.set_defaults(run=run_new)


def add_list(listing: argparse.ArgumentParser) -> None:
    """Arguments of `ir cell list`."""
    add_formats(listing)
    listing.set_defaults(run=run_list)


def run_check(arguments: argparse.Namespace) -> int:
    """Print all errors of a file, else what is in it; exit code 1 where its program can't run."""
    cell = _readable(arguments.cell)
    if cell is None:
        return 1
    from ir_cli.station_access import heavy_loads, stations_of
    from ir_planner.program import unknown_searches  # a planner, only for a cell that can be read
    from ir_planner.search import SEARCHES

    stations = stations_of(cell)
    suggestions, configurations = _deep(cell) if arguments.deep else ([], [])
    findings: list[Finding | Suggestion] = [
        *check_cell(cell),
        *unknown_searches(cell, cell.program, SEARCHES),
        *heavy_loads(cell),
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
            from ir_cli.station_access import CONFIGURATIONS

            print_table(configurations, CONFIGURATIONS)
        for finding in findings:
            _print_finding(finding, arguments.cell)
    unreached = any(not row["free"] for row in stations)
    return 1 if unreached or any(each.severity == "error" for each in findings) else 0


def run_new(arguments: argparse.Namespace) -> int:
    """Write a cell file to begin with."""
    from ir_cli.new_cell import write_cell  # with a planner, which no other command of these needs

    write_cell(Path(arguments.file), arguments.robot)
    return 0


def run_list(arguments: argparse.Namespace) -> int:
    """Print the bundled cells."""
    if not (arguments.json or arguments.csv):
        sys.stdout.write("\n".join((*bundled_cells(), *bundled_robot_cells())) + "\n")
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
    from ir_cli.cell_mending import suggestions_of
    from ir_cli.station_access import configurations_of

    with ProgressLine() as line:
        line.show("deep check", 0, len(cell.stations), 0.0)
        return list(suggestions_of(cell)), configurations_of(cell)
