"""The baseline movement: a straight joint segment as a synchronous S-curve of seven phases.

Speed, acceleration and jerk as the data file gives them, then slowed down uniformly until the
torque stays within the planner's share of the envelope, or until the duration that is asked for.
"""

from __future__ import annotations

import numpy as np
from _drives import Drives

from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

TORQUE_SHARE = 0.98  # the planner's, of what its reserve leaves
_SLOWER = 1.002  # step of the uniform slow-down
_CHECK_S = 2e-3


def phases(v: float, a: float, j: float) -> FloatArray:
    """Durations (7,) s of the fastest S-curve over a distance of 1 within speed, acceleration and
    jerk.
    """
    rise, flat = (a / j, v / a - a / j) if v * j >= a * a else (np.sqrt(v / j), 0.0)
    cruise = 1.0 / v - (2.0 * rise + flat)
    if cruise < 0.0:
        cruise = 0.0
        speed = 0.5 * (np.sqrt((a * a / j) ** 2 + 4.0 * a) - a * a / j)
        accelerates = speed * j >= a * a
        rise, flat = (a / j, speed / a - a / j) if accelerates else (np.cbrt(0.5 / j), 0.0)
    return np.array([rise, flat, rise, cruise, rise, flat, rise])


def s_curve(
    q0: FloatArray, q1: FloatArray, scene: PlanningScene, factor: float = 1.0
) -> JointTrajectory:
    """From q0 to q1 (n,) with the data's limits, `factor` times slower."""
    limits = scene.limits
    delta = q1 - q0
    size = np.maximum(np.abs(delta), 1e-12)
    v, a, j = (float(np.min(x / size)) for x in (limits.velocity, limits.acceleration, limits.jerk))
    lasting = phases(v, a, j)
    jerks = j * np.array([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0])
    states = [np.zeros(3)]
    for t, jerk in zip(lasting, jerks, strict=True):
        s, sd, sdd = states[-1]
        moved = s + t * (sd + t * (sdd / 2 + t * jerk / 6))
        states.append(np.array([moved, sd + t * (sdd + t * jerk / 2), sdd + t * jerk]))
    kept = [0, *(k + 1 for k in range(7) if lasting[k] > 1e-9)]
    times = factor * np.concatenate([[0.0], np.cumsum(lasting)])[kept]
    s, sd, sdd = np.array(states)[kept].T
    s = s / s[-1]
    sd[-1] = 0.0
    sdd[-1] = 0.0
    q, qd, qdd = (np.outer(x, delta) for x in (s, sd / factor, sdd / factor**2))
    return JointTrajectory.from_seconds(scene.cell.robot.joint_names, times, q0 + q, qd, qdd)


def fastest_baseline(q0: FloatArray, q1: FloatArray, scene: PlanningScene, drives: Drives) -> float:
    """Its least duration [s]."""
    factor = 1.0
    while True:
        trajectory = s_curve(q0, q1, scene, factor)
        at = trajectory.sample(np.arange(0.0, trajectory.duration, _CHECK_S))
        use = np.abs(drives.torque(at.q, at.qd, at.qdd)) / drives.envelope(at.qd)
        if use.max() <= TORQUE_SHARE * (1.0 - scene.limits.torque_reserve):
            return trajectory.duration
        factor *= _SLOWER


def baseline(
    q0: FloatArray, q1: FloatArray, scene: PlanningScene, duration: float
) -> JointTrajectory:
    """The movement that lasts `duration` [s], at least fastest_baseline."""
    return s_curve(q0, q1, scene, duration / s_curve(q0, q1, scene).duration)
