"""The parts of a tool's path: what a request's segments, approach and retract draw, each by itself.

A part that draws nothing, or whose direction of turning is open, is refused.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from ir_kernels import portable
from ir_msgs_py.cartesian import (
    CIRCLE,
    CONSTANT,
    LENGTH_MAX,
    LINE,
    TANGENT,
    CartesianPath,
    CartesianSegment,
)
from ir_msgs_py.status import StatusCode
from ir_planner.cartesian.orientations import Evenly, ThroughPoses, turn_between
from ir_planner.cartesian.place_curves import (
    STRAIGHT,
    TURN_LENGTH,
    Line,
    PlaceCurve,
    Still,
    Through,
    arc_through,
)
from ir_planner.errors import RequestError
from ir_values.arrays import FloatArray

SHORTEST = 1e-4  # m: of a part, and between the points of a spline
TURN_SPEED = 0.5  # rad/s of a turn in place for which none is asked
_LEAST_TURN = 1e-3  # rad of a turn in place
FARTHEST = 100.0  # m: of any coordinate, and the longest path
_ROUNDED = 1.0 - 1e-6  # what differences of places round
_OPPOSITE = np.radians(179.0)  # beyond, the shortest turn isn't known


@dataclass(frozen=True, eq=False)
class PathPart:
    """A curve of the tool with its orientations; speed [m/s]: what is asked for; kept: whether it
    has to be kept, which it needn't on an approach and a retract.
    """

    name: str
    places: PlaceCurve
    turning: Evenly | ThroughPoses
    speed: float
    kept: bool = True

    @property
    def length(self) -> float:
        """m."""
        return self.places.length

    @property
    def in_place(self) -> bool:
        """Whether the tool only turns: its speed is TURN_LENGTH times that of the turn."""
        return isinstance(self.places, Still)

    def ends(self) -> tuple[FloatArray, FloatArray]:
        """Rotations (3, 3) at the beginning and at the end."""
        first, last = self.turning.at(np.array([0.0, self.length]))
        return first, last


def parts_of(path: CartesianPath) -> tuple[PathPart, ...]:
    """Approach, segments and retract of a path. Raises RequestError for what draws nothing."""
    parts: list[PathPart] = []
    here = np.array(path.start)
    _check_place(here, "start_pose")
    for k, segment in enumerate(path.segments):
        name = f"segments[{k}]"
        part = _segment(segment, here, name, path)
        parts.append(part)
        here = np.array(segment.poses[-1])
        here[:3, :3] = part.ends()[1]
        here[:3, 3] = part.places.at(np.array([part.length]))[0] if part.in_place else here[:3, 3]
    total = sum(part.length for part in parts)
    if total > FARTHEST:
        raise _refused(f"the path is {total:g} m long: it must be at most {FARTHEST:g} m")
    before = (
        (_along_axis(path.start, -path.approach, path, "approach"),) if path.approach > 0.0 else ()
    )
    after = (_along_axis(here, -path.retract, path, "retract"),) if path.retract > 0.0 else ()
    return (*before, *parts, *after)


def _segment(
    segment: CartesianSegment, here: FloatArray, name: str, path: CartesianPath
) -> PathPart:
    poses = [here, *(np.array(pose) for pose in segment.poses)]
    for k, pose in enumerate(poses[1:]):
        _check_place(pose, f"{name}.poses[{k}]")
    if path.orientation == CONSTANT:
        for pose in poses[1:]:
            pose[:3, :3] = path.start[:3, :3]
    places = np.array([pose[:3, 3] for pose in poses])
    turning = segment.rotation_speed or path.rotation_speed
    if segment.kind == LINE and portable.norm(places[1] - places[0]) <= STRAIGHT:
        return _in_place(poses, name, turning or TURN_SPEED, path)
    _check_steps(places, name)
    part = _moving(segment, poses, name, segment.tool_speed or path.tool_speed)
    most = part.turning.rates.first
    return replace(part, speed=min(part.speed, turning / most)) if turning * most > 0.0 else part


def _in_place(poses: list[FloatArray], name: str, speed: float, path: CartesianPath) -> PathPart:
    """The turn between two poses (4, 4) at one place, at `speed` rad/s."""
    if path.orientation == TANGENT:
        raise _refused(f"{name} turns in place: with orientation {TANGENT} the path says how")
    first, last = (pose[:3, :3] for pose in poses)
    _check_turns(poses, name)
    turn = turn_between(first, last)
    if turn < _LEAST_TURN:
        raise _refused(
            f"{name}.poses[0] is where the pose before it is, turned by {turn:.3g} rad: it must be "
            f"at least {SHORTEST:g} m from it, or turned by {_LEAST_TURN:g} rad"
        )
    length = TURN_LENGTH * turn
    turning = Evenly.between(first, last, length)
    return PathPart(name, Still(poses[0][:3, 3], length), turning, TURN_LENGTH * speed)


def _moving(
    segment: CartesianSegment, poses: list[FloatArray], name: str, speed: float
) -> PathPart:
    """A segment in which the tool moves: its curve in space, and how the orientation turns along
    it. Raises RequestError where three points make no circle.
    """
    places = np.array([pose[:3, 3] for pose in poses])
    curve: PlaceCurve
    if segment.kind == LINE:
        curve = Line(places[0], places[1])
    elif segment.kind == CIRCLE:
        arc = arc_through(*places)
        if arc is None:
            raise _refused(
                f"{name}: start, the point between and the end lie on a line, or two of them are "
                "one place: that is no circle; a whole turn is two arcs"
            )
        curve = arc
        poses = [poses[0], poses[2]]
    else:
        curve = Through(places)
    _check_turns(poses, name)
    if isinstance(curve, Through) and len(poses) > 2:
        rotations = np.array([pose[:3, :3] for pose in poses])
        return PathPart(name, curve, ThroughPoses(curve.at_points, rotations), speed)
    return PathPart(
        name, curve, Evenly.between(poses[0][:3, :3], poses[-1][:3, :3], curve.length), speed
    )


def _along_axis(pose: FloatArray, by: float, path: CartesianPath, name: str) -> PathPart:
    """The line between a pose (4, 4) and the place `by` m along the tool's axis."""
    ends = [pose[:3, 3] + by * pose[:3, 0], pose[:3, 3]]
    if abs(by) < SHORTEST:
        raise _refused(
            f"{name} is {abs(by):g} m: it must be 0 m or in [{SHORTEST:g}, {LENGTH_MAX:g}] m"
        )
    first, last = ends if name == "approach" else ends[::-1]
    line = Line(np.array(first), np.array(last))
    return PathPart(
        name, line, Evenly(np.array(pose[:3, :3]), np.zeros(3), line.length), path.tool_speed, False
    )


def _check_place(pose: FloatArray, name: str) -> None:
    worst = float(np.abs(pose[:3, 3]).max())
    if worst > FARTHEST:
        raise _refused(f"{name} lies at {worst:g} m: it must be within {FARTHEST:g} m")


def _check_steps(places: FloatArray, name: str) -> None:
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    k = int(np.argmin(steps))
    if steps[k] < SHORTEST * _ROUNDED:
        raise _refused(
            f"{name}.poses[{k}] is {steps[k]:g} m from the pose before it: it must be at least "
            f"{SHORTEST:g} m"
        )


def _check_turns(poses: list[FloatArray], name: str) -> None:
    for before, after in itertools.pairwise(poses):
        turn = turn_between(before[:3, :3], after[:3, :3])
        if turn > _OPPOSITE:
            raise _refused(
                f"{name} turns the tool by {np.degrees(turn):.1f} deg from one pose to the next: "
                f"it must be at most {np.degrees(_OPPOSITE):g} deg, or the direction is open; "
                "give a pose between"
            )


def _refused(sentence: str) -> RequestError:
    return RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, sentence)
