"""`ir cell import` and `export`: meshes from CAD, point clouds, worlds of simulators, glTF."""

from __future__ import annotations

import argparse
import json
import re
import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np

from ir_cli.errors import InputError
from ir_cli.output import print_json
from ir_cli.planning import add_cell, sentences
from ir_description import (
    Cell,
    CellFileError,
    Equipment,
    InvalidValueError,
    cell_to_yaml,
    load_cell,
)
from ir_description.cell import shape_register, zone_around
from ir_description.files import point_cloud
from ir_description.files.curved_surfaces import KINDS as SURFACES
from ir_description.files.curved_surfaces import NOT_PROVED
from ir_description.files.solid_reader import PIECES, PIECES_MAX, UNITS, SolidReader
from ir_description.files.worlds import IMPORTERS, WRITERS, read_world
from ir_description.library import robot_named
from ir_recorder.report.shapes import body_mesh
from ir_values.errors import one_line
from ir_values.output_files import write_file
from ir_values.yaml_items import read_items

_Z_UP = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
"""Column by column: glTF's y axis points up, the cell's z."""
_FLOAT = 5126
_UINT = 5125
_JSON = 0x4E4F534A
_BIN = 0x004E4942
_MAGIC = 0x46546C67
_VERSION = 2


def cell_glb(cell: Cell) -> bytes:
    """One node per machine, and one below it per body that is there in its state; planes are left
    out.
    """
    nodes: list[dict[str, Any]] = [{"name": cell.name, "matrix": _Z_UP, "children": []}]
    meshes: list[dict[str, Any]] = []
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    binary = bytearray()
    for machine in cell.equipment:
        owner = {
            "name": machine.name,
            "matrix": machine.pose.T.ravel().tolist(),
            "children": list[int](),
        }
        nodes[0]["children"].append(len(nodes))
        nodes.append(owner)
        for body in machine.present_bodies():
            mesh = body_mesh(body)
            if mesh is None:
                continue
            points = mesh.points.astype("<f4")
            corners = mesh.triangles.astype("<u4").ravel()
            for values, kind, shape in ((points, _FLOAT, "VEC3"), (corners, _UINT, "SCALAR")):
                bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
                entry = {
                    "bufferView": len(views),
                    "componentType": kind,
                    "count": len(values),
                    "type": shape,
                }
                accessors.append({**entry, **(bounds if shape == "VEC3" else {})})
                views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": values.nbytes})
                binary += values.tobytes()
            last = len(accessors) - 1
            meshes.append({"primitives": [{"attributes": {"POSITION": last - 1}, "indices": last}]})
            owner["children"].append(len(nodes))  # type: ignore[attr-defined]
            pose = body.pose.T.ravel().tolist()
            nodes.append({"name": body.name, "matrix": pose, "mesh": len(meshes) - 1})
    for node in nodes:
        if not node.get("children", True):
            del node["children"]
    document: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}]}
    document["nodes"] = nodes
    if meshes:
        document |= {"meshes": meshes, "accessors": accessors, "bufferViews": views}
        document["buffers"] = [{"byteLength": len(binary)}]
    return _container(json.dumps(document, separators=(",", ":")).encode(), bytes(binary))


def _container(text: bytes, binary: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), _JSON) + text
    if binary:
        # of four-byte numbers: padded already
        chunks += struct.pack("<II", len(binary), _BIN) + binary
    return struct.pack("<III", _MAGIC, _VERSION, 12 + len(chunks)) + chunks


WORLDS = (".sdf", ".world", ".urdf", ".scene")


def add_export(command: argparse.ArgumentParser) -> None:
    """Arguments of `ir cell export`."""
    add_cell(command)
    command.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="world.sdf, world.urdf or world.glb"
    )
    command.add_argument("file", nargs="?", type=Path, help=argparse.SUPPRESS)  # the old place
    command.set_defaults(run=run_export)


def _output(arguments: argparse.Namespace) -> Path:
    """-o FILE, or the old argument after the cell. InputError where there is neither."""
    old: Path | None = getattr(arguments, "file", None)
    if old is not None:
        sys.stderr.write("ir: FILE is now -o FILE\n")
    chosen = arguments.output or old
    if chosen is None:
        raise InputError("say which file: -o world.sdf, world.urdf or world.glb")
    return Path(chosen)


def run_export(arguments: argparse.Namespace) -> int:
    """Write the world; files that are there are not overwritten."""
    path = _output(arguments)
    form = path.suffix.lower().removeprefix(".")
    if form not in (*WRITERS, "glb"):
        raise InputError(f"{path.name[:60]!a} must end with .sdf, .urdf or .glb")
    with sentences():
        cell = load_cell(arguments.cell)
    if form == "glb":
        write_file(path, cell_glb(cell), new=True)
        sys.stdout.write(f"{path}\n")
        return 0
    text, files = WRITERS[form](cell)
    for name, content in ((path.name, text), *files.items()):
        write_file(path.parent / name, content, new=True)
    sys.stdout.write(f"{path} and {len(files)} meshes\n")
    return 0


