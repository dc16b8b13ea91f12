"""A closed mesh as convex pieces that contain it, and what that costs in distance and volume.

Approximate convex decomposition (CoACD, Wei et al., 2022) gives pieces. They are widened by a
margin until
every point of the mesh lies in one of them, and that is proved: a triangle lies in a convex piece
where its corners do; one that lies in none is cut into four. So the pieces are never smaller than
the mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from ir_description.files.coacd_process import CORNERS, decomposed
from ir_description.files.mesh import HULL_VERTICES_MAX, open_edges
from ir_description.files.protrusion import protrusion
from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_msgs_py.errors import InvalidValueError

MARGINS = (0.0005, 0.001, 0.002, 0.004, 0.008, 0.016)
"""Metres by which pieces are widened; the first is taken with which they contain the mesh."""
_WIDENED = np.sqrt(3.0) * np.concatenate([np.eye(3), -np.eye(3)])
"""Corners of an octahedron that contains the unit ball."""
_CUTS = 16
_CONVEX = 1e-6  # of its volume that a shell's hull may have more
_TRIANGLES = 100_000  # that are looked at in one cut


@dataclass(frozen=True, eq=False)
class ConvexPieces:
    """vertices: corners (V, 3) [m] of each piece. margin [m]: by which they were widened at least,
    to contain the mesh. protrusion [m]: a bound of the distance from any point of them to the
    solid. volume, of_pieces [m^3]: of the solid, and of the pieces, what several of them share
    counted for each.
    """

    vertices: tuple[FloatArray, ...]
    margin: float
    protrusion: float
    volume: float
    of_pieces: float

    @property
    def sentence(self) -> str:
        """For people."""
        more = 100.0 * (self.of_pieces / self.volume - 1.0)
        return (
            f"{len(self.vertices)} convex pieces contain it, widened by {1e3 * self.margin:g} mm: "
            f"they protrude by at most {1e3 * self.protrusion:.1f} mm, "
            f"their volume is {more:+.1f} % of its {self.volume:.4g} m^3"
        )


def convex_pieces(triangles: FloatArray, most: int) -> ConvexPieces:
    """At most `most` pieces that contain a mesh (T, 3, 3) [m]. Raises InvalidValueError with the
    reason.
    """
    triangles = triangles[np.linalg.norm(_normals(triangles), axis=1) > 0.0]
    volume = float(np.linalg.det(triangles).sum()) / 6.0
    wrong = open_edges(triangles)
    if not len(triangles) or len(wrong):
        where = f"{len(wrong)} edges, one at {_place(wrong[0])} m" if len(wrong) else "no triangles"
        raise InvalidValueError(
            f"the mesh is not closed ({where}; each must belong to exactly two triangles that "
            "agree which side is outside): close it in CAD or with trimesh.repair (docs/cad.md, "
            "Repair), or take kind: mesh with convex_hull: true"
        )
    if volume <= 0.0:
        raise InvalidValueError(
            f"the mesh has {volume:.3g} m^3: its triangles must be seen from outside"
        )
    raw = [_sorted(piece) for piece in _divided(triangles, most)]
    for margin in MARGINS:
        pieces = [_widened(piece, margin) for piece in raw]
        if contains(pieces, triangles):
            bound = protrusion(pieces, triangles)
            total = sum(float(ConvexHull(piece).volume) for piece in pieces)
            return ConvexPieces(tuple(pieces), margin, bound, volume, total)
    raise InvalidValueError(
        f"its convex pieces leave out more than {1e3 * MARGINS[-1]:g} mm of it: "
        "give more pieces, or a simpler mesh"
    )


def _divided(triangles: FloatArray, most: int) -> list[FloatArray]:
    """Corners (V, 3) of at most `most` pieces of a closed mesh (T, 3, 3). Each of its shells is
    divided by
    itself, unless one is a hollow: CoACD takes minutes for shells that touch; a convex one is a
    piece.
    """
    shells = closed_shells(triangles)
    if len(shells) > most or any(np.linalg.det(shell).sum() <= 0.0 for shell in shells):
        return decomposed(triangles, most)
    hulls = [_hull_of_convex(shell) for shell in shells]
    pieces = [hull for hull in hulls if hull is not None]
    rest = [shell for shell, hull in zip(shells, hulls, strict=True) if hull is None]
    for k, shell in enumerate(rest):
        pieces += decomposed(shell, (most - len(pieces)) // (len(rest) - k), len(rest))
    return pieces


def closed_shells(triangles: FloatArray) -> list[FloatArray]:
    """The parts of a mesh (T, 3, 3) that share no corner, each (T, 3, 3), in the order of the
    mesh.
    """
    corners, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    faces = index.reshape(-1, 3)
    pairs = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(corners), len(corners)))
    shell = connected_components(graph, directed=False)[1][faces[:, 0]]
    order = dict.fromkeys(shell.tolist())
    return [triangles[shell == each] for each in order]


def _hull_of_convex(shell: FloatArray) -> FloatArray | None:
    """Corners (V, 3) of a shell (T, 3, 3) that is convex and has few of them; None for others."""
    points = _sorted(shell.reshape(-1, 3))
    try:
        hull = ConvexHull(points)
    except QhullError:
        return None
    volume = float(np.linalg.det(shell).sum()) / 6.0
    convex = float(hull.volume) <= (1.0 + _CONVEX) * volume
    return points[hull.vertices] if convex and len(hull.vertices) <= CORNERS else None


def _place(point: FloatArray) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in point + 0.0) + ")"


def contains(pieces: Sequence[FloatArray], triangles: FloatArray) -> bool:
    """Whether every point of the triangles (T, 3, 3) is proved to lie in the hull of a piece (V,
    3).
    """
    planes = [ConvexHull(piece).equations for piece in pieces]
    left = triangles
    for _ in range(_CUTS):
        left = left[~_inside(planes, left)]
        if not len(left):
            return True
        if len(left) > _TRIANGLES:
            return False
        left = _cut(left)
    return False


def _inside(planes: Sequence[FloatArray], triangles: FloatArray) -> BoolArray:
    """Whether each triangle (T, 3, 3) lies in one piece; planes (F, 4) of each piece as Qhull gives
    them.
    """
    found = np.zeros(len(triangles), dtype=bool)
    for faces in planes:
        open_ = np.flatnonzero(~found)
        if not len(open_):
            break
        corners = triangles[open_]
        near = (corners.reshape(-1, 3) @ faces[:, :3].T + faces[:, 3]).max(axis=1).reshape(-1, 3)
        found[open_] = near.max(axis=1) <= 0.0
    return found


def _cut(triangles: FloatArray) -> FloatArray:
    """Four triangles (4 T, 3, 3) instead of each, by the middles of its edges."""
    a = triangles[:, 0]
    b = triangles[:, 1]
    c = triangles[:, 2]
    ab = (a + b) / 2.0
    bc = (b + c) / 2.0
    ca = (c + a) / 2.0
    fours = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(four, axis=1) for four in fours])


def _widened(piece: FloatArray, margin: float) -> FloatArray:
    """Corners (V, 3) of a convex body that contains all within `margin` m of a piece (V, 3)."""
    try:
        points = (piece[:, None] + margin * _WIDENED).reshape(-1, 3)
        corners = _sorted(points[ConvexHull(points).vertices])
    except QhullError as error:
        raise InvalidValueError("one of its convex pieces is too thin") from error
    if len(corners) > HULL_VERTICES_MAX:
        raise InvalidValueError(
            f"one of its convex pieces has {len(corners)} corners, must have at most "
            f"{HULL_VERTICES_MAX}: a coarser mesh is enough for planning"
        )
    return corners


def _sorted(points: FloatArray) -> FloatArray:
    return np.unique(points, axis=0)


def _normals(triangles: FloatArray) -> FloatArray:
    a = triangles[:, 0]
    b = triangles[:, 1]
    c = triangles[:, 2]
    return np.cross(b - a, c - a)
