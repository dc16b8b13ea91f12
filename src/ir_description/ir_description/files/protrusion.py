"""How far convex pieces stick out of the solid that they stand for: a bound, not a sample.

A triangle of a piece's surface is at most as far from the solid as its centre is, and its own
radius more, and no farther from a triangle of the solid than its corners are; one whose centre is
deeper inside than its radius does not stick out at all. Those that could be the worst are cut until
the bound is near what was found.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull, cKDTree

from ir_msgs_py.arrays import FloatArray, IntArray

NEAR = 1.1
"""The bound is at most this many times the largest distance found, plus SHARE of the size."""
SHARE = 0.01
_WORK = 100_000_000  # points times triangles
_POINTS = 40_000
_ROUNDS = 24
_SAMPLES = 60_000  # of the mesh's surface: where its nearest triangles are looked for
_NEIGHBOURS = 4
_CHUNK = 2_000_000


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
        to_mesh = np.min([_point_triangle(centres, there[:, k]) for k in candidates], axis=0)
        distance = np.where(inside, 0.0, to_mesh)
        # the distance to a triangle is convex: over another one it is largest in a corner
        corners = [
            [_point_triangle(parts[:, c], there[:, k]) for c in range(3)] for k in candidates
        ]
        worst = np.minimum(distance + radius, np.max(corners, axis=1).min(axis=0))
        deep = inside & (np.asarray(samples)[:, 0] - self._step >= radius)
        return distance, np.where(deep, 0.0, worst)


def winding(triangles: FloatArray, points: FloatArray) -> FloatArray:
    """How often a closed mesh (T, 3, 3) winds about each point (N, 3): 1 inside, 0 outside."""
    found = np.zeros(len(points))
    size = max(1, _CHUNK // len(triangles))
    for k in range(0, len(points), size):
        a, b, c = (triangles[None, :, i] - points[k : k + size, None] for i in range(3))
        la, lb, lc = (np.linalg.norm(each, axis=2) for each in (a, b, c))
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


def _point_triangle(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Distance (N,) of each point (N, 3) from its triangle (N, 3, 3)."""
    a = triangles[:, 0]
    b = triangles[:, 1]
    c = triangles[:, 2]
    found = np.min([_point_segment(points, *ends) for ends in ((a, b), (b, c), (c, a))], axis=0)
    normal = np.cross(b - a, c - a)
    height = np.einsum("ni,ni->n", points - a, normal)
    square = np.einsum("ni,ni->n", normal, normal)
    foot = points - (height / square)[:, None] * normal
    sides = [
        np.einsum("ni,ni->n", np.cross(q - p, foot - p), normal) >= 0.0
        for p, q in ((a, b), (b, c), (c, a))
    ]
    nearest: FloatArray = np.where(np.all(sides, axis=0), np.abs(height) / np.sqrt(square), found)
    return nearest


def _point_segment(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    along = end - start
    share = np.einsum("ni,ni->n", points - start, along) / np.einsum("ni,ni->n", along, along)
    distance: FloatArray = np.linalg.norm(
        points - (start + np.clip(share, 0.0, 1.0)[:, None] * along), axis=1
    )
    return distance
