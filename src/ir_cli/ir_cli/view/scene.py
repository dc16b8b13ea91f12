"""What the page draws of a cell: its surfaces as in the report, stations, reach, and a motion."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from scipy.spatial import ConvexHull

from ir_description import Cell, RobotModel
from ir_kernels import Chain
from ir_msgs_py.savings import Side
from ir_recorder.report.cell_scene import matrix
from ir_recorder.report.data import side_content
from ir_recorder.report.motion_scene import failed_scene
from ir_recorder.report.series import Json, floats
from ir_values.arrays import FloatArray

# The outline of what the tool reaches.

POSTURES = 20_000
"""Drawn within the joint limits; more widen the outline by less than a centimetre."""
MERIDIANS = 8
_RING = 72


def reach_lines(cell: Cell) -> FloatArray:
    """Pieces (M, 2, 3) [m] in the base's frame: the convex outline in planes through axis 1, and
    its widest circle. Every place of the tcp of the drawn postures lies within; not every place
    within is reached.
    """
    return _reach_lines(cell.robot, tuple(cell.tcp.ravel().tolist()))


@lru_cache(maxsize=4)
def _reach_lines(robot: RobotModel, tcp: tuple[float, ...]) -> FloatArray:
    """Ends (L, 2, 3) [m] of lines around all that the tcp reaches in random postures: the outline
    of its half plane through axis 1, turned about this axis, and a ring where it is widest.

    tcp: pose (4, 4) in the last link's frame, row by row.
    """
    q = np.random.default_rng(0).uniform(
        robot.position_min, robot.position_max, (POSTURES, robot.n)
    )
    tool = np.array(tcp).reshape(4, 4)
    axis_place = robot.joint_origin[0][:3, 3]
    places = Chain(robot, np.eye(4), tool).tcp_poses(q)[:, :3, 3] - axis_place
    radius = np.hypot(places[:, 0], places[:, 1])
    height = places[:, 2]
    ahead = np.stack([radius, height], axis=1)
    behind = np.stack([-radius, height], axis=1)
    both = np.concatenate([ahead, behind])
    outline = both[ConvexHull(both).vertices]
    closed = np.concatenate([outline, outline[:1]])
    lines = []
    for angle in np.arange(MERIDIANS // 2) * 2.0 * np.pi / MERIDIANS:
        direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        points = closed[:, :1] * direction + closed[:, 1:] * np.array([0.0, 0.0, 1.0])
        lines.append(np.stack([points[:-1], points[1:]], axis=1))
    widest_radius, widest_height = outline[int(np.argmax(outline[:, 0]))]
    turn = np.linspace(0.0, 2.0 * np.pi, _RING + 1)
    x = widest_radius * np.cos(turn)
    y = widest_radius * np.sin(turn)
    ring = np.stack([x, y, np.full(_RING + 1, widest_height)], axis=1)
    lines.append(np.stack([ring[:-1], ring[1:]], axis=1))
    return np.concatenate(lines) + axis_place


# The content of the page's /scene.


def still_content(cell: Cell) -> bytes:
    """The cell with its robot at machine home."""
    return _packed(cell, {"end": 1.0, "scene": failed_scene(cell)})


def planned_content(side: Side, cell: Cell) -> bytes:
    """The cell with a planned motion."""
    return _packed(cell, side_content(side, cell))


def recorded_content(content: Mapping[str, Json], cell: Cell) -> bytes:
    """The cell with a recorded motion: content of the report's page."""
    return _packed(cell, content)


KEPT = ("end", "rests", "lanes", "power", "clearance", "peak")


def _packed(cell: Cell, content: Mapping[str, Json]) -> bytes:
    """The scene for the viewer as JSON, with what it draws of a cell beside a recording's: reach,
    stations, joint ranges.
    """
    scene = content["scene"]
    if not isinstance(scene, dict):  # a recording without joint states
        scene = failed_scene(cell)
    base = cell.base_pose
    reach = reach_lines(cell) @ base[:3, :3].T + base[:3, 3]
    robot = cell.robot
    low, high = robot.in_people_units(np.array([robot.position_min, robot.position_max]))
    joints: list[Json] = [
        {
            "name": robot.axis_label(k),
            "unit": robot.unit(k),
            "low": round(float(low[k]), 3),
            "high": round(float(high[k]), 3),
        }
        for k in range(robot.n)
    ]
    stations: list[Json] = [
        {
            "name": station.name,
            "pose": matrix(station.pose),
            "approach": round(station.approach_distance, 4),
        }
        for station in cell.stations
    ]
    drawn = {**scene, "stations": stations, "reach": floats(reach.ravel())}
    kept = {key: content[key] for key in KEPT if key in content}
    bound = content.get("safetyDistance", 0.02)
    text = json.dumps(
        {**kept, "safetyDistance": bound, "scene": drawn, "joints": joints},
        separators=(",", ":"),
        allow_nan=False,
    )
    return text.encode()
