"""Signed distance of a segment (the axis of a capsule) from a convex solid or from another segment,
with witnesses.

The distance from a convex set is a convex function of the place t on the segment, so its slope is
bisected. Where the segment crosses the solid the distance is minus the penetration depth; the
witnesses are those of the segment moved out by it, so that always on_segment - on_body = distance *
normal: an optimiser that follows the normal gets out.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ir_kernels.geometry import KINDS, Hull
from ir_kernels.reference import solids
from ir_kernels.reference.solids import Depth, unit
from ir_values.arrays import FloatArray

BISECTIONS = 60
TOUCH = 1e-12  # [m] below this distance a segment counts as crossing the solid


class Witness(NamedTuple):
    """distance (N,) [m], nearest points on_segment and on_body (N, 3), unit normal (N, 3) from the
    body to the segment.
    """

    distance: FloatArray
    on_segment: FloatArray
    on_body: FloatArray
    normal: FloatArray


def _nearest(
    p0: FloatArray, p1: FloatArray, project: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Points (N, 3) of the segments and of the solid that are nearest to each other."""
    d = p1 - p0
    low = np.zeros((len(p0), 1))
    high = np.ones((len(p0), 1))
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        point = p0 + middle * d
        rising = np.sum((point - project(point)) * d, axis=1, keepdims=True) > 0.0
        low = np.where(rising, low, middle)
        high = np.where(rising, middle, high)
    on_segment = p0 + np.where(low > 0.0, high, low) * d
    return on_segment, project(on_segment)


def _from_solid(
    p0: FloatArray,
    p1: FloatArray,
    project: Callable[[FloatArray], FloatArray],
    depth: Callable[[FloatArray, FloatArray], Depth],
) -> Witness:
    on_segment, on_body = _nearest(p0, p1, project)
    gap = on_segment - on_body
    distance = np.linalg.norm(gap, axis=1)
    normal = unit(gap)
    crossing = distance < TOUCH
    if crossing.any():
        inside = depth(p0[crossing], p1[crossing])
        out = (inside.depth + 1e-9)[:, None] * inside.direction
        moved, on_body[crossing] = _nearest(p0[crossing] + out, p1[crossing] + out, project)
        on_segment[crossing] = moved - out
        distance[crossing] = -inside.depth
        normal[crossing] = inside.direction
    return Witness(distance, on_segment, on_body, normal)


def segment_segment(a0: FloatArray, a1: FloatArray, b0: FloatArray, b1: FloatArray) -> Witness:
    """Nearest points of two segments (N, 3) per row: ends of each with the other, and both
    insides.
    """
    da = a1 - a0
    db = b1 - b0
    r = a0 - b0
    aa, bb, ab = (np.sum(x * y, axis=1) for x, y in ((da, da), (db, db), (da, db)))
    ra = np.sum(r * da, axis=1)
    rb = np.sum(r * db, axis=1)

    def ratio(numerator: FloatArray, denominator: FloatArray) -> FloatArray:
        safe = np.where(denominator > 0.0, denominator, 1.0)
        return np.clip(np.where(denominator > 0.0, numerator / safe, 0.0), 0.0, 1.0)

    zero = np.zeros(len(a0))
    one = np.ones(len(a0))
    s = ratio(ab * rb - bb * ra, aa * bb - ab * ab)
    choices = [
        (s, ratio(rb + s * ab, bb)),
        (zero, ratio(rb, bb)),
        (one, ratio(rb + ab, bb)),
        (ratio(-ra, aa), zero),
        (ratio(ab - ra, aa), one),
    ]
    s = np.array([c[0] for c in choices])
    t = np.array([c[1] for c in choices])
    gap = r + s[..., None] * da - t[..., None] * db
    best = np.sum(gap * gap, axis=-1).argmin(axis=0)
    rows = np.arange(len(a0))
    gap = gap[best, rows]
    s = s[best, rows]
    t = t[best, rows]
    normal = unit(
        gap, unit(np.cross(da, db), solids.perpendicular(np.where((aa > bb)[:, None], da, db)))
    )
    return Witness(np.linalg.norm(gap, axis=1), a0 + s[:, None] * da, b0 + t[:, None] * db, normal)


def segment_body(
    p0: FloatArray, p1: FloatArray, kind: int, size: FloatArray, hull: Hull
) -> Witness:
    """Witness of segments (N, 3), (N, 3) given in the frame of a body; spheres and capsules with
    their radius.
    """
    name = KINDS[kind]
    if name == "box":
        half = size / 2.0
        return _from_solid(
            p0, p1, lambda p: solids.project_box(p, half), lambda a, b: solids.depth_box(a, b, half)
        )
    if name == "cylinder":
        radius = float(size[0])
        half_length = float(size[1]) / 2.0
        return _from_solid(
            p0,
            p1,
            lambda p: solids.project_cylinder(p, radius, half_length),
            lambda a, b: solids.depth_cylinder(a, b, radius, half_length),
        )
    if name == "mesh":
        return _from_solid(
            p0,
            p1,
            lambda p: solids.project_hull(p, hull),
            lambda a, b: solids.depth_hull(a, b, hull),
        )
    if name == "plane":
        lowest = np.where((p0[:, 2] <= p1[:, 2])[:, None], p0, p1)
        up = np.broadcast_to([0.0, 0.0, 1.0], p0.shape)
        return Witness(lowest[:, 2].copy(), lowest, lowest * [1.0, 1.0, 0.0], up)
    end = np.array([0.0, 0.0, size[1] / 2.0 if name == "capsule" else 0.0])
    axis = segment_segment(p0, p1, np.broadcast_to(-end, p0.shape), np.broadcast_to(end, p0.shape))
    return Witness(
        axis.distance - size[0], axis.on_segment, axis.on_body + size[0] * axis.normal, axis.normal
    )
