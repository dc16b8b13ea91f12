"""Triangles of bodies and capsules for the picture, with normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from ir_description import Body, Capsule
from ir_msgs_py.arrays import FloatArray, IntArray

SEGMENTS = 28  # around an axis: looks round, and volumes are right to 1 %
RINGS = 7  # from the rim of a half sphere to its pole, as wide as the segments


@dataclass(frozen=True, eq=False)
class Mesh:
    """points (V, 3) [m], normals (V, 3), triangles (T, 3) of indices, seen from outside
    counter-clockwise.
    """

    points: FloatArray
    normals: FloatArray
    triangles: IntArray


def body_mesh(body: Body) -> Mesh | None:
    """The body's surface in its own frame; None for a plane, which has no end."""
    if body.kind == "box":
        return _box(body.size)
    if body.kind == "cylinder":
        return _cylinder(body.size[0], body.size[1])
    if body.kind == "sphere":
        return _rounded(body.size[0], 0.0)
    if body.kind == "capsule":
        return _rounded(body.size[0], body.size[1])
    if body.kind == "mesh":
        return _hull(body.vertices)
    return None


def capsule_mesh(capsule: Capsule) -> Mesh:
    """The capsule's surface in its link's frame."""
    axis = capsule.p1 - capsule.p0
    length = float(np.linalg.norm(axis))
    mesh = _rounded(capsule.radius, length)
    rotation = to_axis(axis / length) if length > 0.0 else np.eye(3)
    centre = (capsule.p0 + capsule.p1) / 2.0
    return Mesh(mesh.points @ rotation.T + centre, mesh.normals @ rotation.T, mesh.triangles)


def _box(size: FloatArray) -> Mesh:
    points: list[FloatArray] = []
    normals: list[FloatArray] = []
    triangles: list[list[int]] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u = (axis + 1) % 3
            v = (axis + 2) % 3
            start = len(points)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                point = np.zeros(3)
                point[axis] = sign
                point[u] = a
                point[v] = b
                points.append(point * size / 2.0)
                normals.append(np.eye(3)[axis] * sign)
            quad = [0, 1, 2, 0, 2, 3] if sign > 0 else [0, 2, 1, 0, 3, 2]
            triangles += [
                [start + quad[k], start + quad[k + 1], start + quad[k + 2]] for k in (0, 3)
            ]
    return Mesh(np.array(points), np.array(normals), np.array(triangles))


def _revolved(radii: FloatArray, heights: FloatArray, normals: FloatArray) -> Mesh:
    """A profile (K,) of radii and heights turned about z; its normals (K, 2) are radial and
    axial.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, SEGMENTS + 1)
    round_ = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    count = len(radii)
    points = np.concatenate(
        [
            radii[:, None, None] * round_,
            np.broadcast_to(heights[:, None, None], (count, SEGMENTS + 1, 1)),
        ],
        2,
    )
    outward = np.concatenate(
        [
            normals[:, :1, None] * round_,
            np.broadcast_to(normals[:, 1:, None], (count, SEGMENTS + 1, 1)),
        ],
        2,
    )
    row = SEGMENTS + 1
    k, s = np.meshgrid(np.arange(count - 1), np.arange(SEGMENTS), indexing="ij")
    a = (k * row + s).ravel()
    triangles = np.concatenate(
        [np.stack([a, a + 1, a + row + 1], 1), np.stack([a, a + row + 1, a + row], 1)]
    )
    return Mesh(points.reshape(-1, 3), outward.reshape(-1, 3), triangles)


def _cylinder(radius: float, length: float) -> Mesh:
    half = length / 2.0
    radii = np.array([0.0, radius, radius, radius, radius, 0.0])
    heights = np.array([-half, -half, -half, half, half, half])
    normals = np.array([[0, -1], [0, -1], [1, 0], [1, 0], [0, 1], [0, 1]], dtype=float)
    return _revolved(radii, heights, normals)


def _rounded(radius: float, length: float) -> Mesh:
    """A capsule about z; length between the centres of its ends."""
    angle = np.linspace(-np.pi / 2.0, 0.0, RINGS)
    low = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    normals = np.concatenate([low, low[::-1] * [1.0, -1.0]])
    shift = np.where(np.arange(2 * RINGS) < RINGS, -length / 2.0, length / 2.0)
    return _revolved(radius * normals[:, 0], radius * normals[:, 1] + shift, normals)


def _hull(vertices: FloatArray) -> Mesh:
    hull = ConvexHull(vertices)
    corners = vertices[hull.simplices]
    outward = hull.equations[:, :3]
    turned = np.einsum(
        "ti,ti->t", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), outward
    )
    corners[turned < 0] = corners[turned < 0][:, [0, 2, 1]]
    count = len(corners)
    return Mesh(
        corners.reshape(-1, 3), np.repeat(outward, 3, axis=0), np.arange(3 * count).reshape(-1, 3)
    )


def to_axis(axis: FloatArray) -> FloatArray:
    """A rotation (3, 3) that takes z to the axis."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(other, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)