def run_world(path: Path, robot_name: str, visuals: bool) -> int:
    """Print a cell with the machines of a world; what was left out at its head and on stderr."""
    with sentences():
        robot = robot_named(robot_name)
        world = read_world(path, shape_register(robot), visuals=visuals)
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
    head = "".join(f"# left out: {one_line(each)}\n" for each in world.left_out)
    sys.stdout.write(head + cell_to_yaml(cell))
    for each in world.left_out:
        sys.stderr.write(f"ir: left out: {each}\n")
    return 0


_NO_NAME = re.compile(r"[^A-Za-z0-9_-]+")


def add_import(command: argparse.ArgumentParser) -> None:
    """Arguments of `ir cell import`."""
    command.add_argument(
        "file",
        metavar="FILE",
        help="a mesh: .stl, .obj, .glb, .gltf, .step, .iges; a point cloud or height map: "
        ".ply, .pcd, .npy; a world: .sdf, .urdf, .scene",
    )
    command.add_argument("--unit", choices=tuple(UNITS), help="of a mesh or cloud; never guessed")
    command.add_argument(
        "--margin",
        type=float,
        metavar="M",
        help="radius [m] about each point of a cloud that is kept free",
    )
    command.add_argument(
        "--voxel",
        type=float,
        default=point_cloud.VOXEL,
        metavar="M",
        help=f"edge [m] of the cubes of a cloud ({point_cloud.VOXEL})",
    )
    command.add_argument(
        "--pitch", type=float, metavar="M", help="distance [m] of the samples of a height map"
    )
    command.add_argument(
        "--pieces", type=_pieces, default=PIECES, help=f"at most so many ({PIECES})"
    )
    command.add_argument(
        "--robot", default="kr210_r2700_extra", metavar="ROBOT", help="of a world's cell"
    )
    words = "take the visual shapes of links of a world that have no collision shape"
    command.add_argument("--visuals", action="store_true", help=words)
    command.add_argument("--json", action="store_true", help="print the answer as JSON")
    command.set_defaults(run=run_import)


def run_import(arguments: argparse.Namespace) -> int:
    """Divide the mesh and print its line, or print the cell of a world."""
    path = Path(arguments.file)
    if path.suffix.lower() in WORLDS or path.suffix.lower().removeprefix(".") in IMPORTERS:
        return run_world(path, arguments.robot, arguments.visuals)
    if arguments.unit is None and path.suffix.lower() not in SURFACES:
        raise InputError(f"say the unit of {path.name[:60]!a}: --unit {' or '.join(UNITS)}")
    if path.suffix.lower() in point_cloud.SUFFIXES:
        return _run_cloud(path, arguments)
    with sentences():
        reader = SolidReader(path.parent)
        found = reader.pieces(path.name, arguments.unit or "", arguments.pieces)
    name = _name_of(path, "mesh")
    pieces = "" if arguments.pieces == PIECES else f", pieces: {arguments.pieces}"
    unit = f", unit: {arguments.unit}" if arguments.unit else ""
    line = f"- {{name: {name}, mesh: {path.name}{unit}{pieces}}}"
    rests_on = [NOT_PROVED] if path.suffix.lower() in SURFACES else []
    if arguments.json:
        measures = {"margin": found.margin, "protrusion": found.protrusion, "volume": found.volume}
        print_json(
            {
                "line": line,
                "pieces": len(found.vertices),
                **measures,
                "of_pieces": found.of_pieces,
                "not_proved": rests_on,
            }
        )
    else:
        sys.stdout.write("\n# ".join([line, found.sentence, *rests_on]) + "\n")
    return 0


def _name_of(path: Path, other: str) -> str:
    return _NO_NAME.sub("_", path.stem).strip("_-0123456789")[:60] or other


def _run_cloud(path: Path, arguments: argparse.Namespace) -> int:
    """Print the line of a point cloud or height map, and what its boxes cost."""
    entry = {"name": _name_of(path, "cloud"), "cloud": path.name, "unit": arguments.unit}
    if arguments.margin is None:
        raise InputError(
            "say how far from its points the surface may lie, in m: --margin 0.01 "
            "(half the distance between points, and the sensor's noise)"
        )
    entry["margin"] = f"{arguments.margin:g}"
    if arguments.voxel != point_cloud.VOXEL:
        entry["voxel"] = f"{arguments.voxel:g}"
    if arguments.pitch is not None:
        entry["pitch"] = f"{arguments.pitch:g}"
    text = ", ".join(f"{key}: {value}" for key, value in entry.items())
    with sentences():
        table = read_items(f"{{{text}}}", path.name, CellFileError).table(tuple(entry))
        boxes = point_cloud.CloudReader(path.parent).read(table)
    if arguments.json:
        print_json(
            {
                "line": f"- {{{text}}}",
                "boxes": len(boxes.lower),
                "protrusion": boxes.protrusion,
                "notes": list(boxes.notes),
            }
        )
        return 0
    notes = "".join(f"# {note}\n" for note in boxes.notes)
    sys.stdout.write(f"- {{{text}}}\n# {boxes.sentence}\n{notes}")
    return 0


def _pieces(text: str) -> int:
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= PIECES_MAX):
        raise argparse.ArgumentTypeError(f"{text[:60]!r} must be a whole number 1 .. {PIECES_MAX}")
    return int(text)
