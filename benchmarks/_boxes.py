"""Cells full of boxes: a thousand of them at random around the robot, and movements between free states.

The boxes stay out of a column around the robot's base, where nothing could move. Start and goal are drawn
until they keep CLEARANCE and their tools are APART; whether a path joins them is not known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from _regional_tasks import Task, scene_of_cell

from ir_description import Body, Cell, Equipment, Zone, load_cell
from ir_msgs_py.arrays import FloatArray
from ir_planner.scene.planning_scene import PlanningScene

BOXES = 1000
REACH, HEIGHT, COLUMN = 3.2, 3.4, 0.7  # m: around the base, above the floor, and what stays empty
EDGES = (0.05, 0.22)  # m
MARGIN, CLEARANCE = 0.01, 0.015  # m: S_m of the movements, and what their ends keep at least
APART = 0.8  # m between the tools at start and goal
DRAWN = 4096  # configurations at a time


def boxes_cell(seed: int, count: int = BOXES) -> Cell:
    """The open cell with `count` boxes in place of its machines."""
    rng = np.random.default_rng([seed, count])
    bodies = []
    while len(bodies) < count:
        x, y = rng.uniform(-REACH, REACH, 2)
        if not COLUMN < np.hypot(x, y) < REACH:
            continue
        pose = np.eye(4)
        pose[:3, :3] = _turned(rng)
        pose[:3, 3] = x, y, rng.uniform(0.0, HEIGHT)
        bodies.append(Body(f"box{len(bodies)}", "box", pose, rng.uniform(*EDGES, 3)))
    around = np.eye(4)
    around[2, 3] = 0.5 * HEIGHT
    zone = Zone("OPEN", around, np.array([2 * REACH, 2 * REACH, HEIGHT]))
    clutter = Equipment("clutter", np.eye(4), tuple(bodies), zone)
    cell = load_cell("open")
    return replace(
        cell, name=f"boxes_{seed}", equipment=(clutter,), stations=(), program=(), signals=(), tasks=()
    )


def boxes_tasks(seed: int, count: int) -> list[Task]:
    """`count` tasks in the cell of a seed."""
    scene = scene_of_cell(boxes_cell(seed))
    rng = np.random.default_rng([seed, 1])
    found: list[Task] = []
    free = _free(scene, rng)
    for k in range(len(free) - 1):
        start, goal = free[k], free[k + 1]
        tools = scene.chain.tcp_poses(np.stack([start, goal]))[:, :3, 3]
        if np.linalg.norm(tools[1] - tools[0]) > APART and len(found) < count:
            found.append(Task(scene.cell.name, str(len(found)), scene, start, goal, MARGIN))
    return found


def _free(scene: PlanningScene, rng: np.random.Generator) -> FloatArray:
    """Free configurations (F, n)."""
    robot = scene.cell.robot
    q = rng.uniform(robot.position_min, robot.position_max, (DRAWN, robot.n))
    return q[scene.collision.is_free(q, np.full(len(scene.collision.pairs), CLEARANCE))]


def _turned(rng: np.random.Generator) -> FloatArray:
    """A rotation (3, 3), evenly drawn."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0.0 else q[:, ::-1]
