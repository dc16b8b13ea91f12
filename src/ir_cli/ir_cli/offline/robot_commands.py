"""`ir robot`: the robots that come with the project."""

from __future__ import annotations

import argparse

from ir_description import bundled_robots, load_robot

from .output import Row, add_formats, number, print_csv, print_json, print_table, text

COLUMNS = {
    "robot": ("robot", text),
    "joints": ("joints", text),
    "payload": ("payload kg", number(0)),
    "mass": ("arm kg", number(0)),
}


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add robot list."""
    robot = commands.add_parser("robot", help="list the bundled robots")
    verbs = robot.add_subparsers(dest="verb", required=True)
    listing = verbs.add_parser("list", help="robots that a cell file may name, with their payload")
    add_formats(listing)
    listing.set_defaults(run=run_list)


def run_list(arguments: argparse.Namespace) -> int:
    """Print the robots."""
    rows: list[Row] = [
        {
            "robot": name,
            "joints": (robot := load_robot(name)).n,
            "payload": robot.rated_payload,
            "mass": float(robot.link_mass.sum()),
        }
        for name in bundled_robots()
    ]
    if arguments.json:
        print_json({"robots": rows})
    elif arguments.csv:
        print_csv(rows)
    else:
        print_table(rows, COLUMNS)
    return 0
