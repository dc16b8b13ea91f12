"""Convex meshes from STL files, binary and ASCII."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ir_values.arrays import FloatArray, frozen, number_of
from ir_values.errors import InvalidValueError, shown
from ir_values.files import read_regular_file

if TYPE_CHECKING:
    from scipy.spatial import ConvexHull

BYTES_MAX = 120_000_000
TRIANGLES_MAX = 200_000
READ_MAX = 2_000_000
"""Triangles of a mesh that is simplified after it was read."""
HULL_VERTICES_MAX = 1_000
CORNERS_MAX = 50_000
"""Corners of all meshes of a cell together: each is compared with the robot, drawn and
published.
"""
CELL_TRIANGLES_MAX = 1_000_000
"""Triangles of all mesh files of a cell together."""
CONVEX_TOLERANCE = 1e-3
"""A mesh whose volume is this share below its hull's still counts as convex (tessellation,
rounding).
"""

_BINARY = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")


def mesh_path(folder: Path, name: str, suffixes: tuple[str, ...] = (".stl",)) -> Path:
    """Return the path of a mesh inside the folder of its cell file; nothing leads out of it. Raises
    InvalidValueError for another place or ending.
    """
    path = Path(name)
    refuse_surfaces(path)
    if (
        "://" in name
        or "\\" in name
        or path.is_absolute()
        or ".." in path.parts
        or path.suffix.lower() not in suffixes
    ):
        raise InvalidValueError(
            f"mesh file {shown(name)} must be an {' or '.join(suffixes)} file in the cell file's "
            "folder, named relative to it, without '..'"
        )
    resolved = (folder / path).resolve()
    if not resolved.is_relative_to(folder.resolve()):
        raise InvalidValueError(f"mesh file {shown(name)} leads out of the cell file's folder")
    return resolved


SURFACES = (".sat", ".x_t", ".x_b", ".prt", ".sldprt", ".catpart", ".ipt", ".f3d", ".3dm", ".dwg")
"""Files of CAD systems that only these read."""


def refuse_surfaces(path: Path) -> None:
    """Raise InvalidValueError for a file that only a CAD system reads."""
    if path.suffix.lower() in SURFACES:
        raise InvalidValueError(
            f"mesh file {shown(path.name)} is read by its CAD system only: export it from there as "
            ".step, or as .stl, .obj or .glb with chords of about 1 mm"
        )


def check_triangles(count: int, most: int = TRIANGLES_MAX) -> None:
    """Raise InvalidValueError for a mesh of too few or too many triangles."""
    if not 4 <= count <= most:
        remedy = "; export it coarser: chords of about 1 mm are enough" if count > most else ""
        raise InvalidValueError(f"the mesh has {count} triangles, must have 4 to {most}{remedy}")


def read_stl(path: Path) -> FloatArray:
    """Return the triangles (T, 3, 3) of an STL file in its own unit."""
    return triangles_from_stl(read_regular_file(path, BYTES_MAX))


def triangles_from_stl(content: bytes, most: int = TRIANGLES_MAX) -> FloatArray:
    """Return the triangles (T, 3, 3) of STL content, at most so many; binary where the length fits,
    else ASCII.
    """
    count = int.from_bytes(content[80:84], "little") if len(content) >= 84 else -1
    if len(content) == 84 + 50 * count:
        triangles = np.frombuffer(content, dtype=_BINARY, offset=84)["corners"].astype(np.float64)
    else:
        triangles = _ascii_triangles(content)
    check_triangles(len(triangles), most)
    return frozen(triangles, (None, 3, 3), "mesh")


def _ascii_triangles(content: bytes) -> FloatArray:
    if not content.lstrip().startswith(b"solid"):
        raise InvalidValueError(
            "the file is neither a binary STL (its length does not fit) nor an ASCII one"
        )
    if not content.rstrip().rpartition(b"\n")[2].lstrip().startswith(b"endsolid"):
        raise InvalidValueError("the ASCII STL does not end with endsolid: was it cut?")
    found = _VERTEX.findall(content)
    if len(found) % 3:
        raise InvalidValueError(
            f"the ASCII STL has {len(found)} vertices, must have three to a triangle"
        )
    try:
        numbers = [number_of(word.decode("latin-1")) for vertex in found for word in vertex]
        return np.array(numbers, dtype=np.float64).reshape(-1, 3, 3)
    except ValueError as error:
        raise InvalidValueError("the ASCII STL has a vertex that is not three numbers") from error


def hull_vertices(points: FloatArray) -> FloatArray:
    """Return the corners (V, 3) of the convex hull of points (N, 3)."""
    return _points_of(_hull(points), points)


def convex_vertices(triangles: FloatArray, take_hull: bool) -> FloatArray:
    """Return the corners (V, 3) of a convex mesh (T, 3, 3); others are refused unless
    `take_hull`.
    """
    points = np.unique(triangles.reshape(-1, 3), axis=0)
    hull = _hull(points)
    volume = abs(float(np.linalg.det(triangles).sum()) / 6.0)
    if not take_hull and not is_closed(triangles):
        raise InvalidValueError(
            "the mesh is not closed (an edge does not belong to exactly two triangles); "
            "say convex_hull: true to use its hull"
        )
    if not take_hull and volume < (1.0 - CONVEX_TOLERANCE) * hull.volume:
        raise InvalidValueError(
            f"the mesh is not convex (volume {volume:.4g} m^3, its hull {hull.volume:.4g} m^3); "
            "split it into convex meshes or say convex_hull: true to use its hull"
        )
    return _points_of(hull, points)


def _hull(points: FloatArray) -> ConvexHull:
    from scipy.spatial import ConvexHull, QhullError

    if not np.isfinite(points).all():
        raise InvalidValueError("the mesh has corners that are not finite")
    try:
        return ConvexHull(points)
    except (QhullError, ValueError) as error:
        raise InvalidValueError(
            f"the mesh has {len(points)} corners that span no volume"
        ) from error


def _points_of(hull: ConvexHull, points: FloatArray) -> FloatArray:
    corners = points[np.sort(hull.vertices)]
    if len(corners) > HULL_VERTICES_MAX:
        raise InvalidValueError(
            f"the hull has {len(corners)} corners, must have at most {HULL_VERTICES_MAX}"
        )
    return frozen(corners, (None, 3), "vertices")


def is_closed(triangles: FloatArray) -> bool:
    """Whether every edge of a mesh (T, 3, 3) is walked once in each direction."""
    return not len(open_edges(triangles))


def open_edges(triangles: FloatArray) -> FloatArray:
    """The middles (E, 3) of the edges that are not walked once in each direction."""
    points, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    corners = index.reshape(-1, 3)
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    ends, which = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    upwards = edges[:, 0] < edges[:, 1]
    there, back = (np.bincount(which.ravel(), walked, len(ends)) for walked in (upwards, ~upwards))
    wrong = (there != 1) | (back != 1)
    return np.asarray(points[ends[wrong]].mean(axis=1))
