"""Capsules around points: as small as one axis allows, several where that pays, and a bound of how
far they stand out from what they enclose.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from ir_description.files.convex_pieces import halved, point_triangle
from ir_values.arrays import BoolArray, FloatArray, IntArray

MOST = 3
"""Capsules of a link, at most: each is compared with all others and with all machines."""
_CUTS = (0.2, 0.35, 0.5, 0.65, 0.8)  # of the length
_PAIRS = 0.05  # of the volume: what one capsule more must save to be worth its pairs
_GRID = 20  # points along each edge of the box in which volumes are compared
_FEW = 800  # triangles with which cuts are compared
_ROUNDS = 60  # of the circle around projected points: within 2 % of the smallest
_QUICK = 12  # the same while cuts are compared
_EDGE = 0.15  # of the size: longer triangles are cut before they are shared among capsules
_TRIANGLES = 60_000
_NEAREST = 6  # triangles of which one is taken for the nearest to a point
_CELLS = (12, 24)  # of a capsule's surface, along and around, before those that matter are halved
_HALVINGS = 4


class CapsuleFit(NamedTuple):
    """A capsule around points; overhang [m]: no point of it, where no other capsule of its link
    holds it, is farther from the enclosed surface.
    """

    p0: FloatArray
    p1: FloatArray
    radius: float
    overhang: float


def fitted(
    triangles: FloatArray, axis: FloatArray | None = None, most: int = MOST
) -> tuple[CapsuleFit, ...]:
    """Capsules that enclose triangles (T, 3, 3) together: one more, up to `most`, where that makes
    what they fill smaller by a twentieth.

    axis (3,): a direction that is tried beside the principal ones, as from one joint to the next.
    """
    fine = _cut(triangles)
    few = fine[:: max(1, len(fine) // _FEW)]
    measure = _Measure(few.reshape(-1, 3))
    labels = np.zeros(len(few), dtype=int)
    chosen = labels
    rough = [_best(few.reshape(-1, 3), axis, _QUICK)]
    least = measure.union(rough)
    while len(rough) < most:
        cuts = [(k, above) for k in range(len(rough)) for above in _cuts(few, labels == k)]
        tried = [_cut_capsules(few, labels, rough, cut, axis) for cut in cuts]
        if not tried:
            break
        sizes = [measure.union(fits) for fits in tried]
        best = int(np.argmin(sizes))
        labels = np.where(cuts[best][1], len(rough), labels)
        rough = tried[best]
        if sizes[best] * (1.0 + _PAIRS) ** (len(rough) - 1) < least:
            least = sizes[best] * (1.0 + _PAIRS) ** (len(rough) - 1)
            chosen = labels
    owner = chosen[cKDTree(few.mean(axis=1)).query(fine.mean(axis=1))[1]]
    parts = [fine[owner == k].reshape(-1, 3) for k in range(int(chosen.max()) + 1)]
    return with_overhang([_best(part, axis, _ROUNDS) for part in parts], triangles)


def with_overhang(fits: Sequence[CapsuleFit], triangles: FloatArray) -> tuple[CapsuleFit, ...]:
    """The capsules with bounds of how far they stand out from the triangles (T, 3, 3) that they
    enclose together.
    """
    surface = _Surface(triangles)
    return tuple(
        fit._replace(overhang=surface.overhang(fit, [*fits[:k], *fits[k + 1 :]]))
        for k, fit in enumerate(fits)
    )


def encloses(outer: CapsuleFit, inner: CapsuleFit) -> bool:
    """Whether a capsule lies in another one."""
    ends = np.array([inner.p0, inner.p1])
    return bool((beside_axis(ends, outer.p0, outer.p1) + inner.radius <= outer.radius).all())


def _cuts(triangles: FloatArray, own: BoolArray) -> list[BoolArray]:
    """Cuts of the triangles (T, 3, 3) that are `own` (T,) in two: each as those above it (T,)."""
    found = []
    for direction in _principal(triangles[own].reshape(-1, 3)):
        along = triangles.mean(axis=1) @ direction
        low = float(along[own].min())
        for share in _CUTS:
            above = own & (along > low + share * float(np.ptp(along[own])))
            if above.any() and (own & ~above).any():
                found.append(above)
    return found


def _cut_capsules(
    triangles: FloatArray,
    labels: IntArray,
    fits: Sequence[CapsuleFit],
    cut: tuple[int, BoolArray],
    axis: FloatArray | None,
) -> list[CapsuleFit]:
    """Capsules of all parts after one of them is cut: what is above it comes last."""
    k, above = cut
    below = (labels == k) & ~above
    parts = [_best(triangles[each].reshape(-1, 3), axis, _QUICK) for each in (below, above)]
    return [*fits[:k], parts[0], *fits[k + 1 :], parts[1]]


class _Measure:
    """Volume of unions of capsules around points (N, 3), by a grid of their box twice as large."""

    def __init__(self, points: FloatArray) -> None:
        low = points.min(axis=0)
        high = points.max(axis=0)
        room = 0.5 * float(np.max(high - low))
        axes = [np.linspace(a - room, b + room, _GRID) for a, b in zip(low, high, strict=True)]
        self._points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    def union(self, fits: Sequence[CapsuleFit]) -> float:
        """Points of the grid in any of the capsules."""
        inside = np.zeros(len(self._points), dtype=bool)
        for fit in fits:
            inside |= beside_axis(self._points, fit.p0, fit.p1) <= fit.radius
        return float(inside.sum())


def _cut(triangles: FloatArray) -> FloatArray:
    """The same surface without long triangles."""
    points = triangles.reshape(-1, 3)
    longest = _EDGE * float(np.linalg.norm(np.ptp(points, axis=0)))
    while len(triangles) < _TRIANGLES:
        edges = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2).max(axis=1)
        long = edges > longest
        if not long.any():
            break
        triangles = np.concatenate([triangles[~long], halved(triangles[long])])
    return triangles


class _Surface:
    """Triangles (T, 3, 3): distances of points from them."""

    def __init__(self, triangles: FloatArray) -> None:
        normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        flat = np.linalg.norm(normal, axis=1) > 0.0
        self._triangles = _cut(triangles[flat])
        self._tree = cKDTree(self._triangles.mean(axis=1))

    def distance(self, points: FloatArray) -> FloatArray:
        """At least the distance (N,) of points (N, 3); equal to it but where a far triangle is
        large.
        """
        count = min(_NEAREST, len(self._triangles))
        _, near = self._tree.query(points, k=count)
        near = np.asarray(near).reshape(len(points), count)
        return np.asarray(
            np.min(
                [point_triangle(points, self._triangles[near[:, k]]) for k in range(count)], axis=0
            )
        )

    def overhang(self, fit: CapsuleFit, others: Sequence[CapsuleFit]) -> float:
        """A bound of the distance of a capsule's surface, where it is in no other capsule."""
        patches = _Patches.of(fit)
        least = 0.0
        settled = 0.0
        for _ in range(_HALVINGS):
            points = patches.points(fit)
            outside = np.ones(len(points), dtype=bool)
            for other in others:
                outside &= other.radius - beside_axis(points, other.p0, other.p1) <= patches.radius
            patches = patches.chosen(outside)
            if not len(patches.along):
                return settled
            distance = self.distance(points[outside])
            least = max(least, float(distance.max()))
            bound = distance + patches.radius
            open_ = bound > 1.02 * least
            settled = max(settled, float(bound[~open_].max(initial=0.0)))
            worst = float(bound.max())
            patches = patches.chosen(open_).quartered()
            if not open_.any():
                return settled
        return max(settled, worst)


