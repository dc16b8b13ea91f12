"""Capsules around points: as small as one axis allows, several where that pays, and a bound of how
far they stand out from what they enclose.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from ir_description.files.convex_pieces import halved, point_triangle
from ir_values.arrays import BoolArray, FloatArray

MOST = 3
"""Capsules of a link, at most: each is compared with all others and with all machines."""
_CUTS = (0.2, 0.35, 0.5, 0.65, 0.8)  # of the length
_PAIRS = 0.05  # of the volume: what one capsule more must save to be worth its pairs
_GRID = 22  # points along each edge of the box in which volumes are compared
_FEW = 800  # triangles with which cuts are compared
_ROUNDS = 60  # of the circle around projected points: within 2 % of the smallest
_QUICK = 12  # the same while cuts are compared
_TRIED = 2  # cuts whose capsules are found exactly
_OUTWARDS = np.random.default_rng(0).normal(size=(100, 3))
"""Directions in which a part is outermost, while cuts are compared."""
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
    triangles: FloatArray,
    axis: FloatArray | None = None,
    most: int = MOST,
    saved: float = _PAIRS,
) -> tuple[CapsuleFit, ...]:
    """Capsules that enclose triangles (T, 3, 3) together: one more, up to `most`, where that makes
    what they fill smaller by a share of `saved`.

    axis (3,): a direction that is tried beside the principal ones, as from one joint to the next.
    """
    fine = _without_long_triangles(triangles)
    few = fine[:: max(1, len(fine) // _FEW)]
    rough = _Rough(few, axis)
    nearest = cKDTree(few.mean(axis=1)).query(fine.mean(axis=1))[1]

    known: dict[int, tuple[_Part, CapsuleFit]] = {}

    def exact(parts: Sequence[_Part]) -> list[CapsuleFit]:
        for part in parts:
            if id(part) not in known:
                corners = _corners(fine[part.own[nearest]].reshape(-1, 3))
                known[id(part)] = part, _best(corners, corners, axis, _ROUNDS)
        return [known[id(part)][1] for part in parts]

    parts = [rough.part(np.ones(len(few), dtype=bool))]
    chosen = exact(parts)
    least = rough.volume(chosen)
    while len(parts) < most:
        tried = sorted(rough.more(parts), key=_volume_of_parts)[:_TRIED]
        if not tried:
            break
        every = [exact(each) for each in tried]
        volumes = [rough.volume(each) for each in every]
        best = int(np.argmin(volumes))
        parts = tried[best]
        size = volumes[best] * (1.0 + saved) ** (len(parts) - 1)
        if size < least:
            least = size
            chosen = every[best]
    return with_overhang(chosen, triangles)


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


class _Part(NamedTuple):
    """Triangles that are its own (T,), and the points of a grid that its capsule fills (G,)."""

    own: BoolArray
    filled: BoolArray


def _volume_of_parts(parts: Sequence[_Part]) -> float:
    """Points of the grid in any of their capsules."""
    return float(np.any([part.filled for part in parts], axis=0).sum())


class _Rough:
    """Ways to share out triangles (T, 3, 3), each part with a capsule around its outermost corners;
    volumes by a grid of a box twice as large as theirs.
    """

    def __init__(self, triangles: FloatArray, axis: FloatArray | None) -> None:
        self._triangles = triangles
        self._axis = axis
        points = triangles.reshape(-1, 3)
        low = points.min(axis=0)
        high = points.max(axis=0)
        room = 0.5 * float(np.max(high - low))
        axes = [np.linspace(a - room, b + room, _GRID) for a, b in zip(low, high, strict=True)]
        self._grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        self._square = _square(self._grid)
        self._known: dict[int, tuple[_Part, list[tuple[_Part, _Part]]]] = {}

    def part(self, own: BoolArray) -> _Part:
        """A part with the capsule around its outermost corners, in a few directions."""
        points = self._triangles[own].reshape(-1, 3)
        outermost = np.unique(np.argmax(points @ _OUTWARDS.T, axis=0))
        fit = _best(points, points[outermost], self._axis, _QUICK)
        return _Part(own, self._filled(fit))

    def more(self, parts: Sequence[_Part]) -> list[list[_Part]]:
        """All parts, one of them cut in two, in several ways."""
        found = []
        for k, part in enumerate(parts):
            if id(part) not in self._known:
                self._known[id(part)] = part, [*self._cuts(part.own)]
            found += [[*parts[:k], *cut, *parts[k + 1 :]] for cut in self._known[id(part)][1]]
        return found

    def volume(self, fits: Sequence[CapsuleFit]) -> float:
        """Points of the grid in any of the capsules."""
        return float(np.any([self._filled(fit) for fit in fits], axis=0).sum())

    def _filled(self, fit: CapsuleFit) -> BoolArray:
        """Points of the grid in a capsule; as beside_axis, without vectors of it in between."""
        axis = fit.p1 - fit.p0
        square = float(axis @ axis)
        away = self._square - 2.0 * (self._grid @ fit.p0) + float(fit.p0 @ fit.p0)
        along = self._grid @ axis - float(fit.p0 @ axis)
        share = np.clip(along / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(along))
        return np.asarray(away - share * (2.0 * along - share * square) <= fit.radius**2)

    def _cuts(self, own: BoolArray) -> Iterator[tuple[_Part, _Part]]:
        for direction in _principal(self._triangles[own].reshape(-1, 3)):
            along = self._triangles.mean(axis=1) @ direction
            low = float(along[own].min())
            for share in _CUTS:
                above = own & (along > low + share * float(np.ptp(along[own])))
                below = own & ~above
                if above.any() and below.any():
                    yield self.part(below), self.part(above)


def _without_long_triangles(triangles: FloatArray) -> FloatArray:
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
        self._triangles = _without_long_triangles(triangles[flat])
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
        """Their middles (N, 3) [m] on a capsule: a meridian runs over one cap, along the cylinder
        and over the other cap.
        """
        axis = fit.p1 - fit.p0
        length = float(np.linalg.norm(axis))
        z = axis / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
        x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
        x /= np.linalg.norm(x)
        y = np.cross(z, x)
        quarter = 0.5 * np.pi * fit.radius
        angle = (np.minimum(self.along, quarter) - quarter) / fit.radius
        angle += np.maximum(self.along - quarter - length, 0.0) / fit.radius
        height = np.clip(self.along - quarter, 0.0, length) + fit.radius * np.sin(angle)
        side = np.cos(self.around)[:, None] * x + np.sin(self.around)[:, None] * y
        beside = fit.radius * np.cos(angle)
        return np.asarray(fit.p0 + height[:, None] * z + beside[:, None] * side)


def beside_axis(points: FloatArray, p0: FloatArray, p1: FloatArray) -> FloatArray:
    """Distance (N,) of points (N, 3) from the axis p0 to p1 of a capsule."""
    axis = p1 - p0
    square = float(axis @ axis)
    share = np.clip((points - p0) @ axis / square, 0.0, 1.0) if square > 0.0 else 0.0
    foot = p0 + np.multiply.outer(share, axis)
    return np.asarray(np.linalg.norm(points - foot, axis=-1))


def _principal(points: FloatArray) -> FloatArray:
    """Principal directions (3, 3) as rows, the longest first."""
    beside = points - points.mean(axis=0)
    return np.asarray(np.linalg.eigh(beside.T @ beside)[1].T[::-1])


def _corners(points: FloatArray) -> FloatArray:
    """Those of the hull of points (N, 3); of flat ones, all."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):
        return np.unique(points, axis=0)


