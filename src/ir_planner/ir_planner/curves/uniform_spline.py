"""Motions along uniform cubic B-splines: control points with one interval of time between all
knots.

Three equal control points at an end mean rest there; those of an end in motion follow from its
state and the interval. Acceleration is linear and jerk constant between knots, so a point per knot
with position, velocity and acceleration is the motion exactly, and its largest values are closed
forms.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ir_kernels.spline_terms import end_points
from ir_msgs_py.trajectory import JointTrajectory
from ir_values.arrays import FloatArray

# times v / a, in which the motion of an end dies out: none of it is faster than a then
_GENTLY = 6.0


def at_shares(path: FloatArray, shares: FloatArray) -> FloatArray:
    """Configurations (K, n) on the polyline `path` (M, n) at shares (K,) in [0, 1] of its Euclidean
    length in joint space.
    """
    passed = _lengths(path)
    return _at(path, passed, shares * passed[-1])


def in_short_steps(path: FloatArray, longest: float) -> FloatArray:
    """The path (M, n) with points added in its steps, so that no joint turns by more than `longest`
    rad in one.
    """
    parts = np.maximum(np.ceil(np.abs(np.diff(path, axis=0)).max(axis=1) / longest), 1.0)
    steps = [
        first + (last - first) * (np.arange(count) / count)[:, None]
        for first, last, count in zip(path[:-1], path[1:], parts, strict=True)
    ]
    return np.concatenate([*steps, path[-1:]])


def evenly_spaced(path: FloatArray, count: int) -> FloatArray:
    """`count` configurations (count, n) at even distances along `path` (M, n), its ends exactly
    included.
    """
    passed = _lengths(path)
    points = _at(path, passed, np.linspace(0.0, passed[-1], count))
    points[0] = path[0]
    points[-1] = path[-1]
    return points


def _lengths(path: FloatArray) -> FloatArray:
    """Length (M,) of the path before each of its points."""
    steps = path[1:] - path[:-1]
    passed = np.zeros(len(path))
    np.cumsum(np.sqrt(np.add.reduce(steps * steps, axis=1)), out=passed[1:])
    return passed


def _at(path: FloatArray, passed: FloatArray, at: FloatArray) -> FloatArray:
    """Configurations (K, n) where lengths `at` (K,), none below 0, have been passed."""
    k = passed.searchsorted(at, side="right") - 1
    after = np.minimum(k + 1, len(path) - 1)
    length = (passed[after] - passed[k])[:, None]
    step = path[after] - path[k]
    # at the end there is none
    slope = np.divide(step, length, out=np.zeros_like(step), where=length > 0.0)
    return np.asarray(slope * (at - passed[k])[:, None] + path[k])


class Tops(NamedTuple):
    """Largest |qd|, |qdd| and |qddd| of a motion, each (n,)."""

    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray


@dataclass(frozen=True, eq=False)
class UniformSpline:
    """control (K, n) rad, K >= 7; interval [s] between the K - 2 knots. ends (2, 3, n): q, qd, qdd
    at both ends, which three control points at each follow from; None: at rest.
    """

    control: FloatArray
    interval: float
    ends: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.ends is not None:
            control = self.control.copy()
            control[:3] = end_points(self.ends[0], self.interval)
            control[-3:] = end_points(self.ends[1], self.interval)
            object.__setattr__(self, "control", control)

    def at_interval(self, interval: float) -> "UniformSpline":
        """The same inner control points and ends at another interval [s]."""
        return replace(self, interval=interval)

    def moving(self, motion: FloatArray, acceleration: FloatArray) -> "UniformSpline":
        """A spline from rest to rest with qd, qdd at its ends, motion (2, 2, n), that die out
        within the accelerations (n,) or its duration.
        """
        ends = np.concatenate([self.control[[0, -1], None], motion], axis=1)
        control = self.control.copy()
        after: FloatArray = self.interval * (np.arange(len(control), dtype=np.float64) - 1.0)
        control += _dying(motion[0, 0], motion[0, 1], after, self.duration, acceleration)
        until = after[::-1]
        control += _dying(-motion[1, 0], motion[1, 1], until, self.duration, acceleration)
        return UniformSpline(control, self.interval, ends)

    @property
    def intervals(self) -> int:
        """Number of polynomials."""
        return len(self.control) - 3

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.intervals * self.interval

    def knots(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """q, qd, qdd (K - 2, n) at the knots; exactly at rest at both ends."""
        c = self.control
        h = self.interval
        # A uniform cubic B-spline weighs the three control points around a knot by 1/6, 4/6, 1/6;
        # its derivatives there are the central differences of them.
        q = (c[:-2] + 4.0 * c[1:-1] + c[2:]) / 6.0
        qd = (c[2:] - c[:-2]) / (2.0 * h)
        qdd = (c[:-2] - 2.0 * c[1:-1] + c[2:]) / (h * h)
        if self.ends is None:
            q[0] = c[0]
            q[-1] = c[-1]
        else:
            for values, at_ends in zip((q, qd, qdd), self.ends.transpose(1, 0, 2), strict=True):
                values[[0, -1]] = at_ends
        return q, qd, qdd

    def samples(self, per_interval: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """q, qd, qdd (S * per_interval, n) at evenly spaced instants, the beginnings of the
        intervals included.
        """
        q, qd, qdd = (values[:, None, :] for values in self.knots())
        t = (np.arange(per_interval) / per_interval * self.interval)[None, :, None]
        jerk = np.diff(qdd, axis=0) / self.interval

        # q0 + v0 t + a0 t^2 / 2 + j t^3 / 6 and its derivatives, by Horner's rule
        a0 = qdd[:-1]
        v0 = qd[:-1]
        place = q[:-1] + t * (v0 + t * (0.5 * a0 + t * jerk / 6.0))
        speed = v0 + t * (a0 + 0.5 * t * jerk)
        acceleration = a0 + t * jerk

        n = self.control.shape[1]
        return place.reshape(-1, n), speed.reshape(-1, n), acceleration.reshape(-1, n)

    def extremes(self) -> Tops:
        """Largest values anywhere."""
        # Acceleration is linear between knots and jerk constant, so both are largest at knots;
        # speed is a parabola, which may turn inside an interval.
        _, qd, qdd = self.knots()
        jerk = np.diff(qdd, axis=0) / self.interval
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = -qdd[:-1] / jerk  # s after the knot: qdd + jerk t = 0
        turn = np.where((turn > 0.0) & (turn < self.interval), turn, 0.0)
        inside = qd[:-1] + turn * (qdd[:-1] + 0.5 * turn * jerk)
        speed = np.maximum(np.abs(qd).max(axis=0), np.abs(inside).max(axis=0))
        return Tops(speed, np.abs(qdd).max(axis=0), np.abs(jerk).max(axis=0))

    def subdivided(self) -> "UniformSpline":
        """The same motion with a knot more in the middle of every interval."""
        # Knot insertion by the Lane-Riesenfeld rule: the new control points are the middles of the
        # old ones, and (1, 6, 1) / 8 of three neighbours.
        c = self.control
        finer = np.empty((2 * len(c) - 3, c.shape[1]))
        finer[0::2] = 0.5 * (c[:-1] + c[1:])
        finer[1::2] = 0.125 * (c[:-2] + 6.0 * c[1:-1] + c[2:])
        # rounding must not move the ends
        finer[:3] = c[0]
        finer[-3:] = c[-1]
        return replace(self, control=finer, interval=0.5 * self.interval)

    def lasting(self, duration: float) -> "UniformSpline":
        """The same path in another time [s]."""
        return self.at_interval(duration / self.intervals)

    def trajectory(self, joint_names: tuple[str, ...]) -> JointTrajectory:
        """The motion as it is sent, a point per knot; the interval is rounded up to a
        nanosecond.
        """
        step = int(np.ceil(self.interval * 1e9 - 1e-3))
        q, qd, qdd = self.at_interval(step * 1e-9).knots()
        return JointTrajectory(joint_names, np.arange(len(q), dtype=np.int64) * step, q, qd, qdd)


def _dying(
    qd: FloatArray, qdd: FloatArray, t: FloatArray, longest: float, acceleration: FloatArray
) -> FloatArray:
    """What a motion with qd, qdd (n,) at 0 s adds to positions (K, n) at t (K,) s, until it has
    died out: smoothly, within the accelerations (n,) where that takes less than `longest` s.
    """
    lasts = min(longest, float(np.max(_GENTLY * np.abs(qd) / acceleration)))
    if lasts <= 0.0:
        return np.zeros((len(t), len(qd)))
    # t (qd + t (qdd / 2 + 3 qd / T)) (1 - t / T)^3: speed qd and acceleration qdd at 0, where the
    # term with 3 / T cancels what the third power adds, and at rest at T with its acceleration
    at = np.clip(t, 0.0, lasts)[:, None]
    left = 1.0 - at / lasts
    start = qd + at * (0.5 * qdd + 3.0 * qd / lasts)
    return np.asarray(at * start * (left * left * left))


def along_motion(trajectory: JointTrajectory, count: int, duration: float) -> UniformSpline:
    """Spline with `count` control points between its ends along a trajectory, with its speed
    profile but for the duration [s].
    """
    begin = float(trajectory.times[0])
    shares = np.linspace(0.0, 1.0, count + 4)
    q = trajectory.sample(begin + shares * (trajectory.duration - begin)).q
    q[0] = trajectory.positions[0]
    q[-1] = trajectory.positions[-1]
    # A control point lies outside its curve by a sixth of the second difference there.
    bend = np.zeros_like(q)
    bend[1:-1] = (q[:-2] - 2.0 * q[1:-1] + q[2:]) / 6.0
    inner = (q - bend)[2:-2]
    control = np.concatenate([np.repeat(q[:1], 3, axis=0), inner, np.repeat(q[-1:], 3, axis=0)])
    return UniformSpline(control, duration / (count + 3))


def along_path(path: FloatArray, count: int, duration: float) -> UniformSpline:
    """Spline with `count` control points between its ends along a path (M, n), slow at both ends of
    it.
    """
    share = np.arange(1, count + 1) / (count + 1)
    smooth = share * share * (3.0 - 2.0 * share)  # from 0 to 1 without speed at the ends
    inner = at_shares(path, smooth)
    control = np.concatenate(
        [np.repeat(path[:1], 3, axis=0), inner, np.repeat(path[-1:], 3, axis=0)]
    )
    return UniformSpline(control, duration / (count + 3))


def fewest_seconds(path: FloatArray, velocity: FloatArray, acceleration: FloatArray) -> float:
    """A guess that is seldom too long: a path (M, n) at full speed, or from rest to rest as its
    longest joint.
    """
    steps = np.abs(np.diff(path, axis=0))
    at_speed = float((steps / velocity).max(axis=1).sum())
    return max(at_speed, 2.0 * float(np.sqrt(steps.sum(axis=0) / acceleration).max()))
