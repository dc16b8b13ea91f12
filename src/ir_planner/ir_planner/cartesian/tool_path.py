"""A tool path over its arc length: parts in order, with rounded corners between them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ir_kernels import portable
from ir_msgs_py.cartesian import TANGENT, CartesianPath
from ir_msgs_py.status import Status, StatusCode
from ir_planner.cartesian.orientations import RotationRates, about_tool, rates_of
from ir_planner.cartesian.path_parts import PathPart
from ir_planner.cartesian.place_curves import ArcLength
from ir_planner.checks import FreeSpace
from ir_planner.curves import turn_of
from ir_planner.request import Context
from ir_values.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

# A path of the tool over its arc length: parts that follow each other, corners between them
# rounded.
#
# Within its radius around a corner the next part begins while the last one ends: the place is the
# sum of what both have covered. How much of each is covered rises by a polynomial whose fourth
# derivative is continuous, so curvature is too. Parts that meet almost tangentially, or where
# only the curvature or the turning of the tool jumps, are joined in the same manner within
# micrometres; at any other corner without a radius the tool stops.

_PER_ZONE = 3  # breaks of a rounded corner, between which the speed of the parameter is smooth
_SAME = 1e-9  # m
_ALONG_AXIS = np.radians(3.0)  # a path nearer to the tool's axis than this gives no heading


def covered(u: FloatArray, radius: float) -> FloatArray:
    """How much of the next part is covered at u (M,) m from a corner: 0 before -radius, u beyond
    radius.
    """
    y = np.clip((u + radius) / (2.0 * radius), 0.0, 1.0)
    inside = 2.0 * radius * portable.power(y, 5) * (7.0 + y * (-14.0 + y * (10.0 - 2.5 * y)))
    return np.where(u >= radius, u, inside)


def covering(u: FloatArray, radius: float) -> FloatArray:
    """The derivative of `covered` (M,)."""
    y = np.clip((u + radius) / (2.0 * radius), 0.0, 1.0)
    return np.asarray(portable.power(y, 4) * (35.0 + y * (-84.0 + y * (70.0 - 20.0 * y))))


def joint_bend(before: PathPart, after: PathPart, radius: float) -> float:
    """A bound [1/m] of the second derivative by u of the place within a radius [m] around a corner.

    There p'' = k1 c1'^2 + k2 c2'^2 + (t2 - t1) c'', with c' <= 1, c'' <= 35 / (32 radius), and
    tangents that turn by no more than the curvatures times the radius.
    """
    ends = (
        before.places.tangent(np.array([before.length]))[0],
        after.places.tangent(np.array([0.0]))[0],
    )
    bends = before.places.curvature + after.places.curvature
    corner = float(portable.norm(ends[1] - ends[0]))
    return bends + 35.0 / (32.0 * radius) * (corner + bends * radius)


def _distinct_values(u: FloatArray) -> FloatArray:
    """Different values of u (M,) in order; none nearer to the one before than rounding brings
    it.
    """
    values = np.unique(u)
    kept = values[np.concatenate([[True], np.diff(values) > _SAME])]
    return np.append(kept[:-1], values[-1])


@dataclass(frozen=True, eq=False)
class ToolPath:
    """parts (K): one after the other; radius (K + 1,) m around the corner before each and at the
    end, 0: the tool stops there. headings: whether the tool turns with the path.
    """

    parts: tuple[PathPart, ...]
    radius: FloatArray
    headings: bool = False

    @cached_property
    def corners(self) -> FloatArray:
        """Where the parts begin and end (K + 1,), along the parts themselves [m]."""
        return np.concatenate([[0.0], np.cumsum([part.length for part in self.parts])])

    @cached_property
    def _arc(self) -> ArcLength | None:
        if not self.radius.any():
            return None
        breaks = [
            part.places.breaks + begin
            for part, begin in zip(self.parts, self.corners, strict=False)
        ]
        zones = [
            corner + radius * np.linspace(-1.0, 1.0, 2 * _PER_ZONE + 1)
            for corner, radius in zip(self.corners, self.radius, strict=True)
            if radius > 0.0
        ]
        return ArcLength(_distinct_values(np.concatenate([*breaks, *zones])), self._speed)

    @property
    def length(self) -> float:
        """m."""
        return float(self.corners[-1]) if self._arc is None else self._arc.length

    @cached_property
    def ends(self) -> FloatArray:
        """Arc lengths (K + 1,) of the corners [m]."""
        return self.corners if self._arc is None else self._arc.of(self.corners)

    @cached_property
    def breaks(self) -> FloatArray:
        """Arc lengths (B,) between which places and orientations are smooth [m]."""
        inner = [
            part.places.breaks + begin
            for part, begin in zip(self.parts, self.corners, strict=False)
        ]
        zones = [self.corners - self.radius, self.corners, self.corners + self.radius]
        u = _distinct_values(np.clip(np.concatenate([*inner, *zones]), 0.0, self.corners[-1]))
        return u if self._arc is None else self._arc.of(u)

    def bends(self, u: FloatArray) -> FloatArray:
        """A bound (M - 1,) [1/m] of the second derivative of the place by u between u (M,) and the
        next.
        """
        result = np.zeros(len(u) - 1)
        for k, part in enumerate(self.parts):
            within = (u[1:] >= self.corners[k]) & (u[:-1] <= self.corners[k + 1])
            result[within] = np.maximum(result[within], part.places.curvature)
        for k, radius in enumerate(self.radius):
            if radius > 0.0:
                near = (u[1:] >= self.corners[k] - radius) & (u[:-1] <= self.corners[k] + radius)
                bend = joint_bend(self.parts[k - 1], self.parts[k], float(radius))
                result[near] = np.maximum(result[near], bend)
        return result

    def turns(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bounds (M - 1,) of how fast the tool turns between u (M,) and the next, as those of
        Rates, by u.
        """
        first = np.zeros(len(u) - 1)
        second = np.zeros(len(u) - 1)
        zones = [
            (self.corners[k], self.corners[k + 1], part.turning.rates)
            for k, part in enumerate(self.parts)
        ]
        for corner, radius, parts in zip(
            self.corners[1:-1], self.radius[1:-1], pairwise(self.parts), strict=True
        ):
            if radius > 0.0:
                both = parts[0].turning.rates.then(parts[1].turning.rates)
                bent = RotationRates(both.first, both.second + both.first * 35.0 / (32.0 * radius))
                zones.append((corner - radius, corner + radius, bent))
        for begin, end, rates in zones:
            if self.headings:
                rates = rates.then(rates_of(self._heading))
            within = (u[1:] >= begin) & (u[:-1] <= end)
            first[within] = np.maximum(first[within], rates.first)
            second[within] = np.maximum(second[within], rates.second)
        return first, second

    def parameter(self, s: FloatArray) -> FloatArray:
        """u (M,) along the parts at arc lengths s (M,) m."""
        return s if self._arc is None else self._arc.inverse(s)

    @cached_property
    def begin(self) -> int:
        """The first part that is no approach."""
        return next((k for k, part in enumerate(self.parts) if part.kept), 0)

    def poses(self, s: FloatArray) -> FloatArray:
        """Poses (M, 4, 4) of the tcp at arc lengths s (M,) m."""
        u = self.parameter(s)
        result = np.tile(np.eye(4), (len(u), 1, 1))
        for k, chosen in self._owners(u):
            result[chosen] = self._of_part(k, u[chosen])
        if self.headings:
            result[:, :3, :3] = portable.matmul(
                result[:, :3, :3], about_tool(self._heading(self._clipped(u)))
            )
        return result

    def tangents(self, u: FloatArray) -> FloatArray:
        """dp/du (M, 3) at u (M,) along the parts."""
        result = np.zeros((len(u), 3))
        for k, chosen in self._owners(u):
            for part, progress, rate in self._moving(k, u[chosen]):
                result[chosen] += part.places.tangent(progress) * rate[:, None]
        return result

    def _speed(self, u: FloatArray) -> FloatArray:
        speed = np.linalg.norm(self.tangents(u), axis=1)
        for k, chosen in self._owners(u):
            if self.parts[k].in_place:
                speed[chosen] = 1.0
        return np.asarray(speed)

    @cached_property
    def strokes(self) -> list[tuple[int, int]]:
        """From which corner to which the tool moves without a stop."""
        return list(pairwise(k for k, radius in enumerate(self.radius) if radius == 0.0))

    def turns_in_place(self, stroke: int) -> bool:
        """Whether the tool only turns between two stops."""
        return self.parts[self.strokes[stroke][0]].in_place

    def _owners(self, u: FloatArray) -> list[tuple[int, IntArray]]:
        """The parts and which of u (M,) lie on each."""
        owner = np.clip(np.searchsorted(self.corners, u, side="right") - 1, 0, len(self.parts) - 1)
        return [(int(k), np.flatnonzero(owner == k)) for k in np.unique(owner)]

    def _moving(self, k: int, u: FloatArray) -> list[tuple[PathPart, FloatArray, FloatArray]]:
        """Parts under way where part k is: how far each is (M,) m, and its rate (M,) by u."""
        part = self.parts[k]
        first = u - self.corners[k]
        last = u - self.corners[k + 1]
        begin = float(self.radius[k])
        end = float(self.radius[k + 1])
        progress = np.clip(first, 0.0, part.length)
        rate = np.ones_like(u)
        found = []
        if begin > 0.0:
            near = first < begin
            progress = np.where(near, covered(first, begin), progress)
            rate = np.where(near, covering(first, begin), rate)
            before = self.parts[k - 1]
            left = before.length - covered(-first, begin)
            found.append((before, np.minimum(left, before.length), covering(-first, begin)))
        if end > 0.0:
            near = last > -end
            progress = np.where(near, part.length - covered(-last, end), progress)
            rate = np.where(near, covering(-last, end), rate)
            found.append((self.parts[k + 1], covered(last, end), covering(last, end)))
        return [(part, progress, rate), *found]

    def _of_part(self, k: int, u: FloatArray) -> FloatArray:
        (part, progress, _), *others = self._moving(k, u)
        poses = np.tile(np.eye(4), (len(u), 1, 1))
        poses[:, :3, 3] = part.places.at(progress)
        poses[:, :3, :3] = part.turning.at(progress)
        for other, along, _ in others:
            earlier = k > 0 and other is self.parts[k - 1]
            corner = np.array([other.length if earlier else 0.0])
            poses[:, :3, 3] += other.places.at(along) - other.places.at(corner)
            turned = other.turning.at(along)
            there = other.turning.at(corner)[0]
            if earlier:
                poses[:, :3, :3] = portable.matmul(turned, there.T, poses[:, :3, :3])
            else:
                poses[:, :3, :3] = portable.matmul(poses[:, :3, :3], there.T, turned)
        return poses

    def _clipped(self, u: FloatArray) -> FloatArray:
        """u (M,) within the segments: approach and retract keep the heading."""
        kept = [k for k, part in enumerate(self.parts) if part.kept]
        return np.clip(u, self.corners[kept[0]], self.corners[kept[-1] + 1])

    @cached_property
    def _heading(self) -> BSpline:
        """Angle of the path about the tool's axis over u, 0 at the start. PathRefusedError where it
        runs along that axis.
        """
        begin, end = self._clipped(np.array([-np.inf, np.inf]))
        # denser around the corners, where the path turns
        around_corners = self.corners + np.linspace(-1.0, 1.0, 33)[:, None] * self.radius
        even = np.linspace(begin, end, 40 * len(self.parts) + 200)
        places = np.concatenate([even, around_corners.ravel()])
        u = _distinct_values(np.clip(places, begin, end))
        before_end = np.minimum(u, end - 1e-9)
        tangents = self.tangents(before_end)
        given = np.tile(np.eye(4), (len(u), 1, 1))
        for k, chosen in self._owners(before_end):
            given[chosen] = self._of_part(k, u[chosen])
        local = np.einsum("mji,mj->mi", given[:, :3, :3], tangents)
        local /= np.linalg.norm(local, axis=1)[:, None]
        across = portable.hypot(local[:, 1], local[:, 2])
        if across.min() < portable.sin(_ALONG_AXIS):
            place = float(u[int(np.argmin(across))])
            along = place if self._arc is None else float(self._arc.of(np.array([place]))[0])
            raise PathRefusedError(
                f"orientation is {TANGENT}: the path runs along the tool's axis at {along:.3f} m",
                StatusCode.INVALID_MOTION_PLAN,
            )
        angle = np.unwrap(portable.arctan2(local[:, 2], local[:, 1]))
        return portable.interpolating_spline(u, angle - angle[0], 3)