def _best(
    points: FloatArray, outermost: FloatArray, axis: FloatArray | None, rounds: int
) -> CapsuleFit:
    """The smallest capsule in one of a few directions around points (N, 3), as `outermost` (M, 3)
    of them tell, but for its overhang: a line through the middle of the projected points.

    The directions are the principal ones, the frame's, and `axis` (3,) where it is given.
    """
    directions = np.concatenate([_principal(outermost), np.eye(3)])
    if axis is not None and np.linalg.norm(axis) > 1e-9:
        directions = np.concatenate([directions, axis[None] / np.linalg.norm(axis)])
    along = directions @ outermost.T
    flat = outermost - along[:, :, None] * directions[:, None]
    centre = flat.mean(axis=1)
    rows = np.arange(len(directions))
    for k in range(1, rounds):  # Badoiu and Clarkson: towards the farthest point, ever shorter
        farthest = np.argmax(_square(flat - centre[:, None]), axis=1)
        centre = centre + (flat[rows, farthest] - centre) / (k + 1)
    beside = _square(flat - centre[:, None])
    square = beside.max(axis=1, keepdims=True)

    # the ends: as far apart as the caps' spheres leave no point outside
    cap = np.sqrt(square - beside)
    low = (along + cap).min(axis=1)
    high = (along - cap).max(axis=1)
    middle = centre + 0.5 * (low + high)[:, None] * directions
    ball = np.sqrt(_square(outermost - middle[:, None]).max(axis=1))
    radius = np.where(low > high, ball, np.sqrt(square[:, 0]))
    volume = _volume(np.maximum(high - low, 0.0), radius)
    smallest = int(np.argmin(volume))
    return _capsule_along(points, centre[smallest], directions[smallest])


def _square(vectors: FloatArray) -> FloatArray:
    """Squares (..) of the lengths of vectors (.., 3)."""
    return np.asarray(np.einsum("...i,...i->...", vectors, vectors))


def _capsule_along(points: FloatArray, centre: FloatArray, direction: FloatArray) -> CapsuleFit:
    """The capsule around a line, caps pulled in; where it is shorter than these, a sphere around
    the middle.
    """
    along = points @ direction
    beside = _square(points - along[:, None] * direction - centre)
    square = float(beside.max())
    cap = np.sqrt(square - beside)
    low = float((along + cap).min())
    high = float((along - cap).max())
    if low > high:
        middle = centre + 0.5 * (low + high) * direction
        ball = float(np.linalg.norm(points - middle, axis=1).max())
        return CapsuleFit(middle, middle, ball, 0.0)
    radius = float(np.sqrt(square))
    return CapsuleFit(centre + low * direction, centre + high * direction, radius, 0.0)


def _volume(length: FloatArray, radius: FloatArray) -> FloatArray:
    """Of capsules whose axes have these lengths [m]."""
    return np.asarray(np.pi * radius**2 * (length + 4.0 / 3.0 * radius))
