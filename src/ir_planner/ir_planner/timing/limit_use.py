"""How far a motion is from its limits: the factor by which it would have to last longer.

When a motion lasts f times as long on the same path, its velocities fall by f, its accelerations by
f^2 and its jerks by f^3. The part of the torque that accelerates falls by f^2; gravity stays, so
for torque the factor is an estimate, to be applied again.
"""

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_planner.scene import MotionLimits


def lasting_longer(
    limits: MotionLimits,
    velocity: FloatArray,
    acceleration: FloatArray,
    jerk: FloatArray,
    torque: FloatArray,
) -> FloatArray:
    """By what factor (...) each part of a motion should last longer, from its largest values (...,
    n); at
    most 1: within the limits. torque: share of the envelope.
    """
    factors: FloatArray = np.maximum.reduce(
        [
            (velocity / limits.velocity).max(axis=-1),
            np.sqrt((acceleration / limits.acceleration).max(axis=-1)),
            np.cbrt((jerk / limits.jerk).max(axis=-1)),
            np.sqrt(torque.max(axis=-1) / limits.torque_share),
        ]
    )
    return factors
