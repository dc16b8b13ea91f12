"""Direct against indirect: the meter's joules beside those from positions, movement by movement."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ir_recorder.analysis.results import Analysis
from ir_recorder.intervals import Mean, mean_of, spread_of

NAN = math.nan


@dataclass(frozen=True)
class Measured:
    """A movement of `seconds` [s] by each measurement [J]: the meter, positions, torques, and
    positions with Pinocchio's torques; NaN where one is not available.
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
class Agreement:
    """Movements by both measurements, and the mean of their relative difference.

    spread: standard deviation of the relative difference over movements.
    """

    movements: tuple[Measured, ...]
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
            of = "1 movement is" if count == 1 else f"each of {count} movements is"
            return f"the indirect measurement of {of} {shown} off the meter"
        low = 100.0 * self.difference.low
        high = 100.0 * self.difference.high
        agree = "no difference is shown" if low <= 0.0 <= high else "the two differ"
        return (
            f"over {count} movements the indirect measurement is {shown} off the meter, between "
            f"{low:+.1f} and {high:+.1f} % with 90 % confidence: {agree}; single movements "
            f"spread by {100.0 * self.spread:.1f} %"
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
        mean_of(differences),
        spread_of(differences),
    )
