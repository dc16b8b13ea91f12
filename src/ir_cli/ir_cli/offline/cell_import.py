"""`ir cell import`: a mesh from CAD as the line of a cell file, with what its pieces cost, or a
world.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from ir_description.files.solid_mesh import PIECES, PIECES_MAX, UNITS, SolidReader, pieces_of

from ..errors import InputError
from .asking import sentences
from .cell_worlds import WORLDS, run_world
from .output import print_json

_NO_NAME = re.compile(r"[^A-Za-z0-9_-]+")


def add_import(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add cell import."""
    command = verbs.add_parser(
        "import", help="a mesh from CAD as a line to paste, or a world as a cell"
    )
    command.add_argument(
        "file", metavar="FILE", help="a mesh: .stl, .obj, .glb, .gltf; a world: .sdf, .urdf"
    )
    command.add_argument("--unit", choices=tuple(UNITS), help="of a mesh; never guessed")
    command.add_argument(
        "--pieces", type=_pieces, default=PIECES, help=f"at most so many ({PIECES})"
    )
    command.add_argument(
        "--robot", default="kr210_r2700_extra", metavar="ROBOT", help="of a world's cell"
    )
    command.add_argument("--json", action="store_true", help="print the answer as JSON")
    command.set_defaults(run=run_import)


def run_import(arguments: argparse.Namespace) -> int:
    """Divide the mesh and print its line, or print the cell of a world."""
    path = Path(arguments.file)
    if path.suffix.lower() in WORLDS:
        return run_world(path, arguments.robot)
    if arguments.unit is None:
        raise InputError(f"say the unit of {path.name[:60]!a}: --unit {' or '.join(UNITS)}")
    with sentences():
        triangles = SolidReader(path.parent).triangles(path.name, arguments.unit)
        found = pieces_of(triangles, arguments.pieces)
    name = _NO_NAME.sub("_", path.stem).strip("_-0123456789")[:60] or "mesh"
    pieces = "" if arguments.pieces == PIECES else f", pieces: {arguments.pieces}"
    line = f"- {{name: {name}, mesh: {path.name}, unit: {arguments.unit}{pieces}}}"
    if arguments.json:
        measures = {"margin": found.margin, "protrusion": found.protrusion, "volume": found.volume}
        print_json(
            {"line": line, "pieces": len(found.vertices), **measures, "of_pieces": found.of_pieces}
        )
    else:
        sys.stdout.write(f"{line}\n# {found.sentence}\n")
    return 0


def _pieces(text: str) -> int:
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= PIECES_MAX):
        raise argparse.ArgumentTypeError(f"{text[:60]!r} must be a whole number 1 .. {PIECES_MAX}")
    return int(text)
