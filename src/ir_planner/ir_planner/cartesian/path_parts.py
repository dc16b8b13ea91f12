"""Parts of a tool path: lines, arcs and splines over arc length, with orientations."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

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
from ir_planner.curves import RotationSpline, rotation_of, rotation_vector, turn_of
from ir_planner.errors import RequestError
from ir_values.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

# Where a tool goes, as curves over their arc length: straight lines, arcs, splines through
# places.

STRAIGHT = 1e-6  # m: three places nearer to a line than this are no circle
_PER_PIECE = 24  # samples of a spline's speed between two of its knots
_NEWTON_STEPS = 5


class PlaceCurve(Protocol):
    """Places over the arc length s in [0, length] m."""

    @property
    def length(self) -> float:
        """m."""

    @property
    def breaks(self) -> FloatArray:
        """Arc lengths (K,) between which the curve is smooth, both ends included [m]."""

    @property
    def curvature(self) -> float:
        """A bound of it, all along [1/m]."""

    def at(self, s: FloatArray) -> FloatArray:
        """Places (M, 3) m at s (M,)."""

    def tangent(self, s: FloatArray) -> FloatArray:
        """Unit tangents (M, 3) at s (M,)."""


@dataclass(frozen=True, eq=False)
class Line:
    """From start to end, (3,) each [m]."""

    start: FloatArray
    end: FloatArray

    @cached_property
    def length(self) -> float:
        """m."""
        return float(portable.norm(self.end - self.start))

    @property
    def curvature(self) -> float:
        """None."""
        return 0.0

    @property
    def breaks(self) -> FloatArray:
        """Both ends (2,) [m]."""
        return np.array([0.0, self.length])

    def at(self, s: FloatArray) -> FloatArray:
        """Places (M, 3) m at s (M,)."""
        return np.asarray(self.start + np.asarray(s)[:, None] * self._direction)

    def tangent(self, s: FloatArray) -> FloatArray:
        """Unit tangents (M, 3) at s (M,)."""
        return np.broadcast_to(self._direction, (len(s), 3))

    @cached_property
    def _direction(self) -> FloatArray:
        if self.length == 0.0:
            return np.zeros(3)
        return np.asarray((self.end - self.start) / self.length)


TURN_LENGTH = 0.25  # m that a rad of turning in place counts along a path


@dataclass(frozen=True, eq=False)
class Still:
    """One place (3,) [m], while the tool turns over `length` m."""

    place: FloatArray
    length: float

    @property
    def curvature(self) -> float:
        """None."""
        return 0.0

    @property
    def breaks(self) -> FloatArray:
        """Both ends (2,) [m]."""
        return np.array([0.0, self.length])

    def at(self, s: FloatArray) -> FloatArray:
        """Places (M, 3) m at s (M,)."""
        return np.broadcast_to(self.place, (len(s), 3))

    def tangent(self, s: FloatArray) -> FloatArray:
        """No direction: zeros (M, 3)."""
        return np.zeros((len(s), 3))


@dataclass(frozen=True, eq=False)
class Arc:
    """Places centre + cos(phi) radius + sin(phi) across, (3,) each [m], for phi from 0 to angle
    [rad].
    """

    centre: FloatArray
    radius: FloatArray
    across: FloatArray
    angle: float

    @cached_property
    def length(self) -> float:
        """m."""
        return abs(self.angle) * float(portable.norm(self.radius))

    @property
    def curvature(self) -> float:
        """That of the circle, all along [1/m]."""
        return 1.0 / float(portable.norm(self.radius))

    @property
    def breaks(self) -> FloatArray:
        """Both ends (2,) [m]."""
        return np.array([0.0, self.length])

    def at(self, s: FloatArray) -> FloatArray:
        """Places (M, 3) m at s (M,)."""
        turned = np.asarray(s)[:, None] * self._rate
        return np.asarray(
            self.centre + portable.cos(turned) * self.radius + portable.sin(turned) * self.across
        )

    def tangent(self, s: FloatArray) -> FloatArray:
        """Unit tangents (M, 3) at s (M,)."""
        turned = np.asarray(s)[:, None] * self._rate
        return np.asarray(
            (portable.cos(turned) * self.across - portable.sin(turned) * self.radius) * self._rate
        )

    @property
    def _rate(self) -> float:
        """rad per m."""
        return self.angle / self.length if self.length > 0.0 else 0.0


def arc_through(
    start: FloatArray, via: FloatArray, end: FloatArray, angle: float | None = None
) -> Arc | None:
    """The circle through three places (3,) [m], up to the end or to an angle [rad]; None where they
    lie on a line, or the end where the start is.
    """
    a = via - start
    b = end - start
    normal = np.cross(a, b)
    size = float(portable.matmul(normal, normal))
    nearest = min(float(portable.matmul(a, a)), float(portable.matmul(b, b)))
    if nearest < STRAIGHT * STRAIGHT or size < np.square(STRAIGHT * portable.norm(b)):
        return None
    centre = start + np.cross(
        float(portable.matmul(a, a)) * b - float(portable.matmul(b, b)) * a, normal
    ) / (2.0 * size)
    radius = start - centre
    across = np.cross(normal / np.sqrt(size), radius)
    if angle is None:
        reach = end - centre
        angle = float(
            portable.arctan2(portable.matmul(reach, across), portable.matmul(reach, radius))
        ) % (2.0 * np.pi)
    return Arc(centre, radius, across, angle)


class Through:
    """The interpolating spline through places (N, 3) m, over its own arc length: cubic, its second
    derivative is continuous.
    """

    def __init__(self, places: FloatArray) -> None:
        steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
        u = np.concatenate([[0.0], np.cumsum(steps)])
        self._curve = portable.interpolating_spline(u, places, min(3, len(u) - 1))
        self._arc = ArcLength(np.unique(self._curve.t), self._speed)
        self.at_points = self._arc.of(u)  # arc length at each place (N,)
        self.length = self._arc.length

    @property
    def breaks(self) -> FloatArray:
        """Arc lengths (K,) of the spline's knots [m]."""
        return self._arc.of(np.unique(self._curve.t))

    @cached_property
    def curvature(self) -> float:
        """A bound of it [1/m]: |p''| / |p'|^2, of which p'' is linear between knots, so largest at
        an end of each part of a piece, and p' is shorter than at both ends by half of what p''
        makes of it at most.
        """
        u = self._arc.samples
        bent = np.linalg.norm(self._curve(u, nu=2), axis=1)
        bent = np.maximum(bent[1:], bent[:-1])
        speed = self._speed(u)
        least = np.minimum(speed[1:], speed[:-1]) - 0.5 * bent * np.diff(u)
        if least.min() <= 0.0:
            return np.inf
        return float((bent / (least * least)).max())

    def at(self, s: FloatArray) -> FloatArray:
        """Places (M, 3) m at s (M,)."""
        return np.asarray(self._curve(self._arc.inverse(s)))

    def tangent(self, s: FloatArray) -> FloatArray:
        """Unit tangents (M, 3) at s (M,)."""
        slope = self._curve(self._arc.inverse(s), nu=1)
        return np.asarray(slope / np.linalg.norm(slope, axis=1)[:, None])

    def _speed(self, u: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(self._curve(u, nu=1), axis=1))