class _Patches(NamedTuple):
    """Patches of a capsule's surface: the middle of each along a meridian [m] and around [rad],
    half its extent in both, and the radius [m] around its middle that holds it.
    """

    along: FloatArray
    around: FloatArray
    half: tuple[float, float]
    radius: float

    @classmethod
    def of(cls, fit: CapsuleFit) -> _Patches:
        length = float(np.linalg.norm(fit.p1 - fit.p0)) + np.pi * fit.radius
        rows, columns = _CELLS
        along = (np.arange(rows) + 0.5) * length / rows
        around = (np.arange(columns) + 0.5) * 2.0 * np.pi / columns
        grid = np.meshgrid(along, around, indexing="ij")
        half = (0.5 * length / rows, np.pi / columns)
        return cls(
            grid[0].ravel(), grid[1].ravel(), half, float(np.hypot(half[0], fit.radius * half[1]))
        )

    def chosen(self, which: BoolArray) -> _Patches:
        return self._replace(along=self.along[which], around=self.around[which])

    def quartered(self) -> _Patches:
        a = 0.5 * self.half[0]
        b = 0.5 * self.half[1]
        along = np.concatenate([self.along + i * a for i in (-1, 1) for _ in (-1, 1)])
        around = np.concatenate([self.around + j * b for _ in (-1, 1) for j in (-1, 1)])
        return _Patches(along, around, (a, b), 0.5 * self.radius)

    def points(self, fit: CapsuleFit) -> FloatArray:
        """Their middles (N, 3)."""
        axis = fit.p1 - fit.p0
        length = float(np.linalg.norm(axis))
        z = axis / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
        x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
        x /= np.linalg.norm(x)
        quarter = 0.5 * np.pi * fit.radius
        angle = (np.minimum(self.along, quarter) - quarter) / fit.radius
        angle += np.maximum(self.along - quarter - length, 0.0) / fit.radius
        height = np.clip(self.along - quarter, 0.0, length) + fit.radius * np.sin(angle)
        side = np.cos(self.around)[:, None] * x + np.sin(self.around)[:, None] * np.cross(z, x)
        return np.asarray(
            fit.p0 + height[:, None] * z + (fit.radius * np.cos(angle))[:, None] * side
        )


