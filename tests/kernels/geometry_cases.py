"""A KR 210 with its tool, and cells, as small literals: the kernels are tested without the
description package.
"""

from dataclasses import dataclass, field

import numpy as np

from ir_kernels import Chain, CollisionModel
from ir_values.arrays import FloatArray


@dataclass(frozen=True)
class Robot:
    joint_origin: FloatArray
    joint_axis: FloatArray
    position_min: FloatArray
    position_max: FloatArray


@dataclass(frozen=True)
class Capsule:
    name: str
    link: int
    p0: FloatArray
    p1: FloatArray
    radius: float


@dataclass(frozen=True)
class Body:
    name: str
    kind: str
    pose: FloatArray
    size: FloatArray
    vertices: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))


def shift(xyz: tuple[float, float, float], yaw: float = 0.0) -> FloatArray:
    pose = np.eye(4)
    c = np.cos(yaw)
    s = np.sin(yaw)
    pose[:2, :2] = [[c, -s], [s, c]]
    pose[:3, 3] = xyz
    return pose


def box(
    name: str,
    position: tuple[float, float, float],
    size: tuple[float, float, float],
    yaw: float = 0.0,
) -> Body:
    return Body(name, "box", shift(position, yaw), np.array(size))


def cylinder(name: str, position: tuple[float, float, float], radius: float, length: float) -> Body:
    return Body(name, "cylinder", shift(position), np.array([radius, length, 0.0]))


FLOOR = Body("floor", "plane", np.eye(4), np.zeros(3))
KR210 = Robot(
    joint_origin=np.array(
        [
            shift(xyz)
            for xyz in [
                (0, 0, 0.675),
                (0.35, 0, 0),
                (1.15, 0, 0),
                (0, 0, -0.041),
                (1.2, 0, 0),
                (0.215, 0, 0),
            ]
        ]
    ),
    joint_axis=np.array(
        [[0, 0, -1], [0, 1, 0], [0, 1, 0], [-1, 0, 0], [0, 1, 0], [-1, 0, 0]], dtype=float
    ),
    position_min=np.deg2rad([-185.0, -140, -120, -350, -125, -350]),
    position_max=np.deg2rad([185.0, -5, 155, 350, 125, 350]),
)
TCP = shift((0.42, 0.0, 0.0))
CAPSULES = tuple(
    Capsule(name, link, np.array(p0, dtype=float), np.array(p1, dtype=float), radius)
    for name, link, p0, p1, radius in [
        ("base", 0, (0, 0, 0.05), (0, 0, 0.32), 0.4),
        ("l1a", 1, (-0.25, 0, -0.12), (0.3, 0, -0.08), 0.28),
        ("l1b", 1, (0.35, -0.22, 0), (0.35, 0.22, 0), 0.22),
        ("l2", 2, (0, 0, 0), (1.15, 0, 0), 0.18),
        ("l3a", 3, (-0.33, 0, 0), (0.25, 0, -0.041), 0.22),
        ("l3b", 3, (0.25, 0, -0.041), (0.75, 0, -0.041), 0.165),
        ("l4", 4, (0.75, 0, 0), (1.12, 0, 0), 0.15),
        ("l5", 5, (0, 0, 0), (0.09, 0, 0), 0.14),
        ("l6", 6, (-0.06, 0, 0), (0.03, 0, 0), 0.11),
        ("t_bar", 6, (0.1, -0.24, 0), (0.1, 0.24, 0), 0.09),
        ("t_f1", 6, (0.15, -0.22, 0), (0.42, -0.22, 0), 0.055),
        ("t_f2", 6, (0.15, 0.22, 0), (0.42, 0.22, 0), 0.055),
        ("t_part", 6, (0.36, -0.14, 0), (0.36, 0.14, 0), 0.11),
    ]
)
OWN = ("base", "l1a", "l1b", "l2", "l3a", "l3b", "l4")
SELF_PAIRS = (
    *((tool, own) for tool in ("t_bar", "t_f1", "t_f2", "t_part") for own in OWN),
    *(("l5", own) for own in OWN[:4]),
    *(("l6", own) for own in OWN[:6]),
    *(("l4", own) for own in OWN[:4]),
    *(("l3b", own) for own in OWN[:3]),
    *(("l3a", own) for own in OWN[:2]),
)
# A square frame of wood: a door between a box, a column and a beam, each of another kind.
OPEN = (
    box("pallet1", (2.0, 0.0, 0.25), (1.2, 0.8, 0.5)),
    box("pallet2", (0.0, 2.0, 0.3), (0.8, 1.2, 0.6)),
    box("conveyor", (1.5, -1.6, 0.35), (1.6, 0.6, 0.7), -0.698132),
    box("cabinet", (-1.6, 1.4, 0.55), (0.6, 0.8, 1.1), 0.523599),
    box("rack", (1.45, 1.45, 0.6), (0.5, 0.5, 1.2), 0.785398),
    FLOOR,
)
COLUMNS = (
    box("table", (1.95, 0.0, 0.375), (1.3, 1.6, 0.75)),
    box("col1", (1.35, 1.15, 1.4), (0.3, 0.3, 2.8)),
    box("col2", (1.35, -1.15, 1.4), (0.3, 0.3, 2.8)),
    cylinder("col3", (0.35, 1.95, 1.5), 0.2, 3.0),
    cylinder("col4", (0.35, -1.95, 1.5), 0.2, 3.0),
    box("beam", (1.35, 0.0, 2.75), (0.3, 2.6, 0.2)),
    cylinder("jig", (2.0, 0.0, 1.05), 0.12, 0.6),
    box("side1", (-0.6, 1.9, 0.5), (0.8, 0.8, 1.0)),
    box("side2", (0.95, -1.9, 0.45), (0.6, 0.6, 0.9), 0.174533),
    FLOOR,
)
HOME = np.deg2rad([0.0, -125.0, 120.0, 0.0, 80.0, 0.0])


def sample(rng: np.random.Generator, count: int) -> FloatArray:
    """Joint values (count, 6), uniform within the limits."""
    return rng.uniform(KR210.position_min, KR210.position_max, (count, 6))


def random_pose(rng: np.random.Generator, reach: float = 2.0) -> FloatArray:
    pose = np.eye(4)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    pose[:3, :3] = rotation * np.linalg.det(rotation)
    pose[:3, 3] = rng.uniform(-reach, reach, 3)
    return pose


def every_kind(rng: np.random.Generator) -> tuple[Body, ...]:
    """One body of each kind at a random pose."""
    sizes = rng.uniform(0.1, 0.8, (6, 3))
    vertices = rng.normal(size=(20, 3)) * 0.4
    return (
        Body("a_box", "box", random_pose(rng), sizes[0]),
        Body("a_cylinder", "cylinder", random_pose(rng), sizes[1]),
        Body("a_sphere", "sphere", random_pose(rng), sizes[2]),
        Body("a_capsule", "capsule", random_pose(rng), sizes[3]),
        Body("a_plane", "plane", random_pose(rng), sizes[4]),
        Body("a_mesh", "mesh", random_pose(rng), np.zeros(3), vertices),
    )


# A hand with one joint: its capsule stands where the body is to be tried.
PROBE = Robot(np.eye(4)[None], np.array([[0.0, 0.0, 1.0]]), np.array([-3.0]), np.array([3.0]))
AT_ZERO = np.zeros((1, 1))


def probe(p0: FloatArray, p1: FloatArray, radius: float, body: Body) -> CollisionModel:
    return CollisionModel(Chain(PROBE), [Capsule("probe", 1, p0, p1, radius)], [body], ())
