"""The error of the tool: bounds of its distance from the path, its turn and its speed."""

from dataclasses import astuple, dataclass
from typing import NamedTuple

import numpy as np

from ir_kernels import portable
from ir_planner.cartesian.joint_curve import Angle, tool_poses
from ir_planner.cartesian.path_times import SentPath
from ir_planner.cartesian.place_curves import TURN_LENGTH
from ir_planner.cartesian.tool_path import ToolPath
from ir_planner.checks import ToolDerivatives, tool_derivatives
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

# How well the tool keeps to its path: bounds of its distance, its turn and its speed at every
# instant.
#
# Between two instants a curve leaves the chord of its places by at most T^2 / 8 times a bound of
# its second derivative, and the path leaves its own chord by at most du^2 / 8 times a bound of
# its. The chords are nowhere farther apart than at their ends. So the largest distance at the
# instants with these two sags is a bound of the distance at all times. The same holds for
# rotations as matrices, and for the tool's velocity.

_BETWEEN = 2e-5  # m that the bound may add between samples,
_BETWEEN_TURN = 1e-4  # rad,
_BETWEEN_SPEED = 5e-4  # and share of the speed
# s
_STEP_MAX = 0.02
_STEP_MIN = 1e-4
_PIECE = 20_000
_ROOT = np.sqrt(2.0)


@dataclass(frozen=True)
class PathAccuracy:
    """Bounds: tool_error [m]; rotation_error [rad]; speed_deviation: share of the speed asked
    for.
    """

    tool_error: float = 0.0
    rotation_error: float = 0.0
    speed_deviation: float = 0.0

    def worse(self, other: "PathAccuracy") -> "PathAccuracy":
        """The larger ones."""
        return PathAccuracy(
            *(max(a, b) for a, b in zip(astuple(self), astuple(other), strict=True))
        )


def kept_of(
    sent: SentPath, path: ToolPath, angle: Angle | None, scene: PlanningScene
) -> PathAccuracy:
    """What the trajectory that is sent keeps of the path."""
    motion = tool_derivatives(sent.trajectory, scene)
    kept = PathAccuracy()
    for k in range(len(sent.strokes)):
        judged = _Stroke(sent, k, path, angle, scene, motion)
        tau = judged.instants()
        for first in range(0, len(tau) - 1, _PIECE):
            kept = kept.worse(judged.kept(tau[first : first + _PIECE + 1]))
    return kept