def beside_axis(points: FloatArray, p0: FloatArray, p1: FloatArray) -> FloatArray:
    """Distance (N,) of points (N, 3) from the axis p0 to p1 of a capsule."""
    axis = p1 - p0
    square = float(axis @ axis)
    share = np.clip((points - p0) @ axis / square, 0.0, 1.0) if square > 0.0 else 0.0
    foot = p0 + np.multiply.outer(share, axis)
    return np.asarray(np.linalg.norm(points - foot, axis=-1))


def _principal(points: FloatArray) -> FloatArray:
    """Principal directions (3, 3) as rows, the longest first."""
    return np.asarray(np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2])


def _best(points: FloatArray, axis: FloatArray | None, rounds: int) -> CapsuleFit:
    points = _corners(points)
    directions = [*_principal(points), *np.eye(3)]
    if axis is not None and np.linalg.norm(axis) > 1e-9:
        directions.append(axis / np.linalg.norm(axis))
    return min((_along(points, direction, rounds) for direction in directions), key=_volume)


def _corners(points: FloatArray) -> FloatArray:
    points = np.unique(points, axis=0)
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):
        return points


def _along(points: FloatArray, direction: FloatArray, rounds: int) -> CapsuleFit:
    """The capsule with this direction, but for its overhang: a line through the middle of the
    projected points, caps pulled in.
    """
    along = points @ direction
    flat = points - along[:, None] * direction
    centre = flat.mean(axis=0)
    for k in range(1, rounds):  # Badoiu and Clarkson: towards the farthest point, ever shorter
        far = flat[np.argmax(((flat - centre) ** 2).sum(axis=1))]
        centre = centre + (far - centre) / (k + 1)
    beside = ((flat - centre) ** 2).sum(axis=1)
    radius = float(np.sqrt(beside.max()))
    cap = np.sqrt(np.maximum(radius**2 - beside, 0.0))
    low = float((along + cap).min())
    high = float((along - cap).max())
    if low > high:  # shorter than its caps: a sphere around the middle
        middle = centre + 0.5 * (low + high) * direction
        return CapsuleFit(middle, middle, float(np.linalg.norm(points - middle, axis=1).max()), 0.0)
    return CapsuleFit(centre + low * direction, centre + high * direction, radius, 0.0)


def _volume(fit: CapsuleFit) -> float:
    length = float(np.linalg.norm(fit.p1 - fit.p0))
    return float(np.pi * fit.radius**2 * (length + 4.0 / 3.0 * fit.radius))
