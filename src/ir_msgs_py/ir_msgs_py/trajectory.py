"""A joint trajectory as a value, and the one interpolant that everything rests on.

A trajectory means the quintic Hermite polynomial through (q, qd, qdd) of its points; cubic where
accelerations are missing, linear where velocities are too (as ros2_controllers'
joint_trajectory_controller does). Checks, proofs, energy and the driver all evaluate this
interpolant, after times are rounded to nanoseconds.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ir_msgs_py.names import EXTERNAL_AXES
from ir_values.argument_types import typed_methods
from ir_values.arrays import FloatArray, IntArray, set_field
from ir_values.errors import JointNamesError, TrajectoryError


def in_people_units(joint_names: Sequence[str], values: FloatArray) -> FloatArray:
    """Positions (..., n) [rad, m], or their derivatives, in degrees, of external axes in m."""
    slides = [name in EXTERNAL_AXES for name in joint_names]
    return np.asarray(np.where(slides, values, np.degrees(values)))


# Hermite polynomials between trajectory points. A quintic segment reproduces a cubic one exactly,
# so planners of splines send one point per knot.


def hermite_coefficients(
    q: FloatArray, qd: FloatArray | None, qdd: FloatArray | None, durations: FloatArray
) -> FloatArray:
    """Coefficients c (S, n, 6) of q(t) = sum_k c_k t^k [s] through points q, qd, qdd (S+1, n).

    Quintic; without qdd cubic, without qd linear: what is left out is 0.
    """
    T = durations[:, None]
    delta = q[1:] - q[:-1]
    c = np.zeros((len(durations), q.shape[1], 6))
    c[:, :, 0] = q[:-1]
    if qd is None:
        c[:, :, 1] = delta / T
        return c
    v0 = qd[:-1]
    v1 = qd[1:]
    c[:, :, 1] = v0
    if qdd is None:
        c[:, :, 2] = (3.0 * delta / T - 2.0 * v0 - v1) / T
        c[:, :, 3] = (-2.0 * delta / T + v0 + v1) / (T * T)
        return c
    a0 = qdd[:-1]
    a1 = qdd[1:]
    c[:, :, 2] = 0.5 * a0
    third = 20.0 * delta / T - 8.0 * v1 - 12.0 * v0 - (3.0 * a0 - a1) * T
    fourth = -30.0 * delta / T + 14.0 * v1 + 16.0 * v0 + (3.0 * a0 - 2.0 * a1) * T
    fifth = 12.0 * delta / T - 6.0 * (v0 + v1) - (a0 - a1) * T
    c[:, :, 3] = third / (2.0 * (T * T))
    c[:, :, 4] = fourth / (2.0 * (T * T) * T)
    c[:, :, 5] = fifth / (2.0 * (T * T) * (T * T))
    return c


def evaluate(c: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """q and its first three derivatives (M, n) of polynomials c (6, M, n) at local times t (M,)
    [s].
    """
    s = t[:, None]
    c0, c1, c2, c3, c4, c5 = c
    q = ((((c5 * s + c4) * s + c3) * s + c2) * s + c1) * s + c0
    qd = (((5.0 * c5 * s + 4.0 * c4) * s + 3.0 * c3) * s + 2.0 * c2) * s + c1
    qdd = ((20.0 * c5 * s + 12.0 * c4) * s + 6.0 * c3) * s + 2.0 * c2
    qddd = (60.0 * c5 * s + 24.0 * c4) * s + 6.0 * c3
    return q, qd, qdd, qddd


NS_PER_S = 1_000_000_000
_ID_LENGTH = 16
_JOINED = 1e-6  # rad between two motions that are one
_MAX_TIME_NS = 2**31 * NS_PER_S  # what builtin_interfaces/Duration holds


class MotionSamples(NamedTuple):
    """Motion at M instants, each (M, n): rad, rad/s, rad/s^2, rad/s^3."""

    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    qddd: FloatArray


@typed_methods(TrajectoryError)
@dataclass(frozen=True, eq=False)
class JointTrajectory:
    """Points of n joints at N instants; equal when the content is, bit by bit.

    joint_names: n different names.
    times_ns: (N,) int64, time from start, strictly increasing, the first not negative [ns].
    positions, velocities, accelerations: (N, n) [rad, rad/s, rad/s^2]; the last two may be None
    (accelerations only together with velocities).

    Raises TrajectoryError naming point k and joint j; JointNamesError for the names.
    """

    joint_names: tuple[str, ...]
    times_ns: IntArray
    positions: FloatArray
    velocities: FloatArray | None = None
    accelerations: FloatArray | None = None

    def __post_init__(self) -> None:
        names = tuple(self.joint_names)
        if not names:
            raise TrajectoryError("the trajectory has no joint names")
        double = sorted({name for name in names if names.count(name) > 1})
        if double:
            raise JointNamesError(f"joint {double[0][:80]!r} is named more than once")
        times = _checked_times(self.times_ns)
        shape = (len(times), len(names))
        if self.velocities is None and self.accelerations is not None:
            raise TrajectoryError("accelerations are given without velocities")
        set_field(self, "joint_names", names)
        set_field(self, "times_ns", times)
        set_field(self, "positions", _checked_values(self.positions, "position", shape))
        if self.velocities is not None:
            set_field(self, "velocities", _checked_values(self.velocities, "velocity", shape))
        if self.accelerations is not None:
            set_field(
                self, "accelerations", _checked_values(self.accelerations, "acceleration", shape)
            )

    @classmethod
    def from_seconds(
        cls,
        joint_names: Sequence[str],
        times: ArrayLike,
        positions: ArrayLike,
        velocities: ArrayLike | None = None,
        accelerations: ArrayLike | None = None,
    ) -> JointTrajectory:
        """Round times (N,) [s] to nanoseconds; the rest as in the class. Raises TrajectoryError for
        times that are no finite row.
        """
        seconds = np.asarray(times, dtype=np.float64)
        if seconds.ndim != 1:
            raise TrajectoryError(f"times have shape {seconds.shape}: they must be (N,)")
        for k in np.flatnonzero(
            ~np.isfinite(seconds) | (np.abs(seconds) >= _MAX_TIME_NS / NS_PER_S)
        ):
            raise TrajectoryError(f"point {k}: time {seconds[k]} s is not a duration", point=int(k))
        return cls(
            tuple(joint_names),
            np.rint(seconds * NS_PER_S).astype(np.int64),
            np.asarray(positions, dtype=np.float64),
            None if velocities is None else np.asarray(velocities, dtype=np.float64),
            None if accelerations is None else np.asarray(accelerations, dtype=np.float64),
        )

    @property
    def times(self) -> FloatArray:
        """Times from start (N,) [s]."""
        return self.times_ns / NS_PER_S

    @property
    def duration(self) -> float:
        """Time from start of the last point [s]."""
        return float(self.times_ns[-1]) / NS_PER_S

    @cached_property
    def trajectory_id(self) -> str:
        """Hash of the exact content: sha256, the first 16 hex characters."""
        digest = hashlib.sha256()
        for name in self.joint_names:
            digest.update(name.encode() + b"\0")
        digest.update(np.ascontiguousarray(self.times_ns, dtype="<i8").tobytes())
        for mark, values in (
            (b"q", self.positions),
            (b"v", self.velocities),
            (b"a", self.accelerations),
        ):
            if values is not None:
                digest.update(mark + np.ascontiguousarray(values, dtype="<f8").tobytes())
        return digest.hexdigest()[:_ID_LENGTH]

    def coefficients(self) -> tuple[FloatArray, FloatArray]:
        """Polynomials c (N-1, n, 6) and durations (N-1,) [s] of the segments.

        q(t) = sum_k c[s, j, k] t^k with t from the start of segment s.
        """
        return self._polynomials

    def sample(self, t: ArrayLike) -> MotionSamples:
        """Motion at times t (M,) from start [s]; the robot rests before the first point and after
        the last.

        At a point that two segments share the later one counts. Raises TrajectoryError for times
        that are not finite.
        """
        instants = np.asarray(t, dtype=np.float64)
        if instants.ndim != 1 or not np.isfinite(instants).all():
            raise TrajectoryError("sample times must be a finite array (M,)")
        durations = self._polynomials[1]
        times = self.times
        if len(durations) == 0:
            rest = np.zeros((len(instants), len(self.joint_names)))
            return MotionSamples(np.repeat(self.positions, len(instants), axis=0), rest, rest, rest)
        segment = np.clip(np.searchsorted(times, instants, side="right") - 1, 0, len(durations) - 1)
        local = np.clip(instants - times[segment], 0.0, durations[segment])
        samples = MotionSamples(*evaluate(self._powers.take(segment, axis=1), local))
        outside = (instants < times[0]) | (instants > times[-1])
        for derivative in samples[1:]:
            derivative[outside] = 0.0
        return samples

    def reordered(self, joint_names: Sequence[str]) -> JointTrajectory:
        """Put the same motion into the expected joint order; the names must be the same set."""
        expected = tuple(joint_names)
        unknown = [name for name in self.joint_names if name not in expected]
        missing = [name for name in expected if name not in self.joint_names]
        if unknown or missing:
            what = (
                f"unknown joint {unknown[0][:80]!r}"
                if unknown
                else f"joint {missing[0]!r} is missing"
            )
            raise JointNamesError(f"{what}: expected are {', '.join(expected)}")
        if self.joint_names == expected:
            return self
        order = [self.joint_names.index(name) for name in expected]
        return JointTrajectory(
            expected,
            self.times_ns,
            self.positions[:, order],
            None if self.velocities is None else self.velocities[:, order],
            None if self.accelerations is None else self.accelerations[:, order],
        )

    def until(self, time: float) -> JointTrajectory:
        """The same motion as far as `time` [s], which is rounded to a nanosecond. Raises
        TrajectoryError: beyond its ends, and without accelerations, which a cut needs.
        """
        if self.velocities is None or self.accelerations is None:
            raise TrajectoryError(
                "the trajectory has no accelerations: it can't be cut between its points"
            )
        is_time = abs(time) * NS_PER_S < _MAX_TIME_NS  # NaN isn't
        at = round(time * NS_PER_S) if is_time else -1
        if not self.times_ns[0] <= at <= self.times_ns[-1]:
            raise TrajectoryError(
                f"time is {time:.9g} s: the trajectory lasts from {self.times[0]:.9g} to "
                f"{self.duration:.9g} s"
            )
        before = int(np.searchsorted(self.times_ns, at))
        if self.times_ns[before] == at:
            last = tuple(values[before] for values in self._derivatives)
        else:
            last = tuple(values[0] for values in self.sample([at / NS_PER_S])[:3])
        positions, velocities, accelerations = (
            np.concatenate([values[:before], value[None]])
            for values, value in zip(self._derivatives, last, strict=True)
        )
        times = np.append(self.times_ns[:before], at)
        return JointTrajectory(self.joint_names, times, positions, velocities, accelerations)

    @property
    def last(self) -> MotionSamples:
        """Motion (1, n) at the last point, as its values say; what they don't say is 0."""
        still = np.zeros_like(self.positions[-1:])
        velocity = still if self.velocities is None else self.velocities[-1:]
        acceleration = still if self.accelerations is None else self.accelerations[-1:]
        return MotionSamples(self.positions[-1:], velocity, acceleration, still)

    def then(self, following: JointTrajectory) -> JointTrajectory:
        """This motion and, from its last point on, the one that begins there. Raises
        TrajectoryError where it begins more than 1e-6 rad away.
        """
        if (
            self.velocities is None
            or self.accelerations is None
            or following.velocities is None
            or following.accelerations is None
        ):
            raise TrajectoryError("trajectories without accelerations are not joined")
        after = following.reordered(self.joint_names)
        away = np.abs(after.positions[0] - self.positions[-1])
        j = int(away.argmax())
        if away[j] > _JOINED:
            raise TrajectoryError(
                f"{self.joint_names[j]} begins {away[j]:.3g} rad from where it was: at most "
                f"{_JOINED:g} rad",
                joint=j,
            )
        times = self.times_ns[-1] + after.times_ns - after.times_ns[0]
        values = [
            np.concatenate([mine, others[1:]])
            for mine, others in zip(self._derivatives, after._derivatives, strict=True)
        ]
        return JointTrajectory(self.joint_names, np.append(self.times_ns, times[1:]), *values)

    @property
    def _derivatives(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Positions and their two derivatives at the points, which have both."""
        assert self.velocities is not None
        assert self.accelerations is not None
        return self.positions, self.velocities, self.accelerations

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, JointTrajectory):
            return NotImplemented
        return self.trajectory_id == other.trajectory_id

    def __hash__(self) -> int:
        return hash(self.trajectory_id)

    @cached_property
    def _powers(self) -> FloatArray:
        """The polynomials (6, N-1, n), each power's coefficients together."""
        return np.ascontiguousarray(self._polynomials[0].transpose(2, 0, 1))

    @cached_property
    def _polynomials(self) -> tuple[FloatArray, FloatArray]:
        durations = np.diff(self.times_ns) / NS_PER_S
        coefficients = hermite_coefficients(
            self.positions, self.velocities, self.accelerations, durations
        )
        durations.flags.writeable = False
        coefficients.flags.writeable = False
        return coefficients, durations


def _checked_times(times_ns: ArrayLike) -> IntArray:
    given = np.asarray(times_ns)
    if given.ndim != 1:
        raise TrajectoryError(f"times_ns have shape {given.shape}: they must be (N,)")
    if given.size == 0:
        raise TrajectoryError("the trajectory has no points")
    if not np.issubdtype(given.dtype, np.integer):
        raise TrajectoryError(f"times_ns are {given.dtype}: they must be whole nanoseconds")
    times: IntArray = given.astype(np.int64)
    if times[0] < 0:
        raise TrajectoryError(f"point 0: time {times[0] / NS_PER_S:.9f} s is negative", point=0)
    for k in np.flatnonzero(np.diff(times) <= 0)[:1] + 1:
        raise TrajectoryError(
            f"point {k}: time {times[k] / NS_PER_S:.9f} s is not after "
            f"{times[k - 1] / NS_PER_S:.9f} s of the point before",
            point=int(k),
        )
    times.flags.writeable = False
    return times


def _checked_values(values: ArrayLike, what: str, shape: tuple[int, int]) -> FloatArray:
    array: FloatArray = np.array(values, dtype=np.float64)
    if array.shape != shape:
        raise TrajectoryError(
            f"{what} values have shape {array.shape}: {shape[0]} points of {shape[1]} joints are "
            f"{shape}"
        )
    for k, j in np.argwhere(~np.isfinite(array))[:1]:
        raise TrajectoryError(
            f"point {k} joint {j} {what} is not finite", point=int(k), joint=int(j)
        )
    array.flags.writeable = False
    return array
