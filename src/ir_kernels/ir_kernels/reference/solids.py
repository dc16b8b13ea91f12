"""Nearest point and penetration depth of a convex solid, in the solid's own frame, for one point or
segment per row.

`project` gives the nearest point of the solid, which is the point itself where it is inside.
`depth` gives
the shortest translation of a segment that crosses the solid until it only touches it: the minimum
over directions n of support(n) - min(n.p0, n.p1), for which a polytope needs only the normals of
its faces and the cross products of its edges with the segment, and a cylinder those of its caps,
its side, and its rims.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ir_kernels.geometry import Hull
from ir_values.arrays import FloatArray, IntArray

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


def perpendicular(vectors: FloatArray) -> FloatArray:
    """Some unit vector (N, 3) perpendicular to each of the vectors (N, 3), which may be zero."""
    smallest = np.eye(3)[np.abs(vectors).argmin(axis=-1)]
    return unit(np.cross(vectors, smallest), smallest)


def project_box(points: FloatArray, half: FloatArray) -> FloatArray:
    """Nearest point (N, 3) of the box of half edge lengths (3,)."""
    return np.clip(points, -half, half)


def project_cylinder(points: FloatArray, radius: float, half_length: float) -> FloatArray:
    """Nearest point (N, 3) of the cylinder about z."""
    rho = np.linalg.norm(points[:, :2], axis=1, keepdims=True)
    side = points[:, :2] * np.minimum(1.0, radius / np.maximum(rho, radius))
    return np.concatenate([side, np.clip(points[:, 2:], -half_length, half_length)], axis=1)


def project_triangle(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Nearest point (N, F, 3) of each triangle (F, 3, 3): inside its prism the plane's, else the
    nearest of its sides'.
    """
    start = corners
    along = corners[:, [1, 2, 0]] - start
    normal = np.cross(along[:, 0], along[:, 1])
    offset = points[:, None, None] - start  # (N, F, 3, 3)
    t = np.clip(np.sum(offset * along, axis=-1) / np.sum(along * along, axis=-1), 0.0, 1.0)
    on_side = start + t[..., None] * along
    nearest = np.sum((points[:, None, None] - on_side) ** 2, axis=-1).argmin(axis=-1)
    on_side = np.take_along_axis(on_side, nearest[..., None, None], axis=2)[:, :, 0]
    inside = (np.sum(offset * np.cross(normal[:, None], along), axis=-1) >= 0.0).all(axis=-1)
    height = np.sum(offset[:, :, 0] * normal, axis=-1) / np.sum(normal * normal, axis=-1)
    return np.where(inside[..., None], points[:, None] - height[..., None] * normal, on_side)


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
    edge = hull.vertices[hull.edges[:, 1]] - hull.vertices[hull.edges[:, 0]]
    cross = np.cross(edge[None], (p1 - p0)[:, None])
    scale = np.linalg.norm(edge, axis=1) * np.linalg.norm(p1 - p0, axis=1)[:, None]
    parallel = np.linalg.norm(cross, axis=-1) <= 1e-9 * scale
    crossing = np.where(parallel[..., None], hull.normals[0], unit(cross))
    faces = np.broadcast_to(hull.normals, (len(p0), *hull.normals.shape))
    direction = np.concatenate([faces, crossing, -crossing], axis=1)
    return _shallowest(direction, (direction @ hull.vertices.T).max(axis=-1), p0, p1)


def depth_box(p0: FloatArray, p1: FloatArray, half: FloatArray) -> Depth:
    """Penetration of segments (N, 3), (N, 3) into the box of half edge lengths (3,)."""
    faces = np.concatenate([np.eye(3), -np.eye(3)])
    cross = np.cross(np.eye(3)[None], (p1 - p0)[:, None])
    parallel = np.linalg.norm(cross, axis=-1) <= 1e-9 * np.linalg.norm(p1 - p0, axis=1)[:, None]
    crossing = np.where(parallel[..., None], faces[0], unit(cross))
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
    """Penetration of segments (N, 3), (N, 3) into the cylinder about z."""

    def support(direction: FloatArray) -> FloatArray:
        sideways = np.linalg.norm(direction[..., :2], axis=-1)
        result: FloatArray = radius * sideways + half_length * np.abs(direction[..., 2])
        return result

    d = p1 - p0
    flat = np.array([1.0, 1.0, 0.0])
    length = np.sum((d * flat) ** 2, axis=1)
    t = np.clip(-np.sum(p0 * d * flat, axis=1) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
    across = unit(np.stack([-d[:, 1], d[:, 0], np.zeros(len(d))], axis=1))
    radial = unit((p0 + t[:, None] * d) * flat, across)
    caps = np.broadcast_to([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], (len(p0), 2, 3))
    # The rims, swept along the segment: directions perpendicular to it, on a circle.
    u = perpendicular(d)
    v = unit(np.cross(unit(d), u), u)
    angle = np.broadcast_to(
        np.arange(RIM_SAMPLES) * (2.0 * np.pi / RIM_SAMPLES), (len(p0), RIM_SAMPLES)
    )

    def on_circle(angle: FloatArray) -> FloatArray:
        result: FloatArray = (
            u[:, None] * np.cos(angle)[..., None] + v[:, None] * np.sin(angle)[..., None]
        )
        return result

    def overlap(angle: FloatArray) -> FloatArray:
        n = on_circle(angle)
        ahead = np.minimum(np.einsum("nki,ni->nk", n, p0), np.einsum("nki,ni->nk", n, p1))
        result: FloatArray = support(n) - ahead
        return result

    closest = _golden_section(overlap, overlap(angle).argmin(axis=1))
    direction = np.concatenate(
        [caps, radial[:, None], -radial[:, None], on_circle(closest)], axis=1
    )
    return _shallowest(direction, support(direction), p0, p1)
