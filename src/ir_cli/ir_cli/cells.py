"""`ir cell`: cell files begun and checked, bundled cells listed."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
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
    RobotCells,
    UnknownNameError,
    bundled_cells,
    check_cell,
    is_path,
    load_cell,
    load_robot_cells,
)
from ir_description.cell_review import CellFinding, check_robot_cell
from ir_description.library import bundled_robot_cells, cell_file_errors, cell_file_line, robot_in

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


@dataclass(frozen=True, eq=False)
class _Looked:
    """A cell that is checked; its robot among those of `several`, None: it has one."""

    cell: Cell
    several: RobotCells | None = None
    robot: str = ""

    def own(self, station: str) -> bool:
        """Whether a station is looked at: others are left to the robots that visit them."""
        return self.several is None or station in self.several.stations_of(self.robot)

    def findings(self) -> tuple[CellFinding, ...]:
        """What looks wrong."""
        if self.several is None:
            return check_cell(self.cell)
        return (*check_robot_cell(self.several, self.robot), *_refused(self.several, self.robot))


def _refused(several: RobotCells, robot: str) -> Iterator[CellFinding]:
    """Why a robot's program can't be planned together with the others'."""
    from ir_planner import RequestError
    from ir_planner.robots import check_places, check_processes, check_repeatable

    try:
        check_repeatable(robot, several.of_robot(robot))
        check_processes(several.by_name)
        check_places(several)
    except RequestError as error:
        yield CellFinding("error", robot, str(error))


@dataclass(frozen=True, eq=False)
class _Checked:
    cell: Cell
    stations: list[Row]
    findings: list[CellFinding]
    suggestions: list[Suggestion]
    configurations: list[Row]

    @property
    def passed(self) -> bool:
        """Whether the program can run."""
        reached = all(row["free"] for row in self.stations)
        return reached and all(each.severity != "error" for each in self.remarks)

    @property
    def remarks(self) -> list[CellFinding | Suggestion]:
        """What is said below the tables."""
        return [*self.findings, *self.suggestions]

    @property
    def answer(self) -> dict[str, object]:
        """For other programs."""
        return {
            "cell": self.cell.name,
            "stations": self.stations,
            "configurations": self.configurations,
            "findings": [asdict(finding) for finding in self.findings],
            "suggestions": [asdict(suggestion) for suggestion in self.suggestions],
        }


def run_check(arguments: argparse.Namespace) -> int:
    """Print all errors of a file, else what is in it, of each of several robots; exit code 1 where
    a program can't run.
    """
    looked = _readable(arguments.cell)
    checked = [_checked(each, deep=arguments.deep) for each in looked]
    if arguments.json and looked:
        answers = [each.answer for each in checked]
        print_json(answers[0] if len(answers) == 1 else {"cells": answers})
    elif not arguments.json:
        for each in checked:
            _print_checked(each, robot_in(arguments.cell)[0])
    return 0 if checked and all(each.passed for each in checked) else 1


def _checked(looked: _Looked, *, deep: bool) -> _Checked:
    """What was found in a cell; deep: also what the planner refuses."""
    from ir_cli.station_access import heavy_loads, stations_of
    from ir_planner.program import unknown_searches  # a planner, only for a cell that can be read
    from ir_planner.search import SEARCHES

    cell = looked.cell
    suggestions, configurations = _deep(cell) if deep else ([], [])
    others = {station.name for station in cell.stations if not looked.own(station.name)}
    return _Checked(
        cell,
        [row for row in stations_of(cell) if row["station"] not in others],
        [
            *looked.findings(),
            *unknown_searches(cell, cell.program, SEARCHES),
            *heavy_loads(cell),
        ],
        [each for each in suggestions if each.subject not in others],
        [row for row in configurations if row["station"] not in others],
    )


def _print_checked(checked: _Checked, file: str) -> None:
    _print_cell(checked.cell)
    if checked.stations:
        print_table(checked.stations, STATIONS)
    if checked.configurations:
        from ir_cli.station_access import CONFIGURATIONS

        print_table(checked.configurations, CONFIGURATIONS)
    for finding in checked.remarks:
        _print_finding(finding, file)


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


def _readable(name: str) -> list[_Looked]:
    """The cells that are meant, none when all errors of their file have been printed."""
    file, robot = robot_in(name)
    try:
        several = load_robot_cells(file)
        if several is None:
            return [_Looked(load_cell(name))]
        robots = (robot,) if robot else several.robots
        return [_Looked(several.of_robot(each), several, each) for each in robots]
    except UnknownNameError as error:
        if robot:
            raise InputError(str(error)) from error
        raise InputError(unknown_name("cell", name[:80], error.known, "ir cell list")) from error
    except DescriptionFileError as error:
        found = (cell_file_errors(file) if is_path(file) else ()) or (error,)
        for each in found:
            sys.stderr.write(f"ir: {each}\n")
        count = len(found)
        sys.stderr.write(f"ir: {count} error{'s' if count > 1 else ''}\n")
        return []


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


def _print_finding(finding: CellFinding | Suggestion, file: str) -> None:
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
