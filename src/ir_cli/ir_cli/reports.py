"""`ir report` and `ir energy fleet`: pages of recordings."""

from __future__ import annotations

import argparse
import sys

from ir_recorder.arguments import add_roots, roots_of
from ir_recorder.report.fleet import write_fleet
from ir_recorder.report.fleet_members import read_members, write_fleet_table
from ir_recorder.report.number_text import add_locale
from ir_recorder.report.prices import Costs, read_costs
from ir_recorder.report_main import add_arguments, run

_CLEAR = "\r\x1b[2K"


def add_report(report: argparse.ArgumentParser) -> None:
    """Arguments of `ir report`."""
    add_arguments(report)
    report.set_defaults(run=run)


def add_fleet(fleet: argparse.ArgumentParser) -> None:
    """Arguments of `ir energy fleet`."""
    words = "recordings (.mcap), or folders; a folder below one that is named is a robot"
    fleet.add_argument("paths", nargs="+", metavar="PATH", help=words)
    fleet.add_argument(
        "-o", "--output", default="out/fleet.html", help="page to write (out/fleet.html)"
    )
    fleet.add_argument("--costs", default="", metavar="FILE", help="prices, shifts and CO2 (YAML)")
    fleet.add_argument(
        "--table", default="", metavar="FILE", help="figures as .csv, .xlsx or .parquet as well"
    )
    add_locale(fleet)
    add_roots(fleet)
    fleet.set_defaults(run=run_fleet)


def run_fleet(arguments: argparse.Namespace) -> int:
    """Write the page; files that can't be used are named and left out."""
    roots = roots_of(arguments.roots)
    costs = read_costs(arguments.costs, roots) if arguments.costs else Costs()
    left_out: list[str] = []
    live = sys.stderr.isatty()

    def show(path: str) -> None:
        if live:
            sys.stderr.write(f"{_CLEAR}… {path}")
            sys.stderr.flush()

    try:
        members = read_members(arguments.paths, roots, left_out.append, show)
    finally:
        sys.stderr.write(
            (_CLEAR if live else "") + "".join(f"{sentence}\n" for sentence in left_out)
        )
    sys.stdout.write(f"{write_fleet(members, arguments.output, left_out, costs, roots)}\n")
    if arguments.table:
        sys.stdout.write(
            f"{write_fleet_table(members, arguments.table, roots, arguments.locale)}\n"
        )
    return 0
