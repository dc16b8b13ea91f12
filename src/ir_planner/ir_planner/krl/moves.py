"""One motion with its law: how a controller drives a curve of the axes.

Assumptions, where a data sheet says nothing: all axes follow one seven-phase law (synchronous PTP);
axes keep their shares of the data's speed, acceleration and jerk; the tool keeps $VEL and $ACC,
whose acceleration builds up within `RAMP` seconds; where an axis or its torque can't follow, the
whole motion is slowed. A TIME_BLOCK slows a motion to the time it asks for.
"""

from dataclasses import dataclass, replace

import numpy as np

from ir_kernels import portable
from ir_krl import KrlMotionError, Place, Speeds
from ir_msgs_py.arrays import FloatArray, IntArray
from ir_planner.krl.curves import AxisLine, Curve
from ir_planner.scene import STILL, MotionLimits, PlanningScene, torque_use
from ir_planner.timing import GRID_S, TimeLaw, free_law

RAMP = 0.1  # s
_KNOTS_PER_S = 125  # of a tool path, so that points between them lie on it within micrometres
_SAMPLES = 400  # of a law, where limits are looked at
_ROUNDS = 30
_CLOSE = 1.0005  # slower than asked for, so that few rounds are needed
_HUGE = 1e9
TORQUE = 0.98  # of the envelope: between samples it needs a little more


@dataclass(frozen=True, eq=False)
class Move:
    """A curve and the law that drives it."""

    curve: Curve
    law: TimeLaw

    def switches(self) -> IntArray:
        """Grid steps (M,) at which a trajectory needs points, ascending."""
        if isinstance(self.curve, AxisLine):
            return self.law.switches()
        count = max(round(self.law.total * GRID_S * _KNOTS_PER_S), 2)
        spread = np.rint(np.linspace(0, self.law.total, count + 1)).astype(np.int64)
        return np.unique(np.concatenate([spread, self.law.switches()]))

    def at(self, steps: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """q, qd, qdd (M, n) at grid steps (M,); at rest before 0 and after the end."""
        q, qd, qdd, _ = self.states(steps)
        return q, qd, qdd

    def states(self, steps: IntArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """q, qd, qdd and the jerk but for the law's own, (M, n) each, at grid steps (M,)."""
        s, sd, sdd = self.law.at(steps)
        q, first, second, third = self.curve.at(s)
        sd = sd[:, None]
        sdd = sdd[:, None]
        qd = first * sd
        qdd = second * (sd * sd) + first * sdd
        return q, qd, qdd, third * portable.power(sd, 3) + 3.0 * second * sd * sdd


def move(
    curve: Curve,
    speeds: Speeds,
    scene: PlanningScene,
    place: Place,
    *,
    least: float = 0.0,
    jerk_share: float = 1.0,
) -> Move:
    """The quickest law of a curve that keeps the speeds, lasts at least `least` s and uses
    `jerk_share` of the axes' jerk. Raises KrlMotionError.
    """
    limits = _axis_limits(speeds, scene.limits)
    limits = replace(limits, jerk=limits.jerk * jerk_share)
    bounds = _law_bounds(curve, speeds, limits)
    slower = 1.0
    for _ in range(_ROUNDS):
        v, a, j = bounds
        made = Move(
            curve, free_law((v / slower, a / (slower * slower), j / ((slower * slower) * slower)))
        )
        needed = max(_excess(made, limits, scene), least / max(made.law.total * GRID_S, GRID_S))
        if needed <= 1.0 + 1e-9:
            return made
        slower *= needed * _CLOSE
    raise KrlMotionError("the drives can't carry the load along this path, however slowly", place)


def _axis_limits(speeds: Speeds, limits: MotionLimits) -> MotionLimits:
    """What the program leaves of the axes' limits."""
    share = np.asarray(speeds.axis_acceleration)
    kept = replace(
        limits,
        velocity=limits.velocity * np.asarray(speeds.axis_velocity),
        acceleration=limits.acceleration * share,
        jerk=limits.jerk * share,
    )
    return kept.for_speed(speeds.override)


def _law_bounds(curve: Curve, speeds: Speeds, limits: MotionLimits) -> tuple[float, float, float]:
    """Bounds of s' [1/s], s'' and s''' before the axes are looked at along the path."""
    _, first, _, _ = curve.at(np.linspace(0.0, 1.0, 65))
    rate = np.maximum(np.abs(first).max(axis=0), STILL)
    v, a, j = (
        float(np.min(bound / rate)) for bound in (limits.velocity, limits.acceleration, limits.jerk)
    )
    for size, speed, acceleration in (
        (curve.length, speeds.velocity, speeds.acceleration),
        (curve.turning, speeds.turning, speeds.turning_acceleration),
    ):
        if size > STILL:
            v = min(v, speed * speeds.override / size)
            a = min(a, acceleration * (speeds.override * speeds.override) / size)
            j = min(
                j,
                acceleration
                * (speeds.override * speeds.override)
                * speeds.override
                / (size * RAMP),
            )
    return min(v, _HUGE), min(a, _HUGE), min(j, _HUGE)


def _excess(made: Move, limits: MotionLimits, scene: PlanningScene) -> float:
    """By how much the motion must last longer, at least: 1 where it keeps all limits."""
    steps = np.unique(np.rint(np.linspace(0, made.law.total, _SAMPLES)).astype(np.int64))
    q, qd, qdd, qddd = made.states(steps)
    torque = float(torque_use(scene.dynamics, q, qd, qdd).max())
    factors = [
        float((np.abs(qd) / limits.velocity).max()),
        float(np.sqrt((np.abs(qdd) / limits.acceleration).max())),
        float(portable.cbrt((np.abs(qddd) / limits.jerk).max())),
        float(np.sqrt(torque / TORQUE)),
    ]
    return max(factors)
