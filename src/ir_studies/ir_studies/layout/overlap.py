"""Whether machines stand in each other: is there a plane between two convex bodies?

Curved bodies are taken by points on their surface, and all bodies a millimetre smaller than they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from scipy.optimize import linprog

from ir_description import Body, Cell, Equipment
from ir_msgs_py.arrays import FloatArray
from ir_recorder.report.shapes import body_mesh

TOUCHING = 1e-3  # m that a body is smaller on each side: machines stand side by side, and data are rounded
_APART = 1e-9  # m between a plane and the bodies that it separates
Solid = tuple[str, FloatArray]  # a body's name, points (V, 3) of its surface


def overlaps(cell: Cell) -> set[tuple[str, str]]:
    """Names of bodies of different machines that reach into each other, or below the floor, in any of their
    states: a door that opens needs its place too.
    """
    machines = [[one for body in _bodies(each) for one in _solid(body)] for each in cell.equipment]
    sunk = {(name, "floor") for each in machines for name, points in each if points[:, 2].min() < 0.0}
    return (sunk if cell.floor else set()) | {
        (name, other)
        for first, second in combinations(machines, 2)
        for name, points in first
        for other, others in second
        if _near(points, others) and not separable(points, others)
    }


def _bodies(machine: Equipment) -> tuple[Body, ...]:
    return machine.bodies_in(*(state.name for state in machine.states))


def _solid(body: Body) -> Iterator[Solid]:
    mesh = body_mesh(body)
    if mesh is None:  # a plane
        return
    extent = np.ptp(mesh.points, axis=0)
    middle = (mesh.points.max(axis=0) + mesh.points.min(axis=0)) / 2.0
    smaller = np.maximum(1.0 - 2.0 * TOUCHING / np.maximum(extent, TOUCHING), 0.0)
    points = middle + (mesh.points - middle) * smaller
    yield body.name, points @ body.pose[:3, :3].T + body.pose[:3, 3]


def _near(first: FloatArray, second: FloatArray) -> bool:
    """Whether the boxes along the axes overlap."""
    apart = (first.min(axis=0) > second.max(axis=0)) | (second.min(axis=0) > first.max(axis=0))
    return not bool(apart.any())


def separable(first: FloatArray, second: FloatArray) -> bool:
    """Whether a plane lies between points (V, 3) and (W, 3): a linear programme for its normal n, offset t
    and the distance m from both, with all components of n within 1.
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
