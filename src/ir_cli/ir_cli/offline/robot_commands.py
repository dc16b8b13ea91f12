"""`ir robot`: the robots that come with the project, robot files checked, and new ones from a
URDF.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ir_description import (
    DescriptionFileError,
    RobotModel,
    UnknownNameError,
    bundled_robots,
    is_path,
    load_robot,
    robot_file_errors,
    robot_named,
)

from ..errors import InputError
from ..suggestions import unknown_name
from .output import Row, add_formats, number, print_csv, print_json, print_table, text

COLUMNS = {
    "robot": ("robot", text),
    "title": ("maker and model", text),
    "joints": ("joints", text),
    "payload": ("payload kg", number(0)),
    "mass": ("arm kg", number(0)),
    "modes": ("power modes", text),
}


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add robot new, robot check and robot list."""
    robot = commands.add_parser(
        "robot", help="check robot files, make one from a URDF, list the bundled ones"
    )
    verbs = robot.add_subparsers(dest="verb", required=True)
    listing = verbs.add_parser("list", help="robots that a cell file may name, with their payload")
    add_formats(listing)
    listing.set_defaults(run=run_list)
    check = verbs.add_parser("check", help="what a robot file lacks, before anything is planned")
    check.add_argument(
        "robot", metavar="ROBOT", help="a robot file, or the name of a bundled robot"
    )
    add_formats(check, comma=False)
    check.set_defaults(run=run_check)
    _add_new(verbs.add_parser("new", help="a robot file from a URDF and a sheet of drive figures"))


def _add_new(new: argparse.ArgumentParser) -> None:
    new.add_argument(
        "--template", action="store_true", help="print an empty sheet of drive figures, and end"
    )
    new.add_argument(
        "--urdf", metavar="FILE", help="how the arm is built: links, joints, masses, shapes"
    )
    new.add_argument("--drives", metavar="FILE", help="what the URDF does not say; see --template")
    new.add_argument(
        "-o", "--out", metavar="FILE", default="robot.yaml", help="robot file (robot.yaml)"
    )
    new.add_argument("--tip", default="", metavar="LINK", help="link at the flange (flange, tool0)")
    words = "folder below which package://NAME/.. is found (that of the URDF and those above)"
    new.add_argument("--packages", default="", metavar="FOLDER", help=words)
    new.set_defaults(run=run_new)


def run_new(arguments: argparse.Namespace) -> int:
    """Write a robot file, or print the empty sheet."""
    from ir_description.files.making import TEMPLATE

    if arguments.template:
        sys.stdout.write(TEMPLATE)
        return 0
    if not arguments.urdf or not arguments.drives:
        raise InputError(
            "give --urdf FILE and --drives FILE; ir robot new --template prints an empty sheet"
        )
    from .robot_new import write_robot

    packages = Path(arguments.packages) if arguments.packages else None
    urdf, drives, out = (Path(name) for name in (arguments.urdf, arguments.drives, arguments.out))
    write_robot(urdf, drives, arguments.tip, packages, out)
    return 0


def run_check(arguments: argparse.Namespace) -> int:
    """Print all errors of a file, else remarks on the robot; exit code 1 where it can't be used."""
    robot = _readable(arguments.robot)
    if robot is None:
        return 1
    from .robot_check import remarks_on  # the kernels, only for a robot that can be read

    remarks = remarks_on(robot)
    if arguments.json:
        print_json({"robot": robot.name, "remarks": [remark._asdict() for remark in remarks]})
    else:
        sys.stdout.write(
            f"robot {robot.name}: {robot.title or 'without a title'}, {robot.n} axes, "
        )
        sys.stdout.write(f"{robot.rated_payload:g} kg, {len(robot.capsules)} capsules\n")
        for remark in remarks:
            sys.stdout.write(f"{remark.severity}: {remark.subject}: {remark.sentence}\n")
    return 1 if any(remark.severity == "error" for remark in remarks) else 0


def _readable(name: str) -> RobotModel | None:
    """The robot, or None when all errors of its file have been printed."""
    try:
        return robot_named(name)
    except UnknownNameError as error:
        raise InputError(unknown_name("robot", name[:80], error.known, "ir robot list")) from error
    except DescriptionFileError as error:
        found = (robot_file_errors(Path(name)) if is_path(name) else ()) or (error,)
        for each in found:
            sys.stderr.write(f"ir: {each}\n")
        sys.stderr.write(f"ir: {len(found)} error{'s' if len(found) > 1 else ''}\n")
        return None


def run_list(arguments: argparse.Namespace) -> int:
    """Print the robots."""
    rows: list[Row] = [
        {
            "robot": name,
            "title": (robot := load_robot(name)).title,
            "joints": robot.n,
            "payload": robot.rated_payload,
            "mass": float(robot.link_mass.sum()),
            "modes": len(robot.controller.modes) if robot.controller.has_table else "none",
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
