"""A closed mesh as convex pieces that contain it, and what that costs in distance and volume.

CoACD divides the mesh, in a process of its own. How far the pieces stick out is bounded, not
sampled.
"""

from __future__ import annotations

import io
import resource
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError, cKDTree

from ir_description.files.stl_mesh import HULL_VERTICES_MAX, TRIANGLES_MAX, open_edges
from ir_values.arrays import BoolArray, FloatArray, IntArray
from ir_values.errors import InvalidValueError

# How far convex pieces stick out of the solid that they stand for: a bound, not a sample.
# A triangle of a piece's surface is at most as far from the solid as its centre is, and its own
# radius more, and no farther from a triangle of the solid than its corners are; one whose centre
# is deeper inside than its radius does not stick out at all. Those that could be the worst are cut
# until the bound is near what was found.

NEAR = 1.1
"""The bound is at most this many times the largest distance found, plus SHARE of the size."""
SHARE = 0.01
_WORK = 100_000_000  # points times triangles
_POINTS = 40_000
_ROUNDS = 24
_SAMPLES = 60_000  # of the mesh's surface: where its nearest triangles are looked for
_NEIGHBOURS = 4
_CHUNK = 2_000_000
_BLOCK = 4096  # points whose distances are found at once


def protrusion(pieces: Sequence[FloatArray], triangles: FloatArray) -> float:
    """A bound [m] of the distance from the pieces (V, 3) to the solid in a closed mesh (T, 3,
    3).
    """
    solid = _Solid(triangles)
    left = np.concatenate([piece[ConvexHull(piece).simplices] for piece in pieces])
    points = triangles.reshape(-1, 3)
    size = float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))
    found = 0.0
    bound = 0.0
    looked = 0
    most = min(_POINTS, _WORK // len(triangles))
    for _ in range(_ROUNDS):
        distance, worst = solid.distances(left)
        looked += len(left)
        found = max(found, float(distance.max(initial=0.0)))
        target = NEAR * found + SHARE * size
        open_ = worst > target
        bound = max(bound, float(worst[~open_].max(initial=0.0)))
        if not open_.any() or looked > most:
            return max(bound, float(worst.max(initial=0.0)))
        left = halved(left[open_])
    return max(bound, float(worst.max()))


class _Solid:
    """A closed mesh (T, 3, 3): distances to it, and what lies inside."""

    def __init__(self, triangles: FloatArray) -> None:
        self._triangles = triangles
        parts = triangles
        owner = np.arange(len(triangles))
        while 2 * len(parts) < _SAMPLES:
            long = _longest(parts) >= np.quantile(_longest(parts), 0.5)
            parts = np.concatenate([parts[~long], halved(parts[long])])
            owner = np.concatenate([owner[~long], np.tile(owner[long], 2)])
        self._owner: IntArray = owner
        centres = parts.mean(axis=1)
        self._step = float(np.linalg.norm(parts - centres[:, None], axis=2).max())
        self._tree = cKDTree(centres)

    def distances(self, parts: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Of triangles (N, 3, 3): bounds of the distance to the solid, of the centres and of all
        (N,).
        """
        centres = parts.mean(axis=1)
        radius = np.linalg.norm(parts - centres[:, None], axis=2).max(axis=1)
        samples, nearest = self._tree.query(centres, k=_NEIGHBOURS)
        there = self._triangles[self._owner[nearest]]
        inside = winding(self._triangles, centres) > 0.5
        candidates = range(_NEIGHBOURS)
        to_mesh = np.min([point_triangle(centres, there[:, k]) for k in candidates], axis=0)
        distance = np.where(inside, 0.0, to_mesh)
        # the distance to a triangle is convex: over another one it is largest in a corner
        corners = [[point_triangle(parts[:, c], there[:, k]) for c in range(3)] for k in candidates]
        worst = np.minimum(distance + radius, np.max(corners, axis=1).min(axis=0))
        deep = inside & (np.asarray(samples)[:, 0] - self._step >= radius)
        return distance, np.where(deep, 0.0, worst)


def winding(triangles: FloatArray, points: FloatArray) -> FloatArray:
    """How often a closed mesh (T, 3, 3) winds about each point (N, 3): 1 inside, 0 outside.

    The sum of the solid angles of all triangles (Van Oosterom and Strackee, 1983), in chunks that
    bound the memory.
    """
    found = np.zeros(len(points))
    size = max(1, _CHUNK // len(triangles))
    for k in range(0, len(points), size):
        seen_from = points[k : k + size, None]
        a = triangles[None, :, 0] - seen_from
        b = triangles[None, :, 1] - seen_from
        c = triangles[None, :, 2] - seen_from
        la = np.linalg.norm(a, axis=2)
        lb = np.linalg.norm(b, axis=2)
        lc = np.linalg.norm(c, axis=2)
        above = np.einsum("nti,nti->nt", a, np.cross(b, c))
        below = la * lb * lc + (a * b).sum(2) * lc + (b * c).sum(2) * la + (c * a).sum(2) * lb
        found[k : k + size] = np.arctan2(above, below).sum(axis=1) / (2.0 * np.pi)
    return found


def halved(triangles: FloatArray) -> FloatArray:
    """Two triangles (2 T, 3, 3) instead of each, by the middle of its longest edge; first halves
    first.
    """
    edges = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
    rows = np.arange(len(triangles))
    at = edges.argmax(axis=1)
    a, b, c = (triangles[rows, (at + k) % 3] for k in range(3))
    middle = (a + b) / 2.0
    return np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])


def _longest(triangles: FloatArray) -> FloatArray:
    longest: FloatArray = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2).max(
        axis=1
    )
    return longest


def point_triangle(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Distance (N,) of each point (N, 3) from its triangle (N, 3, 3), also of one without area."""
    found = np.empty(len(points))
    for k in range(0, len(points), _BLOCK):
        found[k : k + _BLOCK] = _from_triangles(points[k : k + _BLOCK], triangles[k : k + _BLOCK])
    return found


def _from_triangles(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """The same of few enough that what is in between stays in the processor's cache."""
    a, b, c = np.ascontiguousarray(triangles.reshape(-1, 9).T).reshape(3, 3, -1)
    at = np.ascontiguousarray(points.T)
    ends = ((a, b), (b, c), (c, a))
    sides = [(q - p, at - p) for p, q in ends]
    edge = np.min([_squared_distances(*side) for side in sides], axis=0)
    normal = _cross(b - a, c - a)
    square = _dot(normal, normal)
    above = square > 0.0
    for side in sides:
        above &= _dot(_cross(*side), normal) >= 0.0
    height = _dot(at - a, normal)
    nearest: FloatArray = np.sqrt(
        np.where(above, height * height / np.where(above, square, 1.0), edge)
    )
    return nearest


def _squared_distances(along: FloatArray, at: FloatArray) -> FloatArray:
    """Square of the distance (N,) of points at (3, N) from edges (3, N) that begin at 0."""
    square = _dot(along, along)
    share = _dot(along, at) / np.where(square == 0.0, 1.0, square)
    apart = at - np.clip(share, 0.0, 1.0) * along
    return _dot(apart, apart)


def _dot(first: FloatArray, second: FloatArray) -> FloatArray:
    product: FloatArray = first[0] * second[0] + first[1] * second[1] + first[2] * second[2]
    return product


def _cross(first: FloatArray, second: FloatArray) -> FloatArray:
    return np.stack(
        [
            first[1] * second[2] - first[2] * second[1],
            first[2] * second[0] - first[0] * second[2],
            first[0] * second[1] - first[1] * second[0],
        ]
    )


# CoACD in a process of its own: it is native code that hostile meshes can crash, and it takes its
# time. The seed is fixed: the same mesh gives the same pieces.

MISSING = (
    'a mesh is divided by coacd, which is missing: pip install "ir_description[cad]", or '
    "pip install coacd"
)
CONCAVITY = 0.03
"""Concavity at which a piece is not divided any more, as a share of the mesh's size."""
PROCESSOR_SECONDS = 600
MEMORY_BYTES = 6_000_000_000
PROGRAM = f"from {__name__} import main; main()"
_SEED = 0
CORNERS = 64
"""Of a piece, at most."""


def decomposed(triangles: FloatArray, most: int, share: int = 1) -> list[FloatArray]:
    """Corners (V, 3) of at most `most` convex pieces of a closed mesh (T, 3, 3), in one of `share`
    parts of PROCESSOR_SECONDS. Raises InvalidValueError.
    """
    if find_spec("coacd") is None:
        raise InvalidValueError(MISSING)
    corners, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    stream = io.BytesIO()
    faces = index.reshape(-1, 3).astype(np.int32)
    seconds = max(PROCESSOR_SECONDS // share, 1)
    np.savez(stream, corners=corners, faces=faces, most=most, seconds=seconds)
    process = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        input=stream.getvalue(),
        capture_output=True,
    )
    if process.returncode != 0:
        last = process.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise InvalidValueError(
            f"the mesh can't be divided into convex pieces (code {process.returncode}: "
            f"{''.join(last)[:120]})"
        )
    with np.load(io.BytesIO(process.stdout), allow_pickle=False) as found:
        pieces = [np.asarray(found[key], dtype=np.float64) for key in found.files]
    if not pieces:
        raise InvalidValueError("the mesh can't be divided into convex pieces: there are none")
    return pieces


def main() -> None:
    """Read a mesh from standard input, and write its pieces to standard output."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    import coacd

    with np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False) as given:
        mesh = coacd.Mesh(given["corners"], given["faces"])
        most = int(given["most"])
        seconds = int(given["seconds"])
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    coacd.set_log_level("error")
    found = coacd.run_coacd(
        mesh,
        threshold=CONCAVITY,
        max_convex_hull=most,
        preprocess_mode="off",
        max_ch_vertex=CORNERS,
        seed=_SEED,
    )
    stream = io.BytesIO()
    np.savez(stream, **{f"piece_{k:04d}": corners for k, (corners, _) in enumerate(found)})
    sys.stdout.buffer.write(stream.getvalue())


SIMPLE = 50_000
"""Triangles that a mesh of more than TRIANGLES_MAX is simplified to before it is divided."""
SIMPLIFY = f"from {__name__} import simplify; simplify()"
_FINE = 0.01  # of a mesh's size, between points at which two surfaces are compared


def simplified(triangles: FloatArray) -> FloatArray:
    """About SIMPLE triangles (T, 3, 3) near a closed mesh, in a process of its own. Raises
    InvalidValueError.
    """
    if find_spec("fast_simplification") is None:
        raise InvalidValueError(
            f"the mesh has {len(triangles)} triangles; from {TRIANGLES_MAX} on it is simplified by "
            'fast-simplification, which is missing: pip install "ir_description[cad]", or export '
            "it coarser: chords of about 1 mm are enough"
        )
    corners, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    stream = io.BytesIO()
    np.savez(stream, corners=corners, faces=index.reshape(-1, 3).astype(np.int32), most=SIMPLE)
    process = subprocess.run(
        [sys.executable, "-c", SIMPLIFY], input=stream.getvalue(), capture_output=True
    )
    if process.returncode != 0:
        raise InvalidValueError(
            f"the mesh of {len(triangles)} triangles can't be simplified (code "
            f"{process.returncode}): export it coarser, chords of about 1 mm are enough"
        )
    with np.load(io.BytesIO(process.stdout), allow_pickle=False) as found:
        result: FloatArray = np.asarray(found["corners"], dtype=np.float64)[found["faces"]]
    return result


def simplify() -> None:
    """Read a mesh from standard input, and write one of fewer triangles to standard output."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (PROCESSOR_SECONDS, PROCESSOR_SECONDS))
    import fast_simplification

    with np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False) as given:
        corners, faces = fast_simplification.simplify(
            given["corners"], given["faces"], target_count=int(given["most"])
        )
    stream = io.BytesIO()
    np.savez(stream, corners=corners, faces=faces)
    sys.stdout.buffer.write(stream.getvalue())


def _distance_bound(first: FloatArray, second: FloatArray) -> float:
    """A bound [m] of the distance of any point of a surface (T, 3, 3) from another one."""
    points = second.reshape(-1, 3)
    step = _FINE * float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))
    own = fine_triangles(first, step)
    centres = own.mean(axis=1)
    radius = np.linalg.norm(own - centres[:, None], axis=2).max(axis=1)
    distance, _ = cKDTree(fine_triangles(second, step).mean(axis=1)).query(centres)
    return float((distance + radius).max())


