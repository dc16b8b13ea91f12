"""Cells with any number of forbidden zones, open, semi-closed or closed, and movements among
them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
from _paper_peers import Question
from _regional_tasks import scene_of_cell

from ir_description import Body, Cell, Equipment, load_cell
from ir_description.cell import Zone
from ir_description.cell.zones import ZoneKind
from ir_description.poses import pose_of
from ir_values.arrays import FloatArray

KINDS = ("OPEN", "SEMI_CLOSED", "CLOSED")
MOST = 100
# m: around the base, and up to where machines stand on pedestals
NEAR = 1.1
FAR = 2.6
HIGH = 1.4
EDGES = (0.3, 0.6)  # m of a machine
WALL = 0.03  # m
# m: S_m, what ends keep at least, and how far the tools are apart
MARGIN = 0.01
CLEARANCE = 0.015
APART = 0.8
_DRAWN = 2048  # configurations at a time
# Walls of a machine by its type, as the axis that they are normal to and the side: a solid block is
# reached from everywhere; one with an open front from one side; a bin from above alone.
_WALLS = {
    "SEMI_CLOSED": ((0, 1), (1, -1), (1, 1), (2, -1), (2, 1)),
    "CLOSED": ((0, -1), (0, 1), (1, -1), (1, 1), (2, -1)),
}


def zones_cell(kind: str, count: int, seed: int) -> Cell:
    """The cell `open` with `count` machines of a type; those of a smaller cell stand in every
    larger one.
    """
    rng = np.random.default_rng([seed, KINDS.index(kind), 0])
    cell = load_cell("open")
    machines = []
    for k in range(MOST):
        angle = rng.uniform(-np.pi, np.pi)
        radius = rng.uniform(NEAR, FAR)
        size = rng.uniform(*EDGES, 3)
        height = rng.uniform(0.0, HIGH)
        place = cell.base_pose[:3, 3] + [radius * np.cos(angle), radius * np.sin(angle), 0.0]
        place[2] = height + 0.5 * size[2]
        machines.append(_machine(f"machine_{k}", kind, pose_of(place, _about_z(angle)), size))
    taken = tuple(machines[:count])
    return replace(
        cell,
        name=f"{kind.lower()}_{count}",
        equipment=taken,
        stations=(),
        program=(),
        signals=(),
        tasks=(),
    )


def _machine(name: str, kind: str, pose: FloatArray, size: FloatArray) -> Equipment:
    if kind == "OPEN":
        bodies = [Body(f"{name}_block", "box", np.eye(4), size)]
    else:
        bodies = []
        for axis, side in _WALLS[kind]:
            walls = size.copy()
            middle = np.zeros(3)
            walls[axis] = WALL
            middle[axis] = 0.5 * side * (size[axis] - WALL)
            bodies.append(
                Body(f"{name}_wall_{axis}{'-+'[side > 0]}", "box", pose_of(middle), walls)
            )
    return Equipment(name, pose, tuple(bodies), Zone(cast("ZoneKind", kind), np.eye(4), size))


def _about_z(angle: float) -> FloatArray:
    return np.array(
        [[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]]
    )


def questions(
    kind: str, sizes: tuple[int, ...], count: int, seed: int
) -> list[dict[int, Question]]:
    """`count` movements, each between the same configurations in every size of the cell: free ends
    in the largest, where the straight movement is not free.
    """
    scenes = {size: scene_of_cell(zones_cell(kind, size, seed)) for size in sizes}
    crowded = scenes[max(sizes)]
    rng = np.random.default_rng([seed, KINDS.index(kind), 1])
    robot = crowded.cell.robot
    found: list[dict[int, Question]] = []
    kept = np.full(len(crowded.collision.pairs), CLEARANCE)
    while len(found) < count:
        q = rng.uniform(robot.position_min, robot.position_max, (_DRAWN, robot.n))
        q = q[crowded.collision.is_free(q, kept)]
        tools = crowded.chain.tcp_poses(q)[:, :3, 3]
        for k in range(0, len(q) - 1, 2):
            asked = {n: Question(scene, q[k], q[k + 1], MARGIN) for n, scene in scenes.items()}
            apart = np.linalg.norm(tools[k + 1] - tools[k]) > APART
            if len(found) < count and apart and not asked[max(sizes)].straight_is_free():
                found.append(asked)
    return found