class ArcLength:
    """Arc length over a parameter u, and back: speed(u) = |dp/du| is smooth between `breaks`
    (K,).
    """

    def __init__(self, breaks: FloatArray, speed: _Speed) -> None:
        share = np.linspace(0.0, 1.0, _PER_PIECE + 1)[:-1]
        u = (breaks[:-1, None] + share * np.diff(breaks)[:, None]).ravel()
        self._u = np.append(u, breaks[-1])
        self._speed: BSpline = portable.interpolating_spline(self._u, speed(self._u), 3)
        self._length: BSpline = self._speed.antiderivative()
        self._offset = float(self._length(breaks[0]))
        self._s = np.asarray(self._length(self._u)) - self._offset
        self.length = float(self._s[-1])

    @property
    def samples(self) -> FloatArray:
        """Parameters (M,), the breaks among them, so dense that the speed is known between."""
        return self._u

    def of(self, u: FloatArray) -> FloatArray:
        """Arc lengths (M,) m at u (M,)."""
        return np.asarray(self._length(u)) - self._offset

    def inverse(self, s: FloatArray) -> FloatArray:
        """Parameters u (M,) at arc lengths s (M,) m."""
        u = np.interp(s, self._s, self._u)
        for _ in range(_NEWTON_STEPS):
            u = np.clip(u - (self.of(u) - s) / self._speed(u), self._u[0], self._u[-1])
        return np.asarray(u)


class _Speed(Protocol):
    def __call__(self, u: FloatArray) -> FloatArray: ...


# Orientations along one part of a tool's path: turning evenly, through poses, or with the path.


