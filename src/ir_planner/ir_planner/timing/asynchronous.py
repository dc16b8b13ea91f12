"""Asynchronous PTP: every joint takes its own time and stops when it has arrived.

Each joint has its own fastest law. Together they may ask too much of some joint's torque; then all of them
are slowed by one factor, found by halving. The joints leave the straight line between start and goal, so
clearance is another question than for the synchronous movement.
"""

import numpy as np
from ir_msgs_py.arrays import FloatArray

from ir_planner.errors import TimingError
from ir_planner.scene import STILL, Dynamics, MotionLimits, torque_use
from ir_planner.timing.time_law import GRID_S, LawLimits, StepLaws, TimeLaw, phase_steps

_HALVINGS = 8
_SAMPLE = 4  # grid steps


def own_laws(start: FloatArray, goal: FloatArray, limits: MotionLimits, dynamics: Dynamics) -> StepLaws:
    """Laws of the joints, each as fast as it can with all torques within their share.

    Raises TimingError when some joint's torque does not suffice even at a tenth of the accelerations.
    """
    delta = np.asarray(goal) - np.asarray(start)
    low, high = 0.1, 1.0
    best: StepLaws | None = None
    factor = high
    for _ in range(_HALVINGS + 1):
        laws = _laws(delta, limits, factor)
        if _torque(start, delta, laws, dynamics).max() <= limits.torque_share:
            best, low = laws, factor
            if factor == high:
                break
        else:
            high = factor
        factor = 0.5 * (low + high)
    if best is None:
        best = _laws(delta, limits, low)
        use = _torque(start, delta, best, dynamics)
        if use.max() > limits.torque_share:
            joint = int(np.argmax(use.max(axis=0)))
            raise TimingError(
                f"joint {joint + 1} needs {use[:, joint].max():.2f} times its torque at a tenth of its "
                "acceleration",
                joint,
            )
    return best


def _laws(delta: FloatArray, limits: MotionLimits, factor: float) -> StepLaws:
    size = np.maximum(np.abs(delta), STILL)
    bounds = LawLimits(
        limits.velocity * np.sqrt(factor) / size,
        limits.acceleration * factor / size,
        limits.acceleration * factor / size,
        limits.jerk * factor / size,
    )
    steps = phase_steps(bounds)
    return StepLaws(tuple(TimeLaw(tuple(int(k) for k in row)) for row in steps))


def _torque(start: FloatArray, delta: FloatArray, laws: StepLaws, dynamics: Dynamics) -> FloatArray:
    at = np.unique(
        np.concatenate([np.arange(0, laws.total, _SAMPLE), laws.switches(), laws.switches()[1:] - 1])
    )
    s, sd, sdd = laws.at(at.astype(np.int64))
    return torque_use(dynamics, start + s * delta, sd * delta, sdd * delta)


def duration(laws: StepLaws) -> float:
    """Seconds until the last joint stands."""
    return laws.total * GRID_S
