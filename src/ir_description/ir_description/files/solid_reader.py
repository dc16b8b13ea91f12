"""Reads `mesh: press.stl` of a cell file: a mesh from CAD, as the convex pieces that contain it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ir_description.files.items import Table
from ir_description.files.mesh import CELL_TRIANGLES_MAX
from ir_description.files.piece_cache import pieces_of
from ir_description.files.solid_mesh import UNITS, read_solid
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.errors import InvalidValueError

PIECES = 32
"""Pieces of a mesh, unless its entry says otherwise."""
PIECES_MAX = 200
SIZE_MAX = 100.0
"""Farthest corner [m] of a mesh from its origin: beyond, the unit is hardly meant."""


class SolidReader:
    """Reads the meshes of one cell; those that it names twice once."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._triangles = 0
        self._known: dict[tuple[str, str, int], tuple[FloatArray, ...]] = {}

    def read(self, table: Table) -> tuple[FloatArray, ...]:
        """Return the corners (V, 3) [m] of each piece of the mesh that an entry describes."""
        name = table["mesh"].text()
        unit = table["unit"].choice(tuple(UNITS))
        most = table["pieces"].integer(1, PIECES_MAX) if "pieces" in table else PIECES
        with table["mesh"].blamed():
            if (name, unit, most) not in self._known:
                self._known[name, unit, most] = pieces_of(self.triangles(name, unit), most).vertices
            return self._known[name, unit, most]

    def triangles(self, name: str, unit: str) -> FloatArray:
        """Return the triangles (T, 3, 3) [m] of a mesh file. Raises InvalidValueError."""
        if self._folder is None:
            raise InvalidValueError("a mesh file can be named only in a cell file, this is a text")
        triangles = read_solid(self._folder, name).triangles * UNITS[unit]
        self._triangles += len(triangles)
        if self._triangles > CELL_TRIANGLES_MAX:
            raise InvalidValueError(
                f"the cell's mesh files have {self._triangles} triangles so far, "
                f"must have at most {CELL_TRIANGLES_MAX} together"
            )
        reach = float(np.abs(triangles).max())
        if reach > SIZE_MAX:
            raise InvalidValueError(
                f"the mesh reaches {reach:g} m in {unit}, must stay within {SIZE_MAX:g} m: "
                "is its unit another?"
            )
        return triangles


def piece_names(name: str, count: int) -> tuple[str, ...]:
    """Names of the bodies that stand for a mesh: its own where it is one, else name.1, name.2 and
    so on.
    """
    return (name,) if count == 1 else tuple(f"{name}.{k}" for k in range(1, count + 1))
