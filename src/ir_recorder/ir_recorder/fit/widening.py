"""How much the noise must count so that a fit explains what it has not seen.

What residuals of neighbouring windows share is no noise of the meter but what the model lacks;
other movements will meet it too. So every movement and every rest is predicted without the part of
the data that it belongs to, and the noise counts for more until the uncertainty of such predictions
explains their errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_recorder.fit.residuals import inverse

FOLDS = 8  # of a recording, each left out once
_MOST = 1e4  # of the variance of the noise
_RATIO = 1.25  # from one factor to the next


@dataclass(frozen=True, eq=False)
class Stretch:
    """A movement or a rest: the fold it belongs to, the sum of what its samples miss, how that sum
    changes with the parameters (P,), and the variance that the meter alone gives it.
    """

    fold: int
    missing: float
    slope: FloatArray
    white: float


def fold_of(window: int, windows: int) -> int:
    """The part of a recording that window number `window` of so many belongs to: consecutive
    ones.
    """
    return min(window * FOLDS // max(windows, 1), FOLDS - 1)


def widening(
    slopes: FloatArray,
    residual: FloatArray,
    pull: FloatArray,
    deviation: FloatArray,
    stretches: Sequence[Stretch],
) -> float:
    """The least factor, 1 or more, on the variance of the noise; slopes (W, P) and residual (W,)
    are weighted by it, pull (P, P) is the prior's precision, deviation (P,) its deviations.
    """
    fold = np.array([fold_of(window, len(residual)) for window in range(len(residual))])
    parts = [
        (own.T @ own, own.T @ residual[fold == k])
        for k in range(FOLDS)
        for own in (slopes[fold == k],)
    ]
    whole = np.sum([information for information, _ in parts], axis=0)
    factor = 1.0
    while factor < _MOST:
        errors = []
        for k, (information, pulled) in enumerate(parts):
            without = inverse((whole - information) / factor + pull, deviation)
            shift = without @ pulled / factor
            errors += [
                (each.missing + each.slope @ shift) ** 2
                / (each.slope @ without @ each.slope + each.white)
                for each in stretches
                if each.fold == k
            ]
        if not errors or np.mean(errors) <= 1.0:
            break
        factor *= _RATIO
    return factor