# How parts of a path are joined at the corner between them, and by how much that leaves the
# parts.

# m by which a smoothed joint may leave the parts, well below the 0.1 mm of the whole
SMOOTHING = 2e-5
SMOOTHING_TURN = 5e-4  # rad
SHORTEST_JOINT = 1e-3  # m: a smaller radius is a corner
_LONGEST_JOINT = 0.05  # m
_TANGENT = np.radians(2.0)  # parts that meet at less are smoothed, whatever the radius asked for
REVERSAL = np.radians(175.0)  # beyond, a rounded corner would come to a stand
_SHRINK = 0.8
_SAMPLES = 129


class Joint(NamedTuple):
    """radius [m], 0: the tool stops; angle [rad] of the corner; leaves, turns: by what smoothing
    leaves the parts [m, rad]; rounded: as asked for, which leaves them on purpose.
    """

    radius: float
    angle: float
    leaves: float = 0.0
    turns: float = 0.0
    rounded: bool = False


def joined(path: CartesianPath, parts: tuple[PathPart, ...]) -> tuple[ToolPath, tuple[Joint, ...]]:
    """The parts one after the other, and the joints between them; approach and retract are not
    rounded.
    """
    joints = tuple(
        joint_between(before, after, path.blending_radius if before.kept and after.kept else 0.0)
        for before, after in itertools.pairwise(parts)
    )
    radius = np.array([0.0, *(joint.radius for joint in joints), 0.0])
    return ToolPath(parts, radius, path.orientation == TANGENT), joints