class _Stroke(NamedTuple):
    """Stroke k of a path that is sent, with bounds of the tool's motion."""

    sent: SentPath
    k: int
    path: ToolPath
    angle: Angle | None
    scene: PlanningScene
    motion: ToolDerivatives

    @property
    def in_place(self) -> bool:
        """Whether the tool only turns."""
        return self.path.turns_in_place(self.k)

    @property
    def third(self) -> FloatArray:
        """A bound (S,) of the second derivative of the velocity whose size is the speed."""
        return TURN_LENGTH * self.motion.spinning if self.in_place else self.motion.jerk

    def times(self, tau: FloatArray) -> FloatArray:
        """Seconds (M,) of the trajectory at instants tau (M,) s of the law."""
        stroke = self.sent.strokes[self.k]
        last = self.sent.trajectory.duration
        return np.asarray(np.minimum(self.sent.begins[self.k] + stroke.at(tau).t, last))

    def instants(self) -> FloatArray:
        """Instants (M,) s of the law, near enough to each other for the bounds to be close."""
        law = self.sent.strokes[self.k].law
        motion = self.motion
        tau = np.union1d(self.sent.instants[self.k], law.times)
        points = self.times(tau)
        slowest = float(law.first[law.even].min()) if law.even.any() else np.inf
        allowed = (
            (_BETWEEN, motion.acceleration),
            (_BETWEEN_TURN, motion.turning),
            (_BETWEEN_SPEED * slowest, self.third),
        )
        steps = [
            8.0 * most / np.maximum(motion.between(value, points), 1e-9) for most, value in allowed
        ]
        step = np.clip(np.sqrt(np.min(steps, axis=0)), _STEP_MIN, _STEP_MAX)
        count = np.maximum(np.ceil(np.diff(points) / step), 1).astype(int)
        pieces = zip(tau[:-1], tau[1:], count, strict=True)
        return np.append(
            np.concatenate([np.linspace(a, b, n + 1)[:-1] for a, b, n in pieces]), tau[-1]
        )

    def kept(self, tau: FloatArray) -> PathAccuracy:
        """The bounds from the first of tau (M,) s to the last.

        Between two instants h apart a curve leaves its chord by at most h^2 / 8 times its second
        derivative: by that the deviations at the instants may grow.
        """
        asked = self.sent.strokes[self.k].at(tau)
        times = self.times(tau)
        moved = self.sent.trajectory.sample(times)
        wanted = tool_poses(self.path, self.angle, asked.s)
        poses = self.scene.chain.tcp_poses(moved.q)
        difference = poses - wanted
        u = self.path.parameter(asked.s)
        squared = np.diff(times) ** 2

        sags = squared * self.motion.between(self.motion.acceleration, times)
        sags += np.diff(u) ** 2 * self.path.bends(u)
        apart = np.linalg.norm(difference[:, :3, 3], axis=1)
        away = _at_most(apart, sags / 8.0)

        driven = squared * self.motion.between(self.motion.turning, times) / 8.0
        turns = driven + self._rotation_deviations(u)
        rotated = np.linalg.norm(difference[:, :3, :3], axis=(1, 2))
        norm = _at_most(rotated, _ROOT * turns)
        turn = 2.0 * portable.arcsin(min(norm / (2.0 * _ROOT), 1.0))

        jacobian = self.scene.chain.jacobian(moved.q)
        rows = TURN_LENGTH * jacobian[:, 3:] if self.in_place else jacobian[:, :3]
        velocity = np.einsum("mij,mj->mi", rows, moved.qd)
        sags = squared * self.motion.between(self.third, times) / 8.0
        return PathAccuracy(away, float(turn), self._off(tau, velocity, sags))

    def _rotation_deviations(self, u: FloatArray) -> FloatArray:
        """By how much (M - 1,) rotations asked for leave their chords between u (M,) m and the
        next.
        """
        first, second = self.path.turns(u)
        h = np.diff(u)
        if self.angle is None:
            return np.asarray((h * h) / 8.0 * second)
        rates = self.angle.rates
        bends = self.path.bends(u)
        second = second + rates.second + rates.first * bends + 2.0 * first * rates.first
        kinks = 0.0 if self.angle.smooth else rates.first * h / 2.0
        return np.asarray((h * h) / 8.0 * second + kinks)

    def _off(self, tau: FloatArray, velocity: FloatArray, sags: FloatArray) -> float:
        """The share that velocity (M, 3) m/s at tau (M,) s is off the speed where that is to be
        kept.
        """
        law = self.sent.strokes[self.k].law
        phase = law.phase(0.5 * (tau[1:] + tau[:-1]))
        even = law.even[phase] & (tau[:-1] >= law.times[phase]) & (tau[1:] <= law.times[phase + 1])
        if not even.any():
            return 0.0
        ends = np.linalg.norm(velocity, axis=1)
        most = np.maximum(ends[1:], ends[:-1]) + sags
        least = _least_between(velocity[:-1], velocity[1:]) - sags
        asked = law.first[phase[even]]
        return float(np.maximum(most[even] / asked - 1.0, 1.0 - least[even] / asked).max())


def _at_most(values: FloatArray, sags: FloatArray) -> float:
    """The largest of values (M,) with what may be added between them (M - 1,)."""
    return float((np.maximum(values[1:], values[:-1]) + sags).max())


def _least_between(first: FloatArray, second: FloatArray) -> FloatArray:
    """Least norms (M,) on the segments between vectors (M, 3)."""
    step = second - first
    share = -(first * step).sum(axis=1) / np.maximum((step * step).sum(axis=1), 1e-300)
    nearest = first + np.clip(share, 0.0, 1.0)[:, None] * step
    return np.asarray(np.linalg.norm(nearest, axis=1))