def fine_triangles(triangles: FloatArray, step: float) -> FloatArray:
    """The same surface in triangles (T, 3, 3) without an edge longer than step [m]."""
    long = _longest(triangles) > step
    while long.any():
        triangles = np.concatenate([triangles[~long], halved(triangles[long])])
        long = _longest(triangles) > step
    return triangles


MARGINS = (0.0005, 0.001, 0.002, 0.004, 0.008, 0.016)
"""Metres by which pieces are widened; the first is taken with which they contain the mesh."""
_WIDENED = np.sqrt(3.0) * np.concatenate([np.eye(3), -np.eye(3)])
"""Corners of an octahedron that contains the unit ball."""
_AROUND = 200
_FLAT = 20
"""Directions of the faces of a piece that would have too many corners, and of its flattest ones."""
_CUTS = 16
_CONVEX = 1e-6  # of its volume that a shell's hull may have more
_TRIANGLES = 100_000  # that are looked at in one cut


@dataclass(frozen=True, eq=False)
class ConvexPieces:
    """vertices: corners (V, 3) [m] of each piece. margin [m]: by which they were widened at least,
    to contain the mesh, and what may be beside it. protrusion [m]: a bound of the distance from any
    point of them to the solid. volume, of_pieces [m^3]: of the solid, and of the pieces, what
    several of them share counted for each. simplified: triangles of a mesh that was divided as one
    of fewer, 0: as it is.
    """

    vertices: tuple[FloatArray, ...]
    margin: float
    protrusion: float
    volume: float
    of_pieces: float
    simplified: int = 0

    @property
    def sentence(self) -> str:
        """For people."""
        more = 100.0 * (self.of_pieces / self.volume - 1.0)
        whole = f" with all of its {self.simplified} triangles" if self.simplified else ""
        return (
            f"{len(self.vertices)} convex pieces contain it{whole}, widened by "
            f"{1e3 * self.margin:g} mm: they protrude by at most {1e3 * self.protrusion:.1f} mm, "
            f"their volume is {more:+.1f} % of its {self.volume:.4g} m^3"
        )


