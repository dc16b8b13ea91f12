"""From where a browser looks first: at all machines and the robot, from above a corner."""

from __future__ import annotations

from typing import Any

import numpy as np

from ir_description import Cell

DIRECTION = np.array([0.72, -0.78, 0.55])
"""Of the eye from the middle of the cell."""
DISTANCE = 0.95
"""Of the eye, per diagonal of the cell."""
LEAST = 2.0  # m: of a diagonal, for a robot alone


def look_at(server: Any, cell: Cell) -> None:
    """The first view of browsers that open from now on; those that look already keep theirs."""
    base = cell.base_pose[:3, 3]
    points = [base, base + np.array([0.0, 0.0, 1.5])]
    bodies = [
        body
        for machine in cell.equipment
        for body in machine.world_bodies()
        if body.kind != "plane"
    ]
    points += [corner for body in bodies for corner in body.bounds()]
    low = np.min(points, axis=0)
    high = np.max(points, axis=0)
    middle = (low + high) / 2.0
    size = max(float(np.linalg.norm(high - low)), LEAST)
    server.initial_camera.look_at = middle
    server.initial_camera.position = middle + DISTANCE * size * DIRECTION / np.linalg.norm(
        DIRECTION
    )