def joint_between(before: PathPart, after: PathPart, asked: float) -> Joint:
    """How two parts are joined, with the radius [m] that is asked for."""
    if before.in_place or after.in_place:
        return Joint(0.0, 0.0)
    half = 0.5 * min(before.length, after.length)
    first = before.places.tangent(np.array([before.length]))[0]
    second = after.places.tangent(np.array([0.0]))[0]
    angle = float(
        portable.arctan2(portable.norm(np.cross(first, second)), portable.matmul(first, second))
    )
    if angle > REVERSAL:
        return Joint(0.0, angle)
    if asked > 0.0 and angle > _TANGENT:
        return Joint(min(asked, half), angle, rounded=True)
    radius = min(_LONGEST_JOINT, half)
    shortest = min(SHORTEST_JOINT, half) if angle < _TANGENT else SHORTEST_JOINT
    while radius >= shortest:
        leaves, turns = _left_by(before, after, radius)
        if leaves <= SMOOTHING and turns <= SMOOTHING_TURN:
            return Joint(radius, angle, leaves, turns)
        radius *= _SHRINK
    return Joint(min(asked, half), angle, rounded=asked > 0.0)


def _left_by(before: PathPart, after: PathPart, radius: float) -> tuple[float, float]:
    """A bound of the distance [m], and the largest turn [rad], between joined and unjoined parts at
    the same length.
    """
    u = np.linspace(-radius, radius, _SAMPLES)
    left = before.length - covered(-u, radius)
    right = covered(u, radius)
    corner = after.places.at(np.array([0.0]))
    place = before.places.at(left) + after.places.at(right) - corner
    exact = np.where(
        (u < 0.0)[:, None],
        before.places.at(np.minimum(before.length + u, before.length)),
        after.places.at(np.maximum(u, 0.0)),
    )
    there = after.turning.at(np.array([0.0]))[0]
    turned = portable.matmul(before.turning.at(left), there.T, after.turning.at(right))
    asked = np.where(
        (u < 0.0)[:, None, None],
        before.turning.at(np.minimum(before.length + u, before.length)),
        after.turning.at(np.maximum(u, 0.0)),
    )
    bends = max(before.places.curvature, after.places.curvature) + joint_bend(before, after, radius)
    between = bends * np.square(u[1] - u[0]) / 8.0
    return _largest(place - exact) + between, _turn(asked, turned)


