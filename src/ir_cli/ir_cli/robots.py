"""`ir robot`: bundled robots listed, robot files checked, new ones made from a URDF."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ir_cli.errors import InputError, unknown_name
from ir_cli.output import (
    Row,
    add_formats,
    add_renamed,
    number,
    print_csv,
    print_json,
    print_table,
    text,
)
from ir_cli.robot_remarks import Remark, remarks_on
from ir_description import (
    DescriptionFileError,
    RobotModel,
    UnknownNameError,
    bundled_robots,
    is_path,
    load_robot,
)
from ir_description.files import robot_file_errors
from ir_description.library import robot_named

if TYPE_CHECKING:
    from ir_cli.robot_from_urdf import RobotSource

URDFS = (".urdf", ".xacro")
COLUMNS = {
    "robot": ("robot", text),
    "title": ("maker and model", text),
    "joints": ("joints", text),
    "payload": ("payload kg", number(0)),
    "mass": ("arm kg", number(0)),
    "modes": ("power modes", text),
}


def add_list(listing: argparse.ArgumentParser) -> None:
    """Arguments of `ir robot list`."""
    add_formats(listing)
    listing.set_defaults(run=run_list)


def add_check(check: argparse.ArgumentParser) -> None:
    """Arguments of `ir robot check`."""
    check.add_argument(
        "robot",
        metavar="ROBOT",
        help="a robot file, the name of a bundled robot, or a URDF or xacro file",
    )
    _add_figures(check)
    add_formats(check, comma=False)
    check.set_defaults(run=run_check)


def add_new(new: argparse.ArgumentParser) -> None:
    """Arguments of `ir robot new`."""
    new.add_argument(
        "--template", action="store_true", help="print an empty sheet of drive figures, and end"
    )
    new.add_argument(
        "urdf", nargs="?", metavar="URDF", help="a URDF or xacro file: links, joints, shapes"
    )
    new.add_argument("--urdf", dest="urdf_option", metavar="FILE", help=argparse.SUPPRESS)
    _add_figures(new)
    output = new.add_argument(
        "-o", "--output", metavar="FILE", default="", help="robot file (URDF's name, .yaml)"
    )
    add_renamed(new, "--out", output)
    new.set_defaults(run=run_new)


def _add_figures(parser: argparse.ArgumentParser) -> None:
    """What a URDF doesn't say, and which parts of it are the robot."""
    parser.add_argument(
        "--payload", type=float, metavar="KG", help="rated payload, where there is no drive sheet"
    )
    words = "mass of the arm with its base, by its data sheet: for links without a mass"
    parser.add_argument("--mass", type=float, metavar="KG", help=words)
    words = "what the URDF does not say; see ir robot new --template"
    parser.add_argument("--drives", metavar="FILE", help=words)
    words = "link at the flange (flange, tool0)"
    parser.add_argument("--tip", default="", metavar="LINK", help=words)
    words = "leave out a link with all that it carries; repeatable"
    parser.add_argument("--without", action="append", default=[], metavar="LINK", help=words)
    words = "folder below which package://NAME/.. is found (that of the URDF and those above)"
    parser.add_argument("--packages", default="", metavar="FOLDER", help=words)
    words = "an argument of a xacro file; repeatable"
    parser.add_argument("--set", action="append", default=[], metavar="NAME:=VALUE", help=words)


def _source(urdf: Path, arguments: argparse.Namespace) -> RobotSource:
    """What a robot is made from. Raises InputError."""
    from ir_cli.robot_from_urdf import RobotSource

    for name, most in (("payload", 1e4), ("mass", 1e5)):
        value = getattr(arguments, name)
        if value is not None and not 0.0 < value <= most:
            raise InputError(f"--{name} is {value:g} kg, must be in (0, {most:g}] kg")
    return RobotSource(
        urdf=urdf,
        drives=Path(arguments.drives) if arguments.drives else None,
        payload=arguments.payload,
        mass=arguments.mass,
        tip=arguments.tip,
        without=tuple(arguments.without),
        packages=Path(arguments.packages) if arguments.packages else None,
        settings=dict(map(_setting, arguments.set)),
    )


def _setting(text: str) -> tuple[str, str]:
    """Name and value of an argument of a xacro file. Raises InputError."""
    name, sign, value = text.partition(":=")
    if not name or not sign:
        raise InputError(f"--set {text[:60]!a}: must be NAME:=VALUE, as ur_type:=ur10e")
    return name, value


def run_new(arguments: argparse.Namespace) -> int:
    """Write a robot file, or print the empty sheet."""
    from ir_description.files.making import TEMPLATE

    if arguments.template:
        sys.stdout.write(TEMPLATE)
        return 0
    named = arguments.urdf or arguments.urdf_option
    if not named:
        raise InputError(
            "give a URDF: ir robot new robot.urdf --payload 20 --mass 250; ir robot new --template "
            "prints an empty sheet for what a URDF does not say (--drives)"
        )
    from ir_cli.robot_from_urdf import write_robot

    urdf = Path(named)
    write_robot(
        _source(urdf, arguments), Path(arguments.output or f"{urdf.name.partition('.')[0]}.yaml")
    )
    return 0


def run_check(arguments: argparse.Namespace) -> int:
    """Print all errors of a file, else remarks on the robot; exit code 1 where it can't be used."""
    file = Path(arguments.robot)
    if file.suffix.lower() in URDFS:
        from ir_cli.robot_from_urdf import made_robot

        made = made_robot(_source(file, arguments))
        robot: RobotModel | None = made.robot
        read = [Remark("note", file.name, note) for note in made.notes]
    else:
        read = []
        robot = _readable(arguments.robot)
    if robot is None:
        return 1

    remarks = (*remarks_on(robot), *read)
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
