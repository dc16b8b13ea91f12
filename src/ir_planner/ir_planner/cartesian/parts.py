"""The parts of a tool's path: what a request's segments, approach and retract draw, each by
itself.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import CIRCLE, CONSTANT, LENGTH_MAX, LINE, CartesianPath, CartesianSegment
from ir_msgs_py.status import StatusCode
from ir_planner.cartesian.orientations import Evenly, ThroughPoses, turn_between
from ir_planner.cartesian.places import Line, PlaceCurve, Through, arc_through
from ir_planner.errors import RequestError

SHORTEST = 1e-4  # m: of a part, and between the points of a spline
FARTHEST = 100.0  # m: of any coordinate, and the longest path
_ROUNDED = 1.0 - 1e-6  # what differences of places round
_OPPOSITE = np.radians(179.0)  # beyond, the shortest turn isn't known


@dataclass(frozen=True, eq=False)
class Part:
    """A curve of the tool with its orientations, the speed that is asked for [m/s], and whether
    that has to
    be kept: on an approach and a retract it needn't.
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

    def ends(self) -> tuple[FloatArray, FloatArray]:
        """Rotations (3, 3) at the beginning and at the end."""
        first, last = self.turning.at(np.array([0.0, self.length]))
        return first, last


def parts_of(path: CartesianPath) -> tuple[Part, ...]:
    """Approach, segments and retract of a path. Raises RequestError for what draws nothing."""
    parts: list[Part] = []
    here = np.array(path.start)
    _check_place(here, "start_pose")
    for k, segment in enumerate(path.segments):
        name = f"segments[{k}]"
        part = _segment(segment, here, name, path)
        parts.append(part)
        here = np.array(segment.poses[-1])
        here[:3, :3] = part.ends()[1]
    total = sum(part.length for part in parts)
    if total > FARTHEST:
        raise _refused(f"the path is {total:g} m long: it must be at most {FARTHEST:g} m")
    before = (
        (_along_axis(path.start, -path.approach, path, "approach"),) if path.approach > 0.0 else ()
    )
    after = (_along_axis(here, -path.retract, path, "retract"),) if path.retract > 0.0 else ()
    return (*before, *parts, *after)


def _segment(segment: CartesianSegment, here: FloatArray, name: str, path: CartesianPath) -> Part:
    poses = [here, *(np.array(pose) for pose in segment.poses)]
    for k, pose in enumerate(poses[1:]):
        _check_place(pose, f"{name}.poses[{k}]")
    if path.orientation == CONSTANT:
        for pose in poses[1:]:
            pose[:3, :3] = path.start[:3, :3]
    places = np.array([pose[:3, 3] for pose in poses])
    _check_steps(places, name)
    speed = segment.tool_speed or path.tool_speed
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
        return Part(name, curve, ThroughPoses(curve.at_points, rotations), speed)
    return Part(
        name, curve, Evenly.between(poses[0][:3, :3], poses[-1][:3, :3], curve.length), speed
    )


def _along_axis(pose: FloatArray, by: float, path: CartesianPath, name: str) -> Part:
    """The line between a pose (4, 4) and the place `by` m along the tool's axis."""
    ends = [pose[:3, 3] + by * pose[:3, 0], pose[:3, 3]]
    if abs(by) < SHORTEST:
        raise _refused(
            f"{name} is {abs(by):g} m: it must be 0 m or in [{SHORTEST:g}, {LENGTH_MAX:g}] m"
        )
    first, last = ends if name == "approach" else ends[::-1]
    line = Line(np.array(first), np.array(last))
    return Part(
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
