"""A path of the tool as a value: lines, circles and splines through poses, with the speed that is
kept along it. Names and defaults are those of ir_msgs/CartesianSegment and
ir_msgs/PlanCartesianMovement.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ir_values.argument_types import typed_methods
from ir_values.arrays import FloatArray, finite, one_of, read_only, set_field
from ir_values.errors import InvalidValueError

LINE = "line"
CIRCLE = "circle"
SPLINE = "spline"
KINDS = (LINE, CIRCLE, SPLINE)
GIVEN = "given"
CONSTANT = "constant"
TANGENT = "tangent"
ORIENTATIONS = (GIVEN, CONSTANT, TANGENT)
POSES_MAX = 2000  # of a path
# m/s
SPEED_MIN = 1e-4
SPEED_MAX = 10.0
# rad/s
ROTATION_SPEED_MIN = 1e-3
ROTATION_SPEED_MAX = 20.0
SPEED_TOLERANCE_MIN = 1e-4  # share of the speed
LENGTH_MAX = 10.0  # m: of an approach, a retract and a blending radius
_RIGID = 1e-6  # of a rotation
_POSES = {LINE: (1, 1), CIRCLE: (2, 2), SPLINE: (1, POSES_MAX)}


def _checked_within(value: float, low: float, high: float, name: str, unit: str = "") -> float:
    """A number that lies in a range. Raises InvalidValueError."""
    number = finite(value, name, unit)
    if not low <= number <= high:
        suffix = f" {unit}" if unit else ""
        raise InvalidValueError(
            f"{name} is {number:g}{suffix}: it must be in [{low:g}, {high:g}]{suffix}"
        )
    return number


def _rigid(value: FloatArray, name: str) -> FloatArray:
    """A pose (4, 4), read-only: a rotation and a place."""
    pose = read_only(value, name, (4, 4))
    rotation = pose[:3, :3]
    last = pose[3] - (0.0, 0.0, 0.0, 1.0)
    off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if max(off, float(np.abs(last).max())) > _RIGID or np.linalg.det(rotation) < 0.0:
        raise InvalidValueError(
            f"{name} is no rotation with a place: R R^T deviates from 1 by {off:.2g}, it must be "
            f"at most {_RIGID:g}, det R is {np.linalg.det(rotation):.3g}, it must be 1, or the "
            "last row isn't 0 0 0 1"
        )
    return pose


@typed_methods(InvalidValueError)
@dataclass(frozen=True, eq=False)
class CartesianSegment:
    """One part of a path; it begins where the part before it ends.

    poses (4, 4) [m] of the tcp in the cell. line: the end; circle: a point between and the end;
    spline: every point it passes. tool_speed [m/s] and rotation_speed [rad/s], 0: that of the path.
    Raises InvalidValueError.
    """

    kind: str
    poses: tuple[FloatArray, ...]
    tool_speed: float = 0.0
    rotation_speed: float = 0.0

    def __post_init__(self) -> None:
        one_of(self.kind, KINDS, "kind")
        fewest, most = _POSES[self.kind]
        if not fewest <= len(self.poses) <= most:
            wanted = f"{fewest}" if fewest == most else f"{fewest} to {most}"
            raise InvalidValueError(
                f"a {self.kind} has {len(self.poses)} poses: it must have {wanted}"
            )
        set_field(
            self, "poses", tuple(_rigid(pose, f"poses[{k}]") for k, pose in enumerate(self.poses))
        )
        if self.tool_speed != 0.0:
            set_field(
                self,
                "tool_speed",
                _checked_within(self.tool_speed, SPEED_MIN, SPEED_MAX, "tool_speed", "m/s"),
            )
        set_field(self, "rotation_speed", _rotation_speed(self.rotation_speed))


def _rotation_speed(value: float) -> float:
    """A speed [rad/s], or 0 where none is asked for."""
    if value == 0.0:
        return 0.0
    return _checked_within(value, ROTATION_SPEED_MIN, ROTATION_SPEED_MAX, "rotation_speed", "rad/s")


@typed_methods(InvalidValueError)
@dataclass(frozen=True, eq=False)
class CartesianPath:
    """Where the tool begins, (4, 4) [m] in the cell, its segments, and what is kept along them.

    tool_speed [m/s]; rotation_speed [rad/s]: a segment on which the tool would turn faster is
    driven so much slower, 0: none is asked for; speed_tolerance: share of it that may be lost,
    1: as slow as the axes need. blending_radius [m] around the corners between segments.
    orientation: of the poses (given), of the start (constant), or turning with the path about
    the tool's axis (tangent). free_angle [rad]: how far the tool may turn about its own axis,
    either way. approach, retract [m]: straight along the tool's axis. Raises InvalidValueError.
    """

    start: FloatArray
    segments: tuple[CartesianSegment, ...]
    tool_speed: float = 0.1
    speed_tolerance: float = 0.01
    blending_radius: float = 0.0
    orientation: str = GIVEN
    free_angle: float = 0.0
    approach: float = 0.0
    retract: float = 0.0
    rotation_speed: float = 0.0

    def __post_init__(self) -> None:
        set_field(self, "start", _rigid(self.start, "start"))
        set_field(self, "segments", tuple(self.segments))
        poses = sum(len(segment.poses) for segment in self.segments)
        if not 1 <= poses <= POSES_MAX:
            raise InvalidValueError(f"segments have {poses} poses: it must be 1 to {POSES_MAX}")
        one_of(self.orientation, ORIENTATIONS, "orientation")
        for name, low, high, unit in (
            ("tool_speed", SPEED_MIN, SPEED_MAX, "m/s"),
            ("speed_tolerance", SPEED_TOLERANCE_MIN, 1.0, ""),
            ("blending_radius", 0.0, LENGTH_MAX, "m"),
            ("free_angle", 0.0, math.pi + 1e-6, "rad"),
            ("approach", 0.0, LENGTH_MAX, "m"),
            ("retract", 0.0, LENGTH_MAX, "m"),
        ):
            set_field(self, name, _checked_within(getattr(self, name), low, high, name, unit))
        set_field(self, "rotation_speed", _rotation_speed(self.rotation_speed))
        turns = [self.rotation_speed, *(segment.rotation_speed for segment in self.segments)]
        if self.orientation == TANGENT and any(turns):
            raise InvalidValueError(
                f"rotation_speed is {max(turns):g} rad/s with orientation {TANGENT}: there the "
                "path says how fast the tool turns, it must be 0 rad/s"
            )
