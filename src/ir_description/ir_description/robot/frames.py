"""The tree of frames from the cell to the tool centre point: which hangs on which, and where."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ir_description.robot.load import Load
from ir_description.robot.robot import RobotModel
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.names import WORLD_FRAME

TOOL0 = np.array(
    [[0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""Pose (4, 4) of tool0 at the flange: its z points out."""


class FramePose(NamedTuple):
    """A frame and its pose (4, 4) [m] in its parent."""

    parent: str
    name: str
    pose: FloatArray


def fixed_frames(
    robot: RobotModel, loads: Iterable[Load], tcp: FloatArray, base_pose: FloatArray
) -> tuple[FramePose, ...]:
    """Frames that no joint moves: base in the cell, flange, tool0, tcp (4, 4) and loads at the
    flange.
    """
    at = np.eye(4)
    return (
        FramePose(WORLD_FRAME, robot.link_names[0], base_pose),
        FramePose(robot.link_names[-1], "flange", at),
        FramePose("flange", "tool0", TOOL0),
        FramePose("flange", "tcp", tcp),
        *(FramePose("flange", f"load_{load.name}", at) for load in loads),
    )


def moving_frames(robot: RobotModel, link_poses: FloatArray) -> tuple[FramePose, ...]:
    """Frames of the joints, from the poses (n+1, 4, 4) of the links in any one frame."""
    names = robot.link_names
    return tuple(
        FramePose(names[i], names[i + 1], np.linalg.solve(link_poses[i], link_poses[i + 1]))
        for i in range(robot.n)
    )
