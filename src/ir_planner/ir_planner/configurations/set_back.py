"""Metric distances at a step, and the set-back of a joint that ends in collision: eqs. (4) and (5).

As printed the step of eq. (5) has the wrong unit and vanishes where bodies touch. Read as a secant
it is the share of the step that is lost where the distance, taken as linear, falls to S_m. The
literal reading keeps the gain of distance in metres as the factor.
"""

import numpy as np

from ir_msgs_py.arrays import FloatArray

SECANT = "secant"
LITERAL = "literal"
NONE = "none"


def increments(before: FloatArray, after: FloatArray) -> FloatArray:
    """Eq. (4): dd_z (Z,) [m], how much each metric distance (Z,) grew in a step."""
    return np.asarray(after - before)


def shares_back(
    before: FloatArray, after: FloatArray, threshold: FloatArray, reading: str, overshoot: float
) -> FloatArray:
    """Eq. (5): which share (P,) of its last step each start's joint is set back, in [0, 1].

    `before`, `after` (P, Z) m; `threshold` (Z,) m, S_m or what the station allows. Only pairs that
    were free
    and no longer are count: setting back can't repair what was in collision before the step.
    secant: (S_m - d') / (d - d') (1 + overshoot) of the worst pair; literal: |dd_z| of it in
    metres.
    """
    result = np.zeros(len(after))
    row, z = np.nonzero((after <= threshold) & (before > threshold))
    lost = -increments(before[row, z], after[row, z])
    if reading == SECANT:
        share = np.maximum((threshold[z] - after[row, z]) / lost * (1.0 + overshoot), overshoot)
    else:
        share = lost
    np.maximum.at(result, row, np.minimum(share, 1.0))
    return result
