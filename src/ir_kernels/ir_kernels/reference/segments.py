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
from ir_values.arrays import FloatArray, IntArray

# Nearest point and penetration depth of a convex solid, in the solid's own frame, for one point
# or segment per row.
#
# `project` gives the nearest point of the solid, which is the point itself where it is inside.
# `depth` gives the shortest translation of a segment that crosses the solid until it only touches
# it: the minimum over directions n of support(n) - min(n.p0, n.p1), for which a polytope needs
# only the normals of its faces and the cross products of its edges with the segment, and a
# cylinder those of its caps, its side, and its rims.

RIM_SAMPLES = 256
GOLDEN_STEPS = 60
GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


class Depth(NamedTuple):
    """depth (N,) [m] >= 0, and the unit direction (N, 3) in which the segment leaves."""

    depth: FloatArray
    direction: FloatArray


def unit(vectors: FloatArray, otherwise: FloatArray | None = None) -> FloatArray:
    """Vectors (..., 3) at length 1; those shorter than 1e-12 become `otherwise` (default: x)."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    fallback = np.array([1.0, 0.0, 0.0]) if otherwise is None else otherwise
    result: FloatArray = np.where(length > 1e-12, vectors / np.maximum(length, 1e-12), fallback)
    return result


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products (..., 3): np.cross bit by bit, which takes several times as long for few."""
    result: FloatArray = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for k in range(3):
        i = (k + 1) % 3
        j = (k + 2) % 3
        result[..., k] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return result


def perpendicular(vectors: FloatArray) -> FloatArray:
    """Some unit vector (N, 3) perpendicular to each of the vectors (N, 3), which may be zero."""
    smallest = np.eye(3)[np.abs(vectors).argmin(axis=-1)]
    return unit(cross(vectors, smallest), smallest)


def project_box(points: FloatArray, half: FloatArray) -> FloatArray:
    """Nearest point (N, 3) of the box of half edge lengths (3,)."""
    return np.clip(points, -half, half)


def project_cylinder(points: FloatArray, radius: float, half_length: float) -> FloatArray:
    """Nearest point (N, 3) of the cylinder about z."""
    rho = np.linalg.norm(points[:, :2], axis=1, keepdims=True)
    side = points[:, :2] * np.minimum(1.0, radius / np.maximum(rho, radius))
    return np.concatenate([side, np.clip(points[:, 2:], -half_length, half_length)], axis=1)


