"""Direct against indirect: the meter's joules beside those from positions, movement by movement."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t

from ir_msgs_py.arrays import FloatArray
from ir_recorder.analysis.results import Analysis

LEVEL = 0.90  # of all intervals
NAN = math.nan


@dataclass(frozen=True)
class Measured:
    """A movement of `seconds` [s] by each measurement [J]: the meter, positions, torques, and positions with
    Pinocchio's torques; NaN where one is not available.
    """

    label: str
    seconds: float
    direct: float
    indirect: float
    from_torques: float
    second_opinion: float

    @property
    def difference(self) -> float:
        """Indirect less direct, as a share of direct."""
        return self.indirect / self.direct - 1.0 if self.direct > 0.0 else NAN


@dataclass(frozen=True)
class Mean:
    """A mean over movements with its interval of LEVEL by Student's t; NaN where there are too few."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Agreement:
    """Movements by both measurements, and their means: energy [J] by each, and the relative difference.

    spread: standard deviation of the relative difference over movements.
    """

    movements: tuple[Measured, ...]
    direct: Mean
    indirect: Mean
    difference: Mean
    spread: float

    @property
    def sentence(self) -> str:
        """The finding in words, for people."""
        count = sum(math.isfinite(each.difference) for each in self.movements)
        if not count:
            return "direct and indirect measurement can't be compared: one of them is missing"
        shown = f"{100.0 * self.difference.value:+.1f} %"
        if math.isnan(self.difference.low):
            return f"the indirect measurement of 1 movement is {shown} off the meter"
        low, high = 100.0 * self.difference.low, 100.0 * self.difference.high
        agree = "no difference is shown" if low <= 0.0 <= high else "the two differ"
        return (
            f"over {count} movements the indirect measurement is {shown} off the meter, between {low:+.1f} "
            f"and {high:+.1f} % with 90 % confidence (t): {agree}; single movements spread by "
            f"{100.0 * self.spread:.1f} %"
        )


def agreement(analysis: Analysis) -> Agreement:
    """Both measurements of all movements of a recording that ended."""
    rows = tuple(
        Measured(
            result.step.label,
            result.seconds,
            result.energy,
            result.indirect_energy,
            result.torque_energy,
            result.second_opinion,
        )
        for result in analysis.movements
        if result.step.outcome == "ended"
    )
    both = [row for row in rows if math.isfinite(row.difference)]
    differences = np.array([row.difference for row in both])
    return Agreement(
        rows,
        mean_of([row.direct for row in both]),
        mean_of([row.indirect for row in both]),
        mean_of(differences),
        float(differences.std(ddof=1)) if len(both) > 1 else NAN,
    )


def mean_of(values: Sequence[float] | FloatArray) -> Mean:
    """The mean of independent values (N,) with its interval."""
    array = np.asarray(values, float)
    if not len(array):
        return Mean(NAN, NAN, NAN)
    mean = float(array.mean())
    if len(array) < 2:
        return Mean(mean, NAN, NAN)
    half = float(t.ppf(0.5 + 0.5 * LEVEL, len(array) - 1) * array.std(ddof=1) / math.sqrt(len(array)))
    return Mean(mean, mean - half, mean + half)