def _largest(difference: FloatArray) -> float:
    return float(np.linalg.norm(difference, axis=1).max())


def _turn(first: FloatArray, second: FloatArray) -> float:
    return float(turn_of(portable.matmul(first.transpose(0, 2, 1), second)).max())


# What a request for a path asks for.


@dataclass(frozen=True, eq=False)
class ToolPathRequest:
    """The path, as it is drawn, whether its first configuration is given, and T1. rate: times what
    is asked for the movement is laid out; where that is above 1 it is then slowed to it.
    """

    path: CartesianPath
    whole: ToolPath
    fixed: bool
    t1: bool
    context: Context
    rate: float = 1.0

    @property
    def speed(self) -> float:
        """Of the tool [m/s] for which it is laid out."""
        return self.path.tool_speed * self.rate

    @property
    def fastest(self) -> float:
        """The highest speed [m/s] that is asked for."""
        return max(part.speed for part in self.whole.parts)

    @property
    def least_duration(self) -> float:
        """Seconds: no movement at these speeds takes less."""
        lengths = np.diff(self.whole.ends)
        speeds = [part.speed for part in self.whole.parts]
        return float((lengths / speeds).sum()) / self.rate

    @property
    def space(self) -> FreeSpace:
        """Where configurations may be."""
        context = self.context
        return FreeSpace.of(context.scene, context.safety_distance, context.work, context.station)


# Why a path can't be driven as asked: a sentence with the place along it.


class PathRefusedError(Exception):
    """The path can't be driven so; the sentence names the place [m] along it, if there is one.

    strayed [m]: where the axes can't be followed between samples of a chain: closer ones may show
    where they turn, or that they would have to jump. None for other reasons.
    """

    def __init__(
        self,
        sentence: str,
        code: StatusCode = StatusCode.PLANNING_FAILED,
        strayed: float | None = None,
    ) -> None:
        super().__init__(sentence)
        self.code = code
        self.strayed = strayed

    @property
    def status(self) -> Status:
        """The answer."""
        return Status(self.code, str(self))


class NoChainError(Exception):
    """No chain of configurations leads through all layers; reached (M,): those to which one
    leads.
    """

    def __init__(self, reached: IntArray) -> None:
        super().__init__(f"chains lead to {len(reached)} configurations, and not to the last layer")
        self.reached = reached