def project_triangle(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Nearest point (N, F, 3) to each of the points (N, 3) of each triangle (F, 3, 3): inside its
    prism the plane's, else the nearest of its sides'. All in m.
    """
    # On each side: the foot of the perpendicular, within the side.
    start = corners
    along = corners[:, [1, 2, 0]] - start
    normal = cross(along[:, 0], along[:, 1])
    to_corner = points[:, None, None]
    offset = to_corner - start  # (N, F, 3, 3)
    squared_length = np.sum(along * along, axis=-1)
    t = np.clip(np.sum(offset * along, axis=-1) / squared_length, 0.0, 1.0)
    feet = start + t[..., None] * along
    nearest_side = np.sum((to_corner - feet) ** 2, axis=-1).argmin(axis=-1)
    on_side = np.take_along_axis(feet, nearest_side[..., None, None], axis=2)[:, :, 0]

    # Within the prism over the triangle: on the inner side of all three sides.
    inwards = cross(normal[:, None], along)
    inside = (np.sum(offset * inwards, axis=-1) >= 0.0).all(axis=-1)
    height = np.sum(offset[:, :, 0] * normal, axis=-1) / np.sum(normal * normal, axis=-1)
    on_plane = points[:, None] - height[..., None] * normal
    return np.where(inside[..., None], on_plane, on_side)


def project_hull(points: FloatArray, hull: Hull) -> FloatArray:
    """Nearest point (N, 3) of a convex polytope."""
    candidates = project_triangle(points, hull.vertices[hull.triangles])
    nearest = np.sum((points[:, None] - candidates) ** 2, axis=-1).argmin(axis=-1)
    on_surface = candidates[np.arange(len(points)), nearest]
    inside = np.all(points @ hull.normals.T <= hull.offsets, axis=1)
    return np.where(inside[:, None], points, on_surface)


def _shallowest(
    direction: FloatArray, support: FloatArray, p0: FloatArray, p1: FloatArray
) -> Depth:
    """The least overlap over K directions (N, K, 3) with the solid's support values (N, K)."""
    ahead = np.minimum(
        np.einsum("nki,ni->nk", direction, p0), np.einsum("nki,ni->nk", direction, p1)
    )
    overlap = support - ahead
    best = overlap.argmin(axis=1)
    rows = np.arange(len(p0))
    return Depth(overlap[rows, best], direction[rows, best])


def depth_hull(p0: FloatArray, p1: FloatArray, hull: Hull) -> Depth:
    """Penetration of segments (N, 3), (N, 3) into a polytope."""
    # Directions that can be shallowest: normals of faces, and of the planes that an edge and the
    # segment span (nothing where they are parallel: a face's normal then).
    edge = hull.vertices[hull.edges[:, 1]] - hull.vertices[hull.edges[:, 0]]
    across = cross(edge[None], (p1 - p0)[:, None])
    scale = np.linalg.norm(edge, axis=1) * np.linalg.norm(p1 - p0, axis=1)[:, None]
    parallel = np.linalg.norm(across, axis=-1) <= 1e-9 * scale
    crossing = np.where(parallel[..., None], hull.normals[0], unit(across))
    faces = np.broadcast_to(hull.normals, (len(p0), *hull.normals.shape))
    direction = np.concatenate([faces, crossing, -crossing], axis=1)
    return _shallowest(direction, (direction @ hull.vertices.T).max(axis=-1), p0, p1)


def depth_box(p0: FloatArray, p1: FloatArray, half: FloatArray) -> Depth:
    """Penetration of segments (N, 3), (N, 3) into the box of half edge lengths (3,)."""
    faces = np.concatenate([np.eye(3), -np.eye(3)])
    across = cross(np.eye(3)[None], (p1 - p0)[:, None])
    parallel = np.linalg.norm(across, axis=-1) <= 1e-9 * np.linalg.norm(p1 - p0, axis=1)[:, None]
    crossing = np.where(parallel[..., None], faces[0], unit(across))
    direction = np.concatenate(
        [np.broadcast_to(faces, (len(p0), 6, 3)), crossing, -crossing], axis=1
    )
    return _shallowest(direction, np.abs(direction) @ half, p0, p1)


def _golden_section(overlap: Callable[[FloatArray], FloatArray], best: IntArray) -> FloatArray:
    """Angles (N, 1) of least overlap within a sample of the best (N,) of RIM_SAMPLES."""
    low = (best[:, None] - 1.0) * (2.0 * np.pi / RIM_SAMPLES)
    high = (best[:, None] + 1.0) * (2.0 * np.pi / RIM_SAMPLES)
    for _ in range(GOLDEN_STEPS):
        left = high - GOLDEN * (high - low)
        right = low + GOLDEN * (high - low)
        smaller = overlap(left) < overlap(right)
        low = np.where(smaller, low, left)
        high = np.where(smaller, right, high)
    middle: FloatArray = (low + high) / 2.0
    return middle


def depth_cylinder(p0: FloatArray, p1: FloatArray, radius: float, half_length: float) -> Depth:
    """Penetration of segments between p0 and p1 (N, 3) [m] into the cylinder about z.

    Directions that may be the shallowest: both caps, straight out from the axis, and those across
    the segment, along which a rim is left.
    """

    def support(direction: FloatArray) -> FloatArray:
        """How far the cylinder extends from its centre in directions (..., 3)."""
        sideways = np.linalg.norm(direction[..., :2], axis=-1)
        result: FloatArray = radius * sideways + half_length * np.abs(direction[..., 2])
        return result

    rows = len(p0)
    d = p1 - p0
    flat = np.array([1.0, 1.0, 0.0])
    squared_length = np.sum((d * flat) ** 2, axis=1)
    safe = np.where(squared_length > 0.0, squared_length, 1.0)
    t = np.clip(-np.sum(p0 * d * flat, axis=1) / safe, 0.0, 1.0)  # nearest to the axis
    across = unit(np.stack([-d[:, 1], d[:, 0], np.zeros(rows)], axis=1))
    radial = unit((p0 + t[:, None] * d) * flat, across)
    caps = np.broadcast_to([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], (rows, 2, 3))

    # The rims, swept along the segment: directions perpendicular to it, on a circle.
    u = perpendicular(d)
    v = unit(cross(unit(d), u), u)
    even = np.arange(RIM_SAMPLES) * (2.0 * np.pi / RIM_SAMPLES)
    angles = np.broadcast_to(even, (rows, RIM_SAMPLES))

    def on_circle(angle: FloatArray) -> FloatArray:
        cosine = np.cos(angle)[..., None]
        sine = np.sin(angle)[..., None]
        result: FloatArray = u[:, None] * cosine + v[:, None] * sine
        return result

    def overlap(angle: FloatArray) -> FloatArray:
        """How far cylinder and segment overlap along directions at angles (N, K) [m]."""
        n = on_circle(angle)
        ahead0 = np.einsum("nki,ni->nk", n, p0)
        ahead1 = np.einsum("nki,ni->nk", n, p1)
        result: FloatArray = support(n) - np.minimum(ahead0, ahead1)
        return result

    closest = _golden_section(overlap, overlap(angles).argmin(axis=1))
    outwards = radial[:, None]
    direction = np.concatenate([caps, outwards, -outwards, on_circle(closest)], axis=1)
    return _shallowest(direction, support(direction), p0, p1)


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
    # The distance of a convex set along the segment is convex: where it rises, the nearest point is
    # before.
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
        # Move the segment out by its depth: it touches then, and its nearest points are witnesses.
        inside = depth(p0[crossing], p1[crossing])
        out = (inside.depth + 1e-9)[:, None] * inside.direction
        moved, on_body[crossing] = _nearest(p0[crossing] + out, p1[crossing] + out, project)
        on_segment[crossing] = moved - out
        distance[crossing] = -inside.depth
        normal[crossing] = inside.direction
    return Witness(distance, on_segment, on_body, normal)


def segment_segment(a0: FloatArray, a1: FloatArray, b0: FloatArray, b1: FloatArray) -> Witness:
    """Nearest points of two segments (N, 3) per row: ends of each with the other, and both
    insides. a0, a1 are the ends of the first [m], b0, b1 those of the second.
    """
    da = a1 - a0
    db = b1 - b0
    r = a0 - b0
    aa = np.sum(da * da, axis=1)
    bb = np.sum(db * db, axis=1)
    ab = np.sum(da * db, axis=1)
    ra = np.sum(r * da, axis=1)
    rb = np.sum(r * db, axis=1)

    def ratio(numerator: FloatArray, denominator: FloatArray) -> FloatArray:
        """Within 0..1; 0 where a segment has no length or both are parallel."""
        divides = denominator > 0.0
        safe = np.where(divides, denominator, 1.0)
        return np.clip(np.where(divides, numerator / safe, 0.0), 0.0, 1.0)

    zero = np.zeros(len(a0))
    one = np.ones(len(a0))

    # Both insides: the least |r + s da - t db|^2 has zero derivatives by s and t. Then each end of
    # either segment with the foot of its perpendicular on the other.
    inside = ratio(ab * rb - bb * ra, aa * bb - ab * ab)
    s_of_choices = np.array([inside, zero, one, ratio(-ra, aa), ratio(ab - ra, aa)])
    t_of_choices = np.array(
        [ratio(rb + inside * ab, bb), ratio(rb, bb), ratio(rb + ab, bb), zero, one]
    )
    gaps = r + s_of_choices[..., None] * da - t_of_choices[..., None] * db
    best = np.sum(gaps * gaps, axis=-1).argmin(axis=0)
    rows = np.arange(len(a0))
    gap = gaps[best, rows]
    s = s_of_choices[best, rows]
    t = t_of_choices[best, rows]

    # segments that touch have no direction between them: then one across both, or across the longer
    longer = np.where((aa > bb)[:, None], da, db)
    across_both = unit(cross(da, db), perpendicular(longer))
    normal = unit(gap, across_both)
    distance = np.linalg.norm(gap, axis=1)
    return Witness(distance, a0 + s[:, None] * da, b0 + t[:, None] * db, normal)


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
            p0, p1, lambda p: project_box(p, half), lambda a, b: depth_box(a, b, half)
        )
    if name == "cylinder":
        radius = float(size[0])
        half_length = float(size[1]) / 2.0
        return _from_solid(
            p0,
            p1,
            lambda p: project_cylinder(p, radius, half_length),
            lambda a, b: depth_cylinder(a, b, radius, half_length),
        )
    if name == "mesh":
        return _from_solid(
            p0,
            p1,
            lambda p: project_hull(p, hull),
            lambda a, b: depth_hull(a, b, hull),
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