@dataclass(frozen=True)
class RotationRates:
    """Bounds of a rotation's derivatives along a path, |R'| [rad/m] and |R''| [rad/m^2], as 1 /
    sqrt(2) of
    their Frobenius norms: of turning about one axis that is the angle's rate.
    """

    first: float = 0.0
    second: float = 0.0

    def then(self, other: RotationRates) -> RotationRates:
        """Of the product of two rotations."""
        return RotationRates(
            self.first + other.first, self.second + other.second + 2.0 * self.first * other.first
        )


@dataclass(frozen=True, eq=False)
class Evenly:
    """From the rotation `start` (3, 3), turning by `turn` (3,) rad (in the tool's frame) over
    `length` m.
    """

    start: FloatArray
    turn: FloatArray
    length: float

    @staticmethod
    def between(start: FloatArray, end: FloatArray, length: float) -> Evenly:
        """The shortest turn between rotations (3, 3)."""
        return Evenly(start, rotation_vector(portable.matmul(start.T, end)), length)

    def at(self, s: FloatArray) -> FloatArray:
        """Rotations (M, 3, 3) at s (M,) m."""
        if not self.turn.any():
            return np.broadcast_to(self.start, (len(s), 3, 3))
        share = np.asarray(s)[:, None] / self.length
        return portable.matmul(self.start, rotation_of(share * self.turn))

    @property
    def rates(self) -> RotationRates:
        """How fast it turns."""
        rate = float(portable.norm(self.turn)) / self.length
        return RotationRates(rate, rate * rate)


class ThroughPoses:
    """The rotation spline through rotations (N, 3, 3) at s (N,) m: its acceleration is
    continuous.
    """

    def __init__(self, s: FloatArray, rotations: FloatArray) -> None:
        self._spline = RotationSpline(s, rotations)
        self._end = float(s[-1])

    def at(self, s: FloatArray) -> FloatArray:
        """Rotations (M, 3, 3) at s (M,) m."""
        return self._spline(np.clip(s, 0.0, self._end))

    @cached_property
    def rates(self) -> RotationRates:
        """How fast it turns: in each piece R = R_k exp(v) with a cubic v, so that |R'| <= |v'| and
        |R''| <= |v''| + 3/2 |v'|^2.
        """
        cubic, square, line = self._spline.cubics[:3]
        h = np.diff(self._spline.x)[:, None]
        second = [2.0 * square, 2.0 * square + 6.0 * cubic * h]
        first = [line, line + 2.0 * square * h + 3.0 * cubic * (h * h)]
        bulge = h[:, 0] ** 2 / 8.0 * np.linalg.norm(6.0 * cubic, axis=1)
        rate = np.max([np.linalg.norm(one, axis=1) for one in first], axis=0) + bulge
        bend = np.max([np.linalg.norm(one, axis=1) for one in second], axis=0)
        return RotationRates(float(rate.max()), float((bend + 1.5 * (rate * rate)).max()))


def rates_of(angle: BSpline) -> RotationRates:
    """Of turning about one axis by a spline, by the hulls of its derivatives' control points."""
    first, second = (float(np.abs(angle.derivative(nu).c).max()) for nu in (1, 2))
    return RotationRates(first, second + first * first)


def turn_between(first: FloatArray, second: FloatArray) -> float:
    """Angle [rad] between two rotations (3, 3)."""
    return float(turn_of(portable.matmul(first.T, second)))


def about_tool(angle: FloatArray) -> FloatArray:
    """Rotations (M, 3, 3) by angles (M,) rad about the tool's axis, x."""
    c = portable.cos(angle)
    s = portable.sin(angle)
    turned = np.zeros((len(angle), 3, 3))
    turned[:, 0, 0] = 1.0
    turned[:, 1, 1] = c
    turned[:, 2, 2] = c
    turned[:, 1, 2] = -s
    turned[:, 2, 1] = s
    return turned


# The parts of a tool's path: what a request's segments, approach and retract draw, each by
# itself.

SHORTEST = 1e-4  # m: of a part, and between the points of a spline
TURN_SPEED = 0.5  # rad/s of a turn in place for which none is asked
_LEAST_TURN = 1e-3  # rad of a turn in place
FARTHEST = 100.0  # m: of any coordinate, and the longest path
_ROUNDED = 1.0 - 1e-6  # what differences of places round
_OPPOSITE = np.radians(179.0)  # beyond, the shortest turn isn't known


@dataclass(frozen=True, eq=False)
class PathPart:
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
