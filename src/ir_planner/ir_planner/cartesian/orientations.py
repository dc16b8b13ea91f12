"""Orientations along one part of a tool's path: turning evenly, through poses, or with the path."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, RotationSpline

from ir_msgs_py.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Evenly:
    """From the rotation `start` (3, 3), turning by `turn` (3,) rad (in the tool's frame) over `length` m."""

    start: FloatArray
    turn: FloatArray
    length: float

    @staticmethod
    def between(start: FloatArray, end: FloatArray, length: float) -> "Evenly":
        """The shortest turn between rotations (3, 3)."""
        return Evenly(start, Rotation.from_matrix(start.T @ end).as_rotvec(), length)

    def at(self, s: FloatArray) -> FloatArray:
        """Rotations (M, 3, 3) at s (M,) m."""
        if not self.turn.any():
            return np.broadcast_to(self.start, (len(s), 3, 3))
        share = np.asarray(s)[:, None] / self.length
        return np.asarray(self.start @ Rotation.from_rotvec(share * self.turn).as_matrix())


class ThroughPoses:
    """The rotation spline through rotations (N, 3, 3) at s (N,) m: its acceleration is continuous."""

    def __init__(self, s: FloatArray, rotations: FloatArray) -> None:
        self._spline = RotationSpline(s, Rotation.from_matrix(rotations))
        self._end = float(s[-1])

    def at(self, s: FloatArray) -> FloatArray:
        """Rotations (M, 3, 3) at s (M,) m."""
        return np.asarray(self._spline(np.clip(s, 0.0, self._end)).as_matrix())


def turn_between(first: FloatArray, second: FloatArray) -> float:
    """Angle [rad] between two rotations (3, 3)."""
    return float(Rotation.from_matrix(first.T @ second).magnitude())


def about_tool(angle: FloatArray) -> FloatArray:
    """Rotations (M, 3, 3) by angles (M,) rad about the tool's axis, x."""
    c, s = np.cos(angle), np.sin(angle)
    turned = np.zeros((len(angle), 3, 3))
    turned[:, 0, 0] = 1.0
    turned[:, 1, 1] = turned[:, 2, 2] = c
    turned[:, 1, 2], turned[:, 2, 1] = -s, s
    return turned
