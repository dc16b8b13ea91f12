"""Surfaces of triangles that are moved against each other, in NumPy: pairs whose balls meet are
looked at one by one.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ir_kernels.reference.segments import segment_segment
from ir_values.arrays import BoolArray, FloatArray, IntArray


class Surface:
    """As ir_kernels.surfaces.Surface."""

    def __init__(self, triangles: FloatArray, beside: FloatArray) -> None:
        self._triangles = triangles
        self._beside = beside
        self._centre = triangles.mean(axis=1)
        away = triangles - self._centre[:, None]
        self._radius = np.linalg.norm(away, axis=2).max(axis=1) + beside
        self._tree = cKDTree(self._centre)

    def meets(
        self, other: Surface, poses: FloatArray, near: float, enough: int
    ) -> tuple[BoolArray, int]:
        """Whether it is nearer than `near` [m] (N,), and how many pairs were looked at, as
        `ir_kernels.surfaces.Surface.meets`; poses (N, 4, 4).
        """
        met = np.zeros(len(poses), dtype=bool)
        looked_at = 0
        for k, pose in enumerate(poses):
            touching, looked = self._touching(other, pose, near)
            looked_at += looked
            met[k] = looked_at > enough or touching.any()
        return met, looked_at

    def touching(self, other: Surface, pose: FloatArray, near: float) -> BoolArray:
        """Which of its triangles (T,) are nearer than `near` [m]; pose (4, 4) in the other one."""
        return self._touching(other, pose, near)[0]

    def _touching(self, other: Surface, pose: FloatArray, near: float) -> tuple[BoolArray, int]:
        moved = self._triangles @ pose[:3, :3].T + pose[:3, 3]
        own, there = self._pairs(other, moved.mean(axis=1), near)
        reach = self._beside[own] + other._beside[there] + near
        touching = np.zeros(len(moved), dtype=bool)
        touching[own[_near(moved[own], other._triangles[there], reach)]] = True
        return touching, len(own)

    def _pairs(self, other: Surface, centre: FloatArray, near: float) -> tuple[IntArray, IntArray]:
        """Rows of triangles (M,), (M,) whose balls are near; centre (T, 3): of this one's."""
        reach = self._radius + near + other._radius.max(initial=0.0)
        found = other._tree.query_ball_point(centre, reach)
        own = np.repeat(np.arange(len(centre)), [len(each) for each in found])
        there = np.concatenate([*found, []]).astype(int)
        apart = np.linalg.norm(centre[own] - other._centre[there], axis=1)
        meet = apart <= self._radius[own] + other._radius[there] + near
        return own[meet], there[meet]


def _near(first: FloatArray, second: FloatArray, distance: FloatArray) -> BoolArray:
    """Whether triangles (M, 3, 3) are nearer than `distance` (M,) [m] to others (M, 3, 3): an edge
    to an edge, a corner to the inside, or an edge goes through.
    """
    found = np.zeros(len(first), dtype=bool)
    for one, other in ((first, second), (second, first)):
        for k in range(3):
            start = one[:, k]
            end = one[:, (k + 1) % 3]
            found |= _above(start, other, distance) | _goes_through(start, end, other)
            for j in range(3):
                edge = segment_segment(start, end, other[:, j], other[:, (j + 1) % 3])
                found |= edge.distance <= distance
    return found


def _above(points: FloatArray, triangles: FloatArray, distance: FloatArray) -> BoolArray:
    """Whether points (M, 3) are above the inside of triangles, and nearer than `distance` (M,)."""
    normal = _normal(triangles)
    height = ((points - triangles[:, 0]) * normal).sum(axis=1)
    low = np.abs(height) <= distance * np.linalg.norm(normal, axis=1)
    return np.asarray(low & _beside_no_edge(points, triangles))


def _beside_no_edge(points: FloatArray, triangles: FloatArray) -> BoolArray:
    """Whether points (M, 3) are above or below the inside of triangles (M, 3, 3)."""
    normal = _normal(triangles)
    inside = (normal != 0.0).any(axis=1)
    for k in range(3):
        edge = triangles[:, (k + 1) % 3] - triangles[:, k]
        inside &= (np.cross(edge, points - triangles[:, k]) * normal).sum(axis=1) >= 0.0
    return np.asarray(inside)


def _goes_through(start: FloatArray, end: FloatArray, triangles: FloatArray) -> BoolArray:
    """Whether segments (M, 3) to (M, 3) go through triangles (M, 3, 3)."""
    normal = _normal(triangles)
    low = ((start - triangles[:, 0]) * normal).sum(axis=1)
    high = ((end - triangles[:, 0]) * normal).sum(axis=1)
    through = ((low > 0.0) != (high > 0.0)) & (low != high)
    share = low / np.where(through, low - high, 1.0)
    return np.asarray(through & _beside_no_edge(start + share[:, None] * (end - start), triangles))


def _normal(triangles: FloatArray) -> FloatArray:
    a, b, c = triangles.swapaxes(0, 1)
    return np.cross(b - a, c - a)
