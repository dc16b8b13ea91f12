"""`ir cell`: check cell files, and list the bundled cells."""

from __future__ import annotations

import argparse
import sys

from ir_description import DescriptionError, bundled_cells, check_cell, load_cell

from .errors import CommandError
from .terminal import table


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add cell check and cell list."""
    cell = commands.add_parser("cell", help="check cell files, list the bundled cells")
    verbs = cell.add_subparsers(dest="verb", required=True)
    check = verbs.add_parser("check", help="read a cell file; list what is wrong with it, and where")
    check.add_argument("file", help="a path, or the name of a bundled cell")
    check.set_defaults(run=run_check)
    listing = verbs.add_parser("list", help="names of the bundled cells")
    listing.set_defaults(run=run_list)


def run_check(arguments: argparse.Namespace) -> int:
    """Load the cell and look it over; exit code 1 when a finding will keep its program from running."""
    try:
        cell = load_cell(arguments.file)
    except DescriptionError as error:
        raise CommandError(str(error)) from error
    rows = [
        [machine.name, str(machine.zone.kind).lower(), str(len(machine.bodies)), machine.state or "-"]
        for machine in cell.equipment
    ]
    sys.stdout.write(
        f"cell {cell.name}: robot {cell.robot.name}, tool {cell.tool.name if cell.tool else 'none'}\n"
    )
    sys.stdout.write(table(["equipment", "zone", "bodies", "state"], rows) + "\n")
    sys.stdout.write(
        f"stations: {', '.join(station.name for station in cell.stations) or 'none'}; "
        f"program: {len(cell.program)} steps\n"
    )
    findings = check_cell(cell)
    for finding in findings:
        sys.stdout.write(f"{finding.severity}: {finding.subject}: {finding.sentence}\n")
    return 1 if any(finding.severity == "error" for finding in findings) else 0


def run_list(arguments: argparse.Namespace) -> int:
    """Print the names."""
    sys.stdout.write("\n".join(bundled_cells()) + "\n")
    return 0
