"""Triangles with normals: bodies, capsules, and a robot's surface made from its data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import ConvexHull

from ir_description import Body, RobotModel
from ir_description.shapes import Capsule
from ir_values.arrays import FloatArray, IntArray

# Triangles of bodies and capsules for the picture, with normals.

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


# A robot's surface made from its data: housings about its axes, beams and tubes between them, a
# pedestal.
#
# The collision capsules say how thick and how long a link is, the joints' axes which of them
# turn. A capsule along an axis of its link becomes a turned part, another one a beam with a
# waist; each joint gets a housing. All lies within the capsules but for rims of a few
# centimetres: it is a picture, clearance is of the capsules.

_ALONG = 0.94  # cosine: a capsule within 20 degrees of an axis is turned about it
_SLIM = 0.86  # of the capsule's radius: capsules are on the safe side
_WAIST = 0.72  # of a beam's section in its middle
_STATIONS = 9  # sections of a beam
_SQUARE = 3.2  # exponent of the beam's section: between an ellipse (2) and a rectangle


@dataclass(frozen=True, eq=False)
class SurfacePart:
    """A piece of a link: kind is "base", "link" or "joint"."""

    link: int
    kind: str
    mesh: Mesh


def robot_parts(robot: RobotModel) -> tuple[SurfacePart, ...]:
    """All pieces, each in the frame of its link."""
    parts = [_of_capsule(robot, capsule) for capsule in robot.capsules]
    return (*parts, *_housings(robot), *_counterbalance(robot))


def _of_capsule(robot: RobotModel, capsule: Capsule) -> SurfacePart:
    span = capsule.p1 - capsule.p0
    length = float(np.linalg.norm(span))
    kind = "base" if capsule.link == 0 else "link"
    if capsule.link == 0:
        return SurfacePart(0, kind, _pedestal(capsule))
    axes = _axes(robot, capsule.link)
    along = span / length if length > 1e-6 else axes[0]
    turned = any(abs(float(along @ axis)) > _ALONG for axis in axes)
    if turned or length < capsule.radius:
        return SurfacePart(capsule.link, kind, _turned(capsule, along, length))
    return SurfacePart(capsule.link, kind, _beam(capsule, along, length, axes[-1]))


def _axes(robot: RobotModel, link: int) -> list[FloatArray]:
    """Axes (3,) in the link's frame: of the joint that carries it, and of the one that it
    carries.
    """
    axes = [robot.joint_axis[link - 1]]
    if link < len(robot.joint_axis):
        axes.append(robot.joint_origin[link][:3, :3] @ robot.joint_axis[link])
    return axes


def _pedestal(capsule: Capsule) -> Mesh:
    """A foot plate and a column that narrows, as high as the capsule."""
    r = capsule.radius
    high = float(max(capsule.p0[2], capsule.p1[2])) + 0.25 * capsule.radius
    profile = [
        (0.0, 0.0),
        (r, 0.0),
        (r, 0.05),
        (0.84 * r, 0.07),
        (0.7 * r, 0.7 * high),
        (0.74 * r, 0.74 * high),
    ]
    mesh = lathe(np.array([*profile, (0.74 * r, high), (0.0, high)]))
    foot = (capsule.p0 + capsule.p1) / 2.0
    return _moved(mesh, np.eye(3), np.array([foot[0], foot[1], 0.0]))


def _turned(capsule: Capsule, along: FloatArray, length: float) -> Mesh:
    """A cylinder with chamfers about the capsule's axis; a sphere becomes one about its joint."""
    r = _SLIM * capsule.radius
    half = length / 2.0 + 0.75 * capsule.radius
    edge = 0.16 * r
    profile = [
        (0.0, -half),
        (r - edge, -half),
        (r, -half + edge),
        (r, half - edge),
        (r - edge, half),
        (0.0, half),
    ]
    return _moved(lathe(np.array(profile)), to_axis(along), (capsule.p0 + capsule.p1) / 2.0)


def _beam(capsule: Capsule, along: FloatArray, length: float, axis: FloatArray) -> Mesh:
    """A beam with rounded rectangular sections, slimmer in its middle, flat across an axis."""
    side = axis - (axis @ along) * along
    norm = float(np.linalg.norm(side))
    side = side / norm if norm > 1e-6 else to_axis(along)[:, 0]
    up = np.cross(along, side)
    angle = np.linspace(0.0, 2.0 * np.pi, SEGMENTS + 1)
    c = np.cos(angle)
    s = np.sin(angle)
    ring = np.stack(
        [np.sign(c) * np.abs(c) ** (2 / _SQUARE), np.sign(s) * np.abs(s) ** (2 / _SQUARE)], axis=1
    )
    r = _SLIM * capsule.radius
    t = np.linspace(-0.5 * r / length, 1.0 + 0.5 * r / length, _STATIONS)
    bow = np.clip(4.0 * t * (1.0 - t), 0.0, 1.0)
    size = r * (1.0 - (1.0 - _WAIST) * bow)
    centre = capsule.p0 + t[:, None] * (capsule.p1 - capsule.p0)
    sections = (
        centre[:, None, :]
        + 0.72 * size[:, None, None] * ring[None, :, :1] * side
        + size[:, None, None] * ring[None, :, 1:] * up
    )
    return _lofted(sections)


