"""Solids: bodies of a scene, capsules around links, and exact distances between them.

The distances are plain and exact: they check a cell, they do not plan.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np

from ir_description.poses import composed, pose_of, transformed
from ir_kernels import portable
from ir_values.arrays import FloatArray, frozen, frozen_pose, in_range
from ir_values.errors import InvalidValueError

BodyKind = Literal["box", "cylinder", "sphere", "capsule", "plane", "mesh"]
KINDS: tuple[BodyKind, ...] = get_args(BodyKind)
SIZE_MAX = 1000.0
"""Largest length [m] of a body."""
_LENGTHS = {"box": 3, "cylinder": 2, "sphere": 1, "capsule": 2, "plane": 0, "mesh": 0}
_NO_VERTICES = frozen(np.zeros((0, 3)), (0, 3), "vertices")


@dataclass(frozen=True, eq=False)
class Body:
    """pose (4, 4) in the frame of its owner (a machine or part); in the world for what Cell.bodies
    returns.

    size (3,) [m]: box the full edges; cylinder (radius, length, 0) about z; sphere (radius, 0, 0);
    capsule (radius, length between the sphere centres, 0) about z; plane and mesh zeros. A plane is
    solid below its z axis. vertices (V, 3) [m] in the body's frame for a mesh, whose convex hull is
    the body; (0, 3) otherwise.
    """

    name: str
    kind: BodyKind
    pose: FloatArray
    size: FloatArray
    vertices: FloatArray = field(default_factory=lambda: _NO_VERTICES)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InvalidValueError(
                f"kind of {self.name} is {self.kind!r}, must be one of {', '.join(KINDS)}"
            )
        object.__setattr__(self, "pose", frozen_pose(self.pose, f"pose of {self.name}"))
        object.__setattr__(self, "size", frozen(self.size, (3,), f"size of {self.name}"))
        object.__setattr__(
            self, "vertices", frozen(self.vertices, (None, 3), f"vertices of {self.name}")
        )
        used = _LENGTHS[self.kind]
        positive = 1 if self.kind == "capsule" else used  # a capsule of length 0 is a sphere
        if (
            (self.size[:positive] <= 0.0).any()
            or (self.size < 0.0).any()
            or (self.size > SIZE_MAX).any()
            or self.size[used:].any()
        ):
            raise InvalidValueError(
                f"size of {self.name} is {self.size.tolist()} m, a {self.kind} must have its "
                f"first {used} in (0, {SIZE_MAX:g}] m and the others 0"
            )
        if (self.kind == "mesh") != (len(self.vertices) >= 4):
            raise InvalidValueError(
                f"{self.name} has {len(self.vertices)} vertices, a mesh must have at least 4 and "
                "others none"
            )

    def placed(self, pose: FloatArray) -> Body:
        """Return the body re-expressed by the pose (4, 4) of its owner's frame."""
        return replace(self, pose=composed(pose, self.pose))

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the lowest and highest corner (3,) [m] in the owner's frame; infinite for a
        plane.
        """
        R = self.pose[:3, :3]
        centre = self.pose[:3, 3]
        if self.kind == "plane":
            return np.full(3, -np.inf), np.full(3, np.inf)
        if self.kind == "mesh":
            points = portable.matmul(self.vertices, R.T) + centre
            return points.min(axis=0), points.max(axis=0)
        if self.kind == "box":
            reach = portable.matmul(np.abs(R), self.size / 2.0)
        elif self.kind == "sphere":
            reach = np.full(3, self.size[0])
        else:
            axis = np.abs(R[:, 2])
            side = (
                np.sqrt(np.maximum(0.0, 1.0 - axis * axis))
                if self.kind == "cylinder"
                else np.ones(3)
            )
            reach = axis * self.size[1] / 2.0 + side * self.size[0]
        return centre - reach, centre + reach


def floor_body() -> Body:
    """Return the floor: the plane z = 0 of the world."""
    return Body("floor", "plane", pose_of((0.0, 0.0, 0.0)), np.zeros(3))


# A capsule: all points within a radius of a segment. The collision shape of links, tools and held
# parts.


@dataclass(frozen=True, eq=False)
class Capsule:
    """Segment p0 (3,) to p1 (3,) [m] in the frame of `link` (0 = base_link), radius [m].

    p0 = p1 is a sphere.
    """

    name: str
    link: int
    p0: FloatArray
    p1: FloatArray
    radius: float

    def __post_init__(self) -> None:
        if self.link < 0:
            raise InvalidValueError(
                f"link of capsule {self.name} is {self.link}, must be at least 0"
            )
        object.__setattr__(self, "p0", frozen(self.p0, (3,), "p0"))
        object.__setattr__(self, "p1", frozen(self.p1, (3,), "p1"))
        object.__setattr__(
            self, "radius", in_range(self.radius, 0.0, 100.0, "m", "radius", open_low=True)
        )

    def placed(self, pose: FloatArray) -> Capsule:
        """Return the capsule re-expressed by a pose (4, 4) of its frame in another frame of the
        same link.
        """
        return replace(self, p0=transformed(pose, self.p0), p1=transformed(pose, self.p1))


def standing_capsule(name: str, capsule: Capsule) -> Body:
    """Return the capsule as a body of that name in the frame of its link."""
    middle = (capsule.p0 + capsule.p1) / 2.0
    along = capsule.p1 - capsule.p0
    length = float(np.sqrt((along * along).sum()))
    z = along / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x = x / np.sqrt((x * x).sum())
    turned = np.stack([x, np.cross(z, x), z], axis=1)
    size = np.array([capsule.radius, length, 0.0])
    return Body(name, "capsule", pose_of(middle, turned), size)


# Signed distance of a point and of a capsule to one body, plain and exact: to check a cell, not to
# plan.


def point_distance(body: Body, point: FloatArray) -> float:
    """Return the distance [m] of a point (3,) in the body's owner frame to its surface, negative
    inside.
    """
    p = portable.matmul(body.pose[:3, :3].T, point - body.pose[:3, 3])
    if body.kind == "plane":
        return float(p[2])
    if body.kind == "sphere":
        return float(portable.norm(p) - body.size[0])
    if body.kind == "capsule":
        on_axis = np.clip(p[2], -body.size[1] / 2.0, body.size[1] / 2.0)
        return float(portable.norm(p - (0.0, 0.0, on_axis)) - body.size[0])
    if body.kind == "box":
        return _outside_or_depth(np.abs(p) - body.size / 2.0)
    if body.kind == "cylinder":
        radial = portable.hypot(p[0], p[1]) - body.size[0]
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
    outside = float(portable.norm(np.maximum(excess, 0.0)))
    return outside if outside > 0.0 else float(excess.max())


def _hull_distance(vertices: FloatArray, point: FloatArray) -> float:
    """Inside: the nearest facet. Outside: the nearest convex combination of the vertices."""
    from scipy.optimize import nnls
    from scipy.spatial import ConvexHull

    facets = ConvexHull(vertices).equations
    depth = float((portable.matmul(facets[:, :3], point) + facets[:, 3]).max())
    if depth <= 0.0:
        return depth
    weight = 1e4  # makes the shares of the vertices sum to one
    rows = np.vstack([(vertices - point).T, np.full(len(vertices), weight)])
    shares, _ = nnls(rows, np.array([0.0, 0.0, 0.0, weight]))
    return float(portable.norm(portable.matmul(vertices.T, shares) / shares.sum() - point))


# Which boxes along the axes overlap: by their order along x, so that few of many pairs are looked
# at.


def overlapping(first: FloatArray, second: FloatArray) -> Iterator[tuple[int, int]]:
    """Numbers of the boxes of `first` (A, 2, 3) and `second` (B, 2, 3), lowest and highest corner,
    that overlap or touch: a in order, and for each a its b in order.
    """
    order = np.argsort(second[:, 0, 0], kind="stable")
    low = second[order, 0]
    high = second[order, 1]
    highest = np.maximum.accumulate(high[:, 0]) if len(order) else np.zeros(0)
    begins = np.searchsorted(highest, first[:, 0, 0])  # all before end too soon
    ends = np.searchsorted(low[:, 0], first[:, 1, 0], side="right")  # all after begin too late
    for a, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        near = slice(begin, end)
        apart = (low[near] > first[a, 1]) | (high[near] < first[a, 0])
        for b in np.sort(order[near][~apart.any(axis=1)]):
            yield a, int(b)
