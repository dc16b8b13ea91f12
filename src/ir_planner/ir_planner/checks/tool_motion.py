"""How fast the tool is, and how much its speed changes: at every instant of a trajectory.

Between two instants a curve leaves the chord of its values by at most h^2 / 8 times a bound of its
second derivative; so a speed is nowhere more than the larger one of both ends and that, where the
third derivative of the place is bounded, and an acceleration likewise by the fourth. Such bounds
follow from those of the axes: a place at the distance r from an axis moves by at most r per radian.
By the chain rule a derivative of a place is a sum over axes, over pairs of them, over triples and
so on, each at most the product of the axes' derivatives and the distance from the outermost axis of
the term; with all distances 1 it holds for the rotation.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from ir_kernels import portable
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import Extremes, extremes
from ir_planner.scene import PlanningScene, PointBounds, ToolBounds
from ir_values.arrays import FloatArray, IntArray

# Bounds of the derivatives of places of the tool on each segment of a trajectory.


class ToolDerivatives(NamedTuple):
    """Bounds (S,) on each segment: of |p''| [m/s^2], |p'''| [m/s^3] and |p''''| [m/s^4] of a place,
    and of |R''| [rad/s^2] of the rotation, as 1 / sqrt(2) of the Frobenius norm, and of |w''|
    [rad/s^3] of its turning speed; times (S + 1,) s.
    """

    times: FloatArray
    acceleration: FloatArray
    jerk: FloatArray
    snap: FloatArray
    turning: FloatArray
    spinning: FloatArray

    def between(self, values: FloatArray, times: FloatArray) -> FloatArray:
        """The largest of values (S,) between times (M,) s and the next (M - 1,), at most a segment
        apart.
        """
        last = len(values) - 1
        first = np.clip(np.searchsorted(self.times, times[:-1], side="right") - 1, 0, last)
        second = np.clip(np.searchsorted(self.times, times[1:], side="left") - 1, 0, last)
        return np.maximum(values[first], values[np.maximum(second, first)])


def tool_derivatives(
    trajectory: JointTrajectory,
    scene: PlanningScene,
    farthest: float | None = None,
    largest: Extremes | None = None,
) -> ToolDerivatives:
    """Bounds along a trajectory of places at most `farthest` m from the origin of the last link,
    None: of the tcp. largest: the extremes of its polynomials, where they are known.

    A place turns with all axes before it: sums of the joints' extremes bound how fast, and
    `_reach` [m] how far from each axis it is.
    """
    coefficients, durations = trajectory.coefficients()
    top = extremes(coefficients, durations) if largest is None else largest
    end = portable.norm(scene.chain.tcp[:3, 3]) if farthest is None else farthest
    reach = _reach(scene, end)
    # the fourth derivative of a quintic is linear: largest at an end of its segment
    fourth = 24.0 * coefficients[:, :, 4]
    last = fourth + 120.0 * coefficients[:, :, 5] * durations[:, None]
    joint_snap = np.maximum(np.abs(fourth), np.abs(last))

    base = scene.cell.robot.base
    v = np.cumsum(top.velocity[:, base:], axis=1)
    a = np.cumsum(top.acceleration[:, base:], axis=1)
    j = np.cumsum(top.jerk[:, base:], axis=1)
    s = np.cumsum(joint_snap[:, base:], axis=1)
    square = v * v
    of_acceleration = a + square
    of_jerk = j + 3.0 * a * v + square * v
    of_snap = s + 4.0 * j * v + 3.0 * a * a + 6.0 * a * square + square * square
    sums = np.stack([of_acceleration, of_jerk, of_snap])
    outermost = sums.copy()  # of the terms whose outermost axis is each one
    outermost[:, :, 1:] -= sums[:, :, :-1]
    bounds = portable.matmul(outermost, reach)
    if base:  # a rail moves every place by its own motion
        of_rail = [top.acceleration[:, 0], top.jerk[:, 0], joint_snap[:, 0]]
        bounds = bounds + np.stack(of_rail)
    acceleration, jerk, snap = bounds
    return ToolDerivatives(
        trajectory.times,
        acceleration,
        jerk,
        snap,
        np.asarray(a[:, -1] + v[:, -1] ** 2),
        np.asarray(j[:, -1] + 3.0 * a[:, -1] * v[:, -1] + portable.power(v[:, -1], 3)),
    )


def _reach(scene: PlanningScene, end: float) -> FloatArray:
    """Farthest (n,) m that a place `end` m from the origin of the last link can be from each
    axis that turns.
    """
    first = scene.cell.robot.base + 1
    links = np.linalg.norm(scene.chain.joint_origin[first:, :3, 3], axis=1)
    tail = np.append(links, end)
    return np.asarray(np.cumsum(tail[::-1])[::-1])


# Speeds and accelerations of the points of the tool at instants. Vectors lie along the first axis.


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    np.subtract(a[1] * b[2], a[2] * b[1], out=product[0])
    np.subtract(a[2] * b[0], a[0] * b[2], out=product[1])
    np.subtract(a[0] * b[1], a[1] * b[0], out=product[2])
    return product


def _length(a: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]))


def _in_world(rotation: FloatArray, vector: FloatArray) -> FloatArray:
    """Vectors (3, K, 1) of links with rotations (3, 3, K, N), (3, K, N) in the world."""
    x, y, z = vector
    return np.asarray(rotation[:, 0] * x + rotation[:, 1] * y + rotation[:, 2] * z)


def _after(*terms: FloatArray) -> FloatArray:
    """Sums (3, K, N) of terms (3, K, N) up to each axis, those of an axis in this order."""
    sums = np.empty_like(terms[0])
    total = np.zeros_like(terms[0][:, 0])
    for k in range(sums.shape[1]):
        for term in terms:
            total += term[:, k]
        sums[:, k] = total
    return sums


def tool_states(
    scene: PlanningScene, q: FloatArray, qd: FloatArray, qdd: FloatArray, points: slice
) -> tuple[FloatArray, FloatArray]:
    """Largest speed [m/s] and acceleration [m/s^2] (N,) of the spheres around points of the tool,
    at states (N, n): those of the centre, and what turning adds on its surface at most.

    Along the chain: the origin of each frame moves with the one before it, and by its turning.
    """
    states = (2, 3, 1, 0)  # last, where arrays of states are fast
    poses = np.ascontiguousarray(scene.chain.link_poses(q)[:, :, :3].transpose(states))
    rotation = poses[:, :3, 1:]
    places = poses[:, 3, 1:]
    axis = _in_world(rotation, scene.chain.joint_axis.T[:, :, None])
    rate = axis * np.ascontiguousarray(qd.T)
    bend = axis * np.ascontiguousarray(qdd.T)
    slide = np.zeros((2, 3, 1, 1))
    if scene.chain.first_slides:  # moves the base, and turns nothing
        slide = np.stack([rate[:, :1], bend[:, :1]])
        rate[:, 0] = bend[:, 0] = 0.0
    turn = _after(rate)  # of the frame after each axis, (3, n, N)
    before = np.zeros_like(turn)
    before[:, 1:] = turn[:, :-1]
    change = _after(bend, _cross(before, rate))

    # speed and acceleration of the origin of the last frame
    arm = places[:, 1:] - places[:, :-1]
    lift = _cross(turn[:, :-1], arm)
    tangential = _cross(change[:, :-1], arm)
    centripetal = _cross(turn[:, :-1], lift)
    speed = _after(lift)[:, -1:] + slide[0]
    gain = _after(tangential, centripetal)[:, -1:] + slide[1]

    # and of the tool's points, which are fixed to it
    turn = turn[:, -1:]
    change = change[:, -1:]
    swing = _length(turn)
    twist = _length(change) + swing * swing
    centres, radii = scene.tool_points
    size = radii[points, None]
    arm = _in_world(rotation[:, :, -1:], centres[points].T[:, :, None])
    lift = _cross(turn, arm)
    speeds = _length(speed + lift) + size * swing
    bends = _length(gain + _cross(change, arm) + _cross(turn, lift)) + size * twist
    return speeds.max(axis=0), bends.max(axis=0)


def _values(polynomials: FloatArray, t: FloatArray) -> FloatArray:
    """Polynomials (N, n, K), lowest power first, at t (N, 1)."""
    value = polynomials[:, :, -1]
    for k in range(polynomials.shape[2] - 2, -1, -1):
        value = value * t + polynomials[:, :, k]
    return np.asarray(value)


# Bounds of both along a trajectory: what is found at instants, and what may be between them.

_RESOLUTION = 2e-3  # share of the largest value that the bound may add between instants
_FINER = 8  # times as many instants where a bound doesn't decide,
_ROUNDS = 3
_MOST = 200_000  # instants of a trajectory at a time
_AT_ONCE = 800  # of these, whose arrays stay in the processor's cache
# where nothing is asked and the largest bounds are only reported: a proof of a movement stays fast
_REPORTED_RESOLUTION = 0.02
_REPORTED_AT_ONCE = 1_000  # instants that cost less than another round


class Largest(NamedTuple):
    """Of one kind of points on each segment (S,): bounds of speed [m/s] and acceleration [m/s^2],
    and what was found of both at instants.
    """

    speed: FloatArray
    acceleration: FloatArray
    found_speed: FloatArray
    found_acceleration: FloatArray

    def most(self) -> tuple[float, float]:
        """The largest bounds of all segments."""
        return float(self.speed.max(initial=0.0)), float(self.acceleration.max(initial=0.0))

    def replace(self, segments: IntArray, closer: "Largest") -> None:
        """Take what was found of these segments (K,) at more instants."""
        self.speed[segments] = closer.speed
        self.acceleration[segments] = closer.acceleration
        self.found_speed[segments] = closer.found_speed
        self.found_acceleration[segments] = closer.found_acceleration


def _largest_with(values: FloatArray, share: float) -> float:
    """The largest of values (S,), and a share of it."""
    return (1.0 + share) * float(values.max(initial=0.0))


class ToolUse:
    """How fast the tool is along one trajectory."""

    def __init__(
        self,
        trajectory: JointTrajectory,
        scene: PlanningScene,
        bounds: ToolBounds,
        largest: Extremes | None = None,
    ) -> None:
        self.trajectory = trajectory
        self.scene = scene
        self.bounds = bounds
        self._coefficients, self._durations = trajectory.coefficients()
        self._largest = (
            extremes(self._coefficients, self._durations) if largest is None else largest
        )

    @cached_property
    def tcp(self) -> Largest:
        """Of the tcp."""
        return self._of(slice(0, 1), self.bounds.tcp)

    @cached_property
    def whole(self) -> Largest:
        """Of every point of tool and part, the tcp among them."""
        return self._of(slice(None), self.bounds.whole)

    @property
    def asked(self) -> list[tuple[str, Largest, PointBounds]]:
        """What is bounded, with its name."""
        kinds = []
        if self.bounds.tcp.asked:
            kinds.append(("the tcp", self.tcp, self.bounds.tcp))
        if self.bounds.whole.asked:
            kinds.append(("tool and part", self.whole, self.bounds.whole))
        return kinds

    @property
    def longer(self) -> FloatArray:
        """By what factor each segment (S,) should last longer; at most 1: within the bounds."""
        factors = np.zeros(len(self._durations))
        for _, found, bounds in self.asked:
            longer = np.maximum(
                found.speed / bounds.speed, np.sqrt(found.acceleration / bounds.acceleration)
            )
            factors = np.maximum(factors, longer)
        return factors

    def _of(self, points: slice, bounds: PointBounds) -> Largest:
        places, radii = self.scene.tool_points
        away = float((np.linalg.norm(places[points], axis=1) + radii[points]).max())
        motion = tool_derivatives(self.trajectory, self.scene, away, self._largest)
        every = np.arange(len(self._durations))
        found = self._bounded(motion, every, np.ones(len(every), np.int64), points)
        if bounds.asked:
            return self._decided(motion, found, points, bounds)
        return self._reported(motion, found, points)

    def _decided(
        self, motion: ToolDerivatives, ends: Largest, points: slice, bounds: PointBounds
    ) -> Largest:
        """Bounds that say of every segment whether it keeps what is asked."""
        every = np.arange(len(self._durations))
        pieces = self._pieces(motion, ends, every, _RESOLUTION)
        share = max(float(pieces.sum()) / _MOST, 1.0)
        count = np.maximum(np.ceil(pieces / share), 1.0).astype(np.int64)
        found = self._bounded(motion, every, count, points)
        for _ in range(_ROUNDS):
            open_ = np.flatnonzero(
                ((found.speed > bounds.speed) & (found.found_speed <= bounds.speed))
                | (
                    (found.acceleration > bounds.acceleration)
                    & (found.found_acceleration <= bounds.acceleration)
                )
            )
            if len(open_) == 0 or (count[open_].sum() + len(open_)) * _FINER > _MOST:
                break
            count[open_] *= _FINER
            found.replace(open_, self._bounded(motion, open_, count[open_], points))
        return found

    def _reported(self, motion: ToolDerivatives, found: Largest, points: slice) -> Largest:
        """Bounds of which the largest are close: those of segments that can't have it stay as
        loose as their ends leave them.
        """
        count = np.ones(len(self._durations), np.int64)
        while True:
            open_ = np.flatnonzero(
                (found.speed > _largest_with(found.found_speed, _REPORTED_RESOLUTION))
                | (
                    found.acceleration
                    > _largest_with(found.found_acceleration, _REPORTED_RESOLUTION)
                )
            )
            pieces = self._pieces(motion, found, open_, _REPORTED_RESOLUTION)
            if pieces.sum() > _REPORTED_AT_ONCE:
                pieces = np.minimum(pieces, float(_FINER) * count[open_])
            more = pieces.astype(np.int64)
            if len(open_) == 0 or more.sum() > _MOST or (more <= count[open_]).all():
                return found
            count[open_] = more
            found.replace(open_, self._bounded(motion, open_, more, points))

    def _pieces(
        self, motion: ToolDerivatives, found: Largest, segments: IntArray, resolution: float
    ) -> FloatArray:
        """How many pieces of each of the segments (K,) leave at most `resolution` of the largest
        value between their ends.
        """
        of_speed, of_acceleration = (
            np.sqrt(
                8.0
                * resolution
                * max(float(values.max(initial=0.0)), 1e-9)
                / np.maximum(bound[segments], 1e-12)
            )
            for values, bound in (
                (found.found_speed, motion.jerk),
                (found.found_acceleration, motion.snap),
            )
        )
        return np.asarray(
            np.ceil(self._durations[segments] / np.minimum(of_speed, of_acceleration))
        )

    def _bounded(
        self, motion: ToolDerivatives, segments: IntArray, count: IntArray, points: slice
    ) -> Largest:
        speed, acceleration = self._sampled(segments, count, points)
        step = self._durations[segments] / count
        between = step * step / 8.0
        return Largest(
            speed + between * motion.jerk[segments],
            acceleration + between * motion.snap[segments],
            speed,
            acceleration,
        )

    def _sampled(
        self, segments: IntArray, count: IntArray, points: slice
    ) -> tuple[FloatArray, FloatArray]:
        """Largest speed and acceleration (K,) of points of the tool at count + 1 instants of each
        of the segments (K,).
        """
        if len(segments) == 0:
            return np.zeros(0), np.zeros(0)
        begins = np.concatenate([[0], np.cumsum(count + 1)[:-1]])
        owner = np.repeat(np.arange(len(segments)), count + 1)
        share = (np.arange(len(owner)) - begins[owner]) / count[owner]
        t = (share * self._durations[segments][owner])[:, None]
        c = self._coefficients[segments][owner]
        order = np.arange(6)
        q = _values(c, t)
        qd = _values((c * order)[:, :, 1:], t)
        qdd = _values((c * order * (order - 1))[:, :, 2:], t)
        parts = (slice(k, k + _AT_ONCE) for k in range(0, len(q), _AT_ONCE))
        speeds, accelerations = np.concatenate(
            [tool_states(self.scene, q[part], qd[part], qdd[part], points) for part in parts],
            axis=1,
        )
        return np.maximum.reduceat(speeds, begins), np.maximum.reduceat(accelerations, begins)