def _lofted(sections: FloatArray) -> Mesh:
    """Closed rings (K, S, 3), first point repeated at the end, joined to a surface with flat
    ends.
    """
    count, row = sections.shape[:2]
    k, s = np.meshgrid(np.arange(count - 1), np.arange(row - 1), indexing="ij")
    a = (k * row + s).ravel()
    sides = np.concatenate(
        [np.stack([a, a + 1, a + row + 1], 1), np.stack([a, a + row + 1, a + row], 1)]
    )
    around = np.gradient(sections, axis=1)
    around[:, 0] = around[:, -1] = (sections[:, 1] - sections[:, -2]) / 2.0
    normals = np.cross(around, np.gradient(sections, axis=0)).reshape(-1, 3)
    points = [sections.reshape(-1, 3)]
    triangles = [sides]
    start = count * row
    shades = [normals]
    for ring, sign in ((sections[0], -1.0), (sections[-1], 1.0)):
        middle = ring[:-1].mean(axis=0)
        outward = sign * (sections[-1].mean(axis=0) - sections[0].mean(axis=0))
        points.append(np.concatenate([ring, middle[None]]))
        shades.append(np.broadcast_to(outward, (row + 1, 3)))
        i = np.arange(row - 1)
        fan = np.stack([i, i + 1, np.full(row - 1, row)], 1) + start
        triangles.append(fan if sign > 0 else fan[:, [1, 0, 2]])
        start += row + 1
    shade = np.concatenate(shades)
    return Mesh(
        np.concatenate(points),
        shade / np.linalg.norm(shade, axis=1, keepdims=True),
        np.concatenate(triangles),
    )


def lathe(profile: FloatArray) -> Mesh:
    """A profile (K, 2) of radii and heights, from the bottom up, turned about z; edges stay
    sharp.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, SEGMENTS + 1)
    turn = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points: list[FloatArray] = []
    normals: list[FloatArray] = []
    triangles: list[IntArray] = []
    row = SEGMENTS + 1
    for low, high in pairwise(profile):
        outward = np.array([high[1] - low[1], low[0] - high[0]])
        outward = outward / np.linalg.norm(outward)
        start = sum(len(block) for block in points)
        for radius, height in (low, high):
            points.append(np.column_stack([radius * turn, np.full(row, height)]))
            normals.append(np.column_stack([outward[0] * turn, np.full(row, outward[1])]))
        a = start + np.arange(SEGMENTS)
        triangles += [np.stack([a, a + 1, a + row + 1], 1), np.stack([a, a + row + 1, a + row], 1)]
    return Mesh(np.concatenate(points), np.concatenate(normals), np.concatenate(triangles))


def _housings(robot: RobotModel) -> Iterator[SurfacePart]:
    """A cylinder about each joint that swings, on the link that it carries and nearly as thick as
    it; a rail has none.
    """
    for link in range(1 + robot.base, len(robot.joint_axis) + 1):
        axis = robot.joint_axis[link - 1]
        near = [c for c in robot.capsules if c.link == link and _distance(c) < c.radius]
        swings = [
            c for c in near if np.linalg.norm(c.p1 - c.p0) > c.radius and not _parallel(c, axis)
        ]
        if not swings:
            continue
        r = 0.8 * _SLIM * max(c.radius for c in swings)
        half = 1.25 * r
        profile = [
            (0.0, -half),
            (0.8 * r, -half),
            (r, -0.84 * half),
            (r, 0.84 * half),
            (0.8 * r, half),
            (0.0, half),
        ]
        yield SurfacePart(
            link, "joint", _moved(lathe(np.array(profile)), to_axis(axis), np.zeros(3))
        )


def _counterbalance(robot: RobotModel) -> Iterator[SurfacePart]:
    """The cylinder of the spring, from its pivot towards the rod's eye as it points with the arm
    upright.
    """
    spring = robot.counterbalance
    if spring is None:
        return
    frame = robot.joint_origin[spring.joint]
    pivot = frame[:3, :3] @ np.array([spring.pivot[0], 0.0, spring.pivot[1]]) + frame[:3, 3]
    eye = frame[:3, :3] @ np.array([-spring.rod_eye[1], 0.0, -spring.rod_eye[0]]) + frame[:3, 3]
    along = eye - pivot
    reach = float(np.linalg.norm(along))
    r = float(np.sqrt(spring.piston_area / np.pi)) * 3.2
    profile = np.array(
        [
            (0.0, -r),
            (r, -r),
            (r, 0.7 * reach),
            (0.4 * r, 0.72 * reach),
            (0.4 * r, reach),
            (0.0, reach),
        ]
    )
    yield SurfacePart(spring.joint, "joint", _moved(lathe(profile), to_axis(along / reach), pivot))


def _distance(capsule: Capsule) -> float:
    """Of the link's origin from the capsule's segment [m]."""
    span = capsule.p1 - capsule.p0
    at = np.clip(-(capsule.p0 @ span) / max(float(span @ span), 1e-12), 0.0, 1.0)
    return float(np.linalg.norm(capsule.p0 + at * span))


def _parallel(capsule: Capsule, axis: FloatArray) -> bool:
    span = capsule.p1 - capsule.p0
    return bool(abs(span @ axis) > _ALONG * np.linalg.norm(span))


def _moved(mesh: Mesh, rotation: FloatArray, centre: FloatArray) -> Mesh:
    return Mesh(mesh.points @ rotation.T + centre, mesh.normals @ rotation.T, mesh.triangles)
