"""Whether machines stand in each other, and how deep: is there a plane between two convex bodies?

Curved bodies are taken by points on their surface, and all bodies a millimetre smaller than they
are. The robot's base counts against what it stands on; the planner keeps it clear of everything
else.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import TypeAlias

import numpy as np
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, QhullError

from ir_description import Body, Cell, Equipment
from ir_msgs_py.arrays import FloatArray
from ir_recorder.report.shapes import body_mesh, capsule_mesh

TOUCHING = (
    1e-3  # m that a body is smaller on each side: machines stand side by side, and data are rounded
)
# m that an overlap as drawn may grow: points of a curved body that turns lie so far inside it
DEEPER = 5e-3
_APART = 1e-9  # m between a plane and the bodies that it separates
Overlaps: TypeAlias = "dict[tuple[str, str], float]"
"""Depths [m] by the names of two bodies."""


@dataclass(frozen=True, eq=False)
class _Solid:
    """points (V, 3): of its surface; smaller: of the body that may not touch."""

    name: str
    points: FloatArray
    smaller: FloatArray


@dataclass(frozen=True, eq=False)
class _Plane:
    """Solid below the z axis of its pose (4, 4)."""

    name: str
    pose: FloatArray


def overlaps(cell: Cell) -> Overlaps:
    """What reaches into each other: bodies of different machines in any of their states (a door
    that opens needs its place too), bodies and the floor, the robot's base and what it stands on.
    """
    machines = [[_shape(body) for body in _bodies(each)] for each in cell.equipment]
    bodies = [body for own in machines for body in own]
    floor = [_Plane("floor", np.eye(4))] if cell.floor else []
    base = list(_base(cell))
    pairs = [(a, b) for own, other in combinations(machines, 2) for a in own for b in other]
    pairs += [(body, plane) for body in bodies for plane in floor]
    stands = set(cell.ignored_pairs)
    pairs += [(a, b) for a in base for b in (*bodies, *floor) if (a.name, b.name) in stands]
    depths = {(a.name, b.name): _depth(a, b) for a, b in pairs}
    return {pair: depth for pair, depth in depths.items() if depth > 0.0}


def deeper(
    found: Mapping[tuple[str, str], float], given: Mapping[tuple[str, str], float]
) -> Overlaps:
    """How much deeper [m] than in the given cell, where that is more than DEEPER or new."""
    more = {pair: depth - given.get(pair, 0.0) for pair, depth in found.items()}
    return {pair: by for pair, by in more.items() if pair not in given or by > DEEPER}


def _bodies(machine: Equipment) -> tuple[Body, ...]:
    return machine.bodies_in(*(state.name for state in machine.states))


def _shape(body: Body) -> _Solid | _Plane:
    mesh = body_mesh(body)
    return (
        _Plane(body.name, body.pose) if mesh is None else _solid(body.name, mesh.points, body.pose)
    )


def _base(cell: Cell) -> Iterator[_Solid]:
    for capsule in cell.robot.capsules:
        if capsule.link == 0:
            yield _solid(capsule.name, capsule_mesh(capsule).points, cell.base_pose)


def _solid(name: str, points: FloatArray, pose: FloatArray) -> _Solid:
    points = np.unique(points, axis=0)  # faces share corners
    extent = np.ptp(points, axis=0)
    middle = (points.max(axis=0) + points.min(axis=0)) / 2.0
    share = np.maximum(1.0 - 2.0 * TOUCHING / np.maximum(extent, TOUCHING), 0.0)
    sizes = (points, middle + (points - middle) * share)
    return _Solid(name, *(each @ pose[:3, :3].T + pose[:3, 3] for each in sizes))


def _depth(first: _Solid | _Plane, second: _Solid | _Plane) -> float:
    """How far [m] one must move to come out of the other, 0 where they are apart; of two planes
    too.
    """
    if isinstance(first, _Plane):
        first, second = second, first
    if isinstance(first, _Plane):
        return 0.0
    if isinstance(second, _Plane):
        below, smaller = (
            -_least_height(each, second.pose) for each in (first.points, first.smaller)
        )
        return below if smaller > 0.0 else 0.0
    if not _near(first.smaller, second.smaller) or separable(first.smaller, second.smaller):
        return 0.0
    return penetration(first.points, second.points)


def _least_height(points: FloatArray, plane: FloatArray) -> float:
    """Of points (V, 3) above a plane."""
    return float(((points - plane[:3, 3]) @ plane[:3, 2]).min())


def penetration(first: FloatArray, second: FloatArray) -> float:
    """The shortest move that takes one body out of the other: from the origin to the surface of all
    differences of their points (V, 3) and (W, 3).
    """
    try:
        hull = ConvexHull((first[:, None] - second[None]).reshape(-1, 3))
    except QhullError:  # two sheets in one plane
        return TOUCHING
    return max(float(-hull.equations[:, 3].max()), TOUCHING)


def _near(first: FloatArray, second: FloatArray) -> bool:
    """Whether the boxes along the axes overlap."""
    apart = (first.min(axis=0) > second.max(axis=0)) | (second.min(axis=0) > first.max(axis=0))
    return not bool(apart.any())


def separable(first: FloatArray, second: FloatArray) -> bool:
    """Whether a plane lies between points (V, 3) and (W, 3): a linear programme for its normal n,
    offset t and the distance m from both, with all components of n within 1.
    """
    rows = np.vstack(
        [
            np.column_stack([-first, np.ones(len(first)), np.ones(len(first))]),  # n a - t >= m
            np.column_stack([second, -np.ones(len(second)), np.ones(len(second))]),  # n b - t <= -m
        ]
    )
    bounds = [(-1.0, 1.0)] * 3 + [(None, None)] * 2
    found = linprog([0.0, 0.0, 0.0, 0.0, -1.0], A_ub=rows, b_ub=np.zeros(len(rows)), bounds=bounds)
    return bool(found.status == 0 and -float(found.fun or 0.0) > _APART)
