"""How far the tool gets: the outline of its places over all postures, as lines around axis 1."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from ir_description import Cell
from ir_kernels import Chain
from ir_msgs_py.arrays import FloatArray

POSTURES = 20_000
"""Drawn within the joint limits; more widen the outline by less than a centimetre."""
MERIDIANS = 8
_RING = 72


def reach_lines(cell: Cell) -> FloatArray:
    """Pieces (M, 2, 3) [m] in the base's frame: the convex outline in planes through axis 1, and
    its widest circle. Every place of the tcp of the drawn postures lies within; not every place
    within is reached.
    """
    robot = cell.robot
    q = np.random.default_rng(0).uniform(
        robot.position_min, robot.position_max, (POSTURES, robot.n)
    )
    places = Chain(robot, np.eye(4), cell.tcp).tcp_poses(q)[:, :3, 3] - robot.joint_origin[0][:3, 3]
    radius = np.hypot(places[:, 0], places[:, 1])
    both = np.concatenate([np.stack([s * radius, places[:, 2]], axis=1) for s in (1.0, -1.0)])
    outline = both[ConvexHull(both).vertices]
    closed = np.concatenate([outline, outline[:1]])
    lines = []
    for angle in np.arange(MERIDIANS // 2) * 2.0 * np.pi / MERIDIANS:
        direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        points = closed[:, :1] * direction + closed[:, 1:] * np.array([0.0, 0.0, 1.0])
        lines.append(np.stack([points[:-1], points[1:]], axis=1))
    widest = outline[int(np.argmax(outline[:, 0]))]
    turn = np.linspace(0.0, 2.0 * np.pi, _RING + 1)
    ring = np.stack(
        [widest[0] * np.cos(turn), widest[0] * np.sin(turn), np.full(_RING + 1, widest[1])], 1
    )
    lines.append(np.stack([ring[:-1], ring[1:]], axis=1))
    return np.concatenate(lines) + robot.joint_origin[0][:3, 3]