def convex_pieces(triangles: FloatArray, most: int, error: float = 0.0) -> ConvexPieces:
    """At most `most` pieces that contain all within `error` [m] of a mesh (T, 3, 3) [m]. Raises
    InvalidValueError with the reason.
    """
    whole = triangles[np.linalg.norm(_normals(triangles), axis=1) > 0.0]
    _check_closed(whole)
    solid = whole
    beside = error
    if len(whole) > TRIANGLES_MAX:
        solid = simplified(whole)
        solid = solid[np.linalg.norm(_normals(solid), axis=1) > 0.0]
        _check_closed(solid)
        beside += _distance_bound(solid, whole)
    raw = [_sorted(piece) for piece in _divided(solid, most)]
    for margin in MARGINS:
        if contains([_widened(piece, margin) for piece in raw], whole):
            pieces = [_widened(piece, margin + error) for piece in raw]
            bound = protrusion(pieces, solid) + beside
            total = sum(float(ConvexHull(piece).volume) for piece in pieces)
            count = len(whole) if len(whole) > len(solid) else 0
            return ConvexPieces(tuple(pieces), margin + error, bound, _volume(whole), total, count)
    raise InvalidValueError(
        f"its convex pieces leave out more than {1e3 * MARGINS[-1]:g} mm of it: "
        "give more pieces, or a simpler mesh"
    )


