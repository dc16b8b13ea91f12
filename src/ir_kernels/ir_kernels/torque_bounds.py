"""What a proof of the torque limits says: per joint an upper bound of |tau| / limit over all
times.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ir_values.arrays import FloatArray

WITHIN = np.uint8(0)
EXCEEDS = np.uint8(1)
UNDECIDED = np.uint8(2)


@dataclass(frozen=True)
class TorqueBounds:
    """Enclosure of max over time of |tau(t)| / limit(qd(t)), per joint (n,).

    upper: never exceeded, rounding included. sampled: reached, at `time` s from the start of the
    trajectory; so sampled <= true maximum <= upper. verdict: WITHIN (upper <= 1: proved), EXCEEDS
    (sampled > 1), else UNDECIDED, which counts as not allowed. intervals: examined, the work. Where
    a moving joint's velocity may vanish, Coulomb friction of either sign counts (a speed below 1e-9
    rad/s is rest); a joint that rests through a segment has none.
    """

    upper: FloatArray
    sampled: FloatArray
    time: FloatArray
    verdict: NDArray[np.uint8]
    intervals: int

    @property
    def within(self) -> bool:
        """Whether the limits of all joints are proved."""
        return bool((self.verdict == WITHIN).all())


def torque_bounds(
    upper: FloatArray, sampled: FloatArray, time: FloatArray, intervals: int
) -> TorqueBounds:
    """The verdicts that follow from the bounds: upper, sampled (n,), time (n,) [s]."""
    verdict = np.where(upper <= 1.0, WITHIN, np.where(sampled > 1.0, EXCEEDS, UNDECIDED)).astype(
        np.uint8
    )
    for array in (upper, sampled, time, verdict):
        array.setflags(write=False)
    return TorqueBounds(upper, sampled, time, verdict, int(intervals))
