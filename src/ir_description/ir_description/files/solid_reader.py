"""The entry `mesh: press.stl` of a cell file: a closed mesh from CAD, as the convex pieces that
contain it.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ir_description.files.curved_surfaces import KINDS as SURFACES
from ir_description.files.piece_cache import pieces_of
from ir_description.files.solid_mesh import read_solid
from ir_description.files.stl_mesh import CELL_TRIANGLES_MAX, TRIANGLES_MAX
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError, listed, shown
from ir_values.yaml_items import Table

if TYPE_CHECKING:  # only cells with solids pay for the division of meshes
    from ir_description.files.convex_pieces import ConvexPieces

UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "inch": 0.0254}
"""Metres of each unit; no file says its own reliably, so whoever names one does."""
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
        unit = table["unit"].choice(tuple(UNITS)) if "unit" in table else ""
        most = table["pieces"].integer(1, PIECES_MAX) if "pieces" in table else PIECES
        with table["mesh"].blamed():
            if (name, unit, most) not in self._known:
                self._known[name, unit, most] = self.pieces(name, unit, most).vertices
            return self._known[name, unit, most]

    def pieces(self, name: str, unit: str, most: int) -> ConvexPieces:
        """Return the pieces of a mesh file; unit: "" of a file that says its own. Raises
        InvalidValueError.
        """
        if self._folder is None:
            raise InvalidValueError("a mesh file can be named only in a cell file, this is a text")
        says_its_own = Path(name).suffix.lower() in SURFACES
        if says_its_own and unit:
            raise InvalidValueError(f"{shown(name)} says its unit itself: leave unit out")
        if not says_its_own and not unit:
            raise InvalidValueError(f"{shown(name)} has no unit: say one of {listed(UNITS)}")
        solid = read_solid(self._folder, name)
        triangles = solid.triangles * UNITS[unit or "m"]
        self._triangles += min(len(triangles), TRIANGLES_MAX)
        if self._triangles > CELL_TRIANGLES_MAX:
            raise InvalidValueError(
                f"the cell's mesh files have {self._triangles} triangles so far, "
                f"must have at most {CELL_TRIANGLES_MAX} together"
            )
        reach = float(np.abs(triangles).max())
        if reach > SIZE_MAX:
            raise InvalidValueError(
                f"the mesh reaches {reach:g} m in {unit or 'm'}, must stay within {SIZE_MAX:g} m: "
                "is its unit another?"
            )
        return pieces_of(triangles, most, solid.error)


def piece_names(name: str, count: int) -> tuple[str, ...]:
    """Names of the bodies that stand for a mesh: its own where it is one, else name.1, name.2 and
    so on.
    """
    return (name,) if count == 1 else tuple(f"{name}.{k}" for k in range(1, count + 1))
