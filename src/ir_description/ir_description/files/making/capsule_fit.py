"""Capsules around points: as small as one axis allows, and how far they stand out from the points'
hull.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ir_values.arrays import FloatArray

_CUTS = (0.2, 0.35, 0.5, 0.65, 0.8)  # of the length
_WORTH = 0.85  # of the volume: below it two capsules are worth their pairs
_ROUNDS = 60  # of the circle around projected points: within 2 % of the smallest
_DIRECTIONS = 500  # in which the surface is compared with the hull


class CapsuleFit(NamedTuple):
    """A capsule around points; overhang [m]: how far it stands out from the planes of their convex
    hull, at most.
    """

    p0: FloatArray
    p1: FloatArray
    radius: float
    overhang: float


def fitted(triangles: FloatArray, axis: FloatArray | None = None) -> tuple[CapsuleFit, ...]:
    """One capsule that encloses triangles (T, 3, 3), or two where these are smaller together by a
    sixth.

    axis (3,): a direction that is tried beside the principal ones, as from one joint to the next.
    """
    whole = (_best(triangles.reshape(-1, 3), axis),)
    middle = triangles.mean(axis=1)
    splits = []
    for direction in _principal(triangles.reshape(-1, 3)):
        along = middle @ direction
        for share in _CUTS:
            first = along < along.min() + share * np.ptp(along)
            if first.any() and not first.all():
                parts = (triangles[first], triangles[~first])
                splits.append(tuple(_best(part.reshape(-1, 3), axis) for part in parts))
    best = min(splits, key=_together, default=whole)
    chosen = best if _together(best) < _WORTH * _together(whole) else whole
    points = _corners(triangles.reshape(-1, 3))
    return tuple(fit._replace(overhang=_overhang(points, fit)) for fit in chosen)


def _together(fits: tuple[CapsuleFit, ...]) -> float:
    return sum(map(_volume, fits))


def _principal(points: FloatArray) -> FloatArray:
    """Principal directions (3, 3) as rows, the longest first."""
    return np.asarray(np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2])


def _best(points: FloatArray, axis: FloatArray | None) -> CapsuleFit:
    points = _corners(points)
    directions = [*_principal(points), *np.eye(3)]
    if axis is not None and np.linalg.norm(axis) > 1e-9:
        directions.append(axis / np.linalg.norm(axis))
    return min((_along(points, direction) for direction in directions), key=_volume)


def _corners(points: FloatArray) -> FloatArray:
    points = np.unique(points, axis=0)
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):
        return points


def _along(points: FloatArray, direction: FloatArray) -> CapsuleFit:
    """The capsule with this direction, but for its overhang: a line through the middle of the
    projected points, caps pulled in.
    """
    along = points @ direction
    flat = points - along[:, None] * direction
    centre = flat.mean(axis=0)
    for k in range(1, _ROUNDS):  # Badoiu and Clarkson: towards the farthest point, ever shorter
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


def _overhang(points: FloatArray, fit: CapsuleFit) -> float:
    p0, p1, radius, _ = fit
    try:
        planes = ConvexHull(points).equations
    except (QhullError, ValueError):
        return radius
    k = np.arange(_DIRECTIONS) + 0.5  # a spiral over the sphere
    height = 1.0 - 2.0 * k / _DIRECTIONS
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - height**2)
    sphere = np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=1)
    out = np.where((sphere @ (p1 - p0))[:, None] >= 0.0, p1, p0) + radius * sphere
    middle = 0.5 * (p0 + p1) + radius * sphere
    surface = np.concatenate([out, middle])
    return float(max((surface @ planes[:, :3].T + planes[:, 3]).max(axis=1).max(), 0.0))
