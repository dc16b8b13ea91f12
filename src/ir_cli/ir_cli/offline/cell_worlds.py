"""Worlds of simulators and cells: `ir cell import world.sdf`, `ir cell export CELL world.sdf`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from ir_description import Cell, Equipment, InvalidValueError, cell_to_yaml, load_cell, robot_named
from ir_description.cell import shape_register, zone_around
from ir_description.files.worlds import WRITERS, read_world

from ..errors import InputError
from .asking import add_cell, sentences

WORLDS = (".sdf", ".world", ".urdf")


def add_export(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add cell export."""
    command = verbs.add_parser("export", help="the machines of a cell as SDF, URDF or glTF")
    add_cell(command)
    command.add_argument("file", metavar="FILE", help="world.sdf, world.urdf or world.glb")
    command.set_defaults(run=run_export)


def run_export(arguments: argparse.Namespace) -> int:
    """Write the world; files that are there are not overwritten."""
    path = Path(arguments.file)
    form = path.suffix.lower().removeprefix(".")
    if form not in (*WRITERS, "glb"):
        raise InputError(f"{path.name[:60]!a} must end with .sdf, .urdf or .glb")
    with sentences():
        cell = load_cell(arguments.cell)
    if form == "glb":
        from .cell_glb import cell_glb  # draws bodies as the report does

        with path.open("xb") as binary:
            binary.write(cell_glb(cell))
        sys.stdout.write(f"{path}\n")
        return 0
    text, files = WRITERS[form](cell)
    for name, content in ((path.name, text), *files.items()):
        with (path.parent / name).open("x", encoding="utf-8") as file:
            file.write(content)
    sys.stdout.write(f"{path} and {len(files)} meshes\n")
    return 0


def run_world(path: Path, robot_name: str) -> int:
    """Print a cell with the machines of a world; what was left out on stderr."""
    with sentences():
        robot = robot_named(robot_name)
        world = read_world(path, shape_register(robot))
        try:
            cell = Cell(
                name=world.name,
                robot=robot,
                base_pose=np.eye(4),
                tool=None,
                tcp=np.eye(4),
                parts=(),
                equipment=tuple(
                    Equipment(each.name, each.pose, each.bodies, zone_around("OPEN", each.bodies))
                    for each in world.machines
                ),
                stations=(),
                signals=(),
                park=robot.machine_home,
                machine_home=robot.machine_home,
                program=(),
            )
        except InvalidValueError as error:
            raise InputError(f"{path.name}: {error}") from error
    sys.stdout.write(cell_to_yaml(cell))
    for each in world.left_out:
        sys.stderr.write(f"ir: left out: {each}\n")
    return 0