def _volume(triangles: FloatArray) -> float:
    return float(np.linalg.det(triangles).sum()) / 6.0


def _check_closed(triangles: FloatArray) -> None:
    """Raise InvalidValueError for a mesh (T, 3, 3) that encloses no volume."""
    wrong = open_edges(triangles)
    if not len(triangles) or len(wrong):
        where = f"{len(wrong)} edges, one at {_place(wrong[0])} m" if len(wrong) else "no triangles"
        raise InvalidValueError(
            f"the mesh is not closed ({where}; each must belong to exactly two triangles that "
            "agree which side is outside): close it in CAD or with trimesh.repair (docs/cad.md, "
            "Repair), or take kind: mesh with convex_hull: true"
        )
    if _volume(triangles) <= 0.0:
        raise InvalidValueError(
            f"the mesh has {_volume(triangles):.3g} m^3: its triangles must be seen from outside"
        )


def _divided(triangles: FloatArray, most: int) -> list[FloatArray]:
    """Corners (V, 3) of at most `most` pieces of a closed mesh (T, 3, 3). Each of its shells is
    divided by itself, unless one is a hollow: CoACD takes minutes for shells that touch; a convex
    one is a piece.
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
    """Corners (V, 3) of a shell (T, 3, 3) that is convex; None for others."""
    points = _sorted(shell.reshape(-1, 3))
    try:
        hull = ConvexHull(points)
    except QhullError:
        return None
    volume = float(np.linalg.det(shell).sum()) / 6.0
    convex = float(hull.volume) <= (1.0 + _CONVEX) * volume
    return points[hull.vertices] if convex else None


def _place(point: FloatArray) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in point + 0.0) + ")"


def contains(pieces: Sequence[FloatArray], triangles: FloatArray) -> bool:
    """Whether every point of the triangles (T, 3, 3) is proved to lie in the hull of a piece (V,
    3).
    """
    planes = [ConvexHull(piece).equations for piece in pieces]
    left = triangles
    for _ in range(_CUTS):
        parts = np.array_split(left, len(left) // _TRIANGLES + 1)
        left = np.concatenate([part[~_inside(planes, part)] for part in parts])
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
    return corners if len(corners) <= HULL_VERTICES_MAX else _with_few_faces(corners)


def _with_few_faces(piece: FloatArray) -> FloatArray:
    """Corners (V, 3) of a convex body with few faces around a piece (V, 3) with many: tangent to it
    where it is flattest, and all around.
    """
    hull = ConvexHull(piece)
    a = piece[hull.simplices[:, 0]]
    b = piece[hull.simplices[:, 1]]
    c = piece[hull.simplices[:, 2]]
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    flattest = hull.equations[np.argsort(-area, kind="stable")[:_FLAT], :3]

    # directions spread evenly over a sphere: a spiral by the golden angle
    k = np.arange(_AROUND) + 0.5
    height = 1.0 - 2.0 * k / _AROUND
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - height**2)
    around = np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=1)
    normals = np.unique(np.concatenate([np.eye(3), -np.eye(3), flattest, around]), axis=0)
    offsets = (piece @ normals.T).max(axis=0)
    planes = np.column_stack([normals, -offsets])
    points = HalfspaceIntersection(planes, piece.mean(axis=0)).intersections
    corners = _sorted(points[ConvexHull(points).vertices])
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
