"""Signed distance of a point and of a capsule to one body, plain and exact: to check a cell, not to
plan.
"""

from __future__ import annotations

import numpy as np

from ir_description.shapes.body import Body
from ir_description.shapes.capsule import Capsule
from ir_msgs_py.arrays import FloatArray


def point_distance(body: Body, point: FloatArray) -> float:
    """Return the distance [m] of a point (3,) in the body's owner frame to its surface, negative
    inside.
    """
    p = body.pose[:3, :3].T @ (point - body.pose[:3, 3])
    if body.kind == "plane":
        return float(p[2])
    if body.kind == "sphere":
        return float(np.linalg.norm(p) - body.size[0])
    if body.kind == "capsule":
        on_axis = np.clip(p[2], -body.size[1] / 2.0, body.size[1] / 2.0)
        return float(np.linalg.norm(p - (0.0, 0.0, on_axis)) - body.size[0])
    if body.kind == "box":
        return _outside_or_depth(np.abs(p) - body.size / 2.0)
    if body.kind == "cylinder":
        radial = np.hypot(p[0], p[1]) - body.size[0]
        axial = abs(p[2]) - body.size[1] / 2.0
        return _outside_or_depth(np.array([radial, axial]))
    return _hull_distance(body.vertices, p)


def capsule_distance(body: Body, capsule: Capsule) -> float:
    """Return the distance [m] of a capsule to a body, both in one frame, negative in penetration.

    The distance of a convex body to the points of a segment has one minimum.
    """
    from scipy.optimize import minimize_scalar  # half a second of imports, for who reviews a cell

    step = capsule.p1 - capsule.p0

    def at(t: float) -> float:
        return point_distance(body, capsule.p0 + t * step)

    found = minimize_scalar(at, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-9})
    return min(float(found.fun), at(0.0), at(1.0)) - capsule.radius


def _outside_or_depth(excess: FloatArray) -> float:
    outside = float(np.linalg.norm(np.maximum(excess, 0.0)))
    return outside if outside > 0.0 else float(excess.max())


def _hull_distance(vertices: FloatArray, point: FloatArray) -> float:
    """Inside: the nearest facet. Outside: the nearest convex combination of the vertices."""
    from scipy.optimize import nnls
    from scipy.spatial import ConvexHull

    facets = ConvexHull(vertices).equations
    depth = float((facets[:, :3] @ point + facets[:, 3]).max())
    if depth <= 0.0:
        return depth
    weight = 1e4  # makes the shares of the vertices sum to one
    rows = np.vstack([(vertices - point).T, np.full(len(vertices), weight)])
    shares, _ = nnls(rows, np.array([0.0, 0.0, 0.0, weight]))
    return float(np.linalg.norm(vertices.T @ shares / shares.sum() - point))
