"""A uniform spline within the limits: the same path and speed profile, as much slower as they ask for."""

import numpy as np

from ir_planner.curves import UniformSpline
from ir_planner.scene import MotionLimits, PlanningScene, torque_use
from ir_planner.timing import lasting_longer

_TORQUE_SAMPLES = 6  # per interval; the proof comes after
_ROUNDS = 25  # gravity doesn't fall with speed: a load near the envelope takes several
_BELOW = 1.0005  # a little slower than asked for, so that few rounds end it


def beyond_limits(spline: UniformSpline, limits: MotionLimits, scene: PlanningScene) -> tuple[float, float]:
    """By what factor a spline exceeds its share of torque (at samples), and by what factor it would have to
    last longer for its speed, acceleration and jerk.
    """
    top = spline.extremes()
    torque = torque_use(scene.dynamics, *spline.samples(_TORQUE_SAMPLES)).max()
    none = np.zeros(spline.control.shape[1])
    longer = lasting_longer(limits, top.velocity, top.acceleration, top.jerk, none)
    return float(torque) / limits.torque_share, float(longer)


def slowed_to_limits(
    spline: UniformSpline, limits: MotionLimits, scene: PlanningScene
) -> UniformSpline | None:
    """The spline at its own duration or longer, within the limits; torque at samples. None where no duration
    carries it.
    """
    for _ in range(_ROUNDS):
        top = spline.extremes()
        torque = torque_use(scene.dynamics, *spline.samples(_TORQUE_SAMPLES)).max(axis=0)
        longer = float(lasting_longer(limits, top.velocity, top.acceleration, top.jerk, torque))
        if longer <= 1.0:
            return spline
        spline = UniformSpline(spline.control, spline.interval * longer * _BELOW)
    return None
