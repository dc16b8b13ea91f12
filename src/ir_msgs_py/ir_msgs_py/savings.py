"""What a program saves against the common program, in three figures; and the points of its Pareto
front.
"""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Saving:
    """Joules at the mains of the common program and of the planned one, over the same seconds.

    saved_low, saved_high: 90 % interval of common - planned, from the uncertainty of the power
    parameters.
    """

    common: float = 0.0
    planned: float = 0.0
    seconds: float = 0.0
    saved_low: float = 0.0
    saved_high: float = 0.0

    @property
    def saved(self) -> float:
        """Joules less than those of the common program."""
        return self.common - self.planned

    @property
    def certain(self) -> bool:
        """Whether the interval leaves zero out: else it is open whether anything is saved."""
        return self.saved_low > 0.0 or self.saved_high < 0.0

    @property
    def share(self) -> float:
        """Saved share of the common program's energy."""
        return 1.0 - self.planned / self.common if self.common > 0.0 else 0.0


@dataclass(frozen=True)
class ProgramSavings:
    """Savings of the program `program_id`; `around` of the `across` regional movements of the
    common program run around bodies. total_low, total_high: the interval of the total, which is not
    that of its parts' sum. sentence: all figures with their baselines, or why there are none (not
    available).
    """

    available: bool = False
    movements: Saving = field(default_factory=Saving)
    pauses: Saving = field(default_factory=Saving)
    across: int = 0
    around: int = 0
    program_id: str = ""
    sentence: str = ""
    total_low: float = 0.0
    total_high: float = 0.0

    @property
    def total(self) -> Saving:
        """Movements and pauses."""
        a = self.movements
        b = self.pauses
        sums = (a.common + b.common, a.planned + b.planned, a.seconds + b.seconds)
        return Saving(*sums, self.total_low, self.total_high)


@dataclass(frozen=True)
class ProgramPoint:
    """A program of a Pareto front: its cycle time [s], waits and pauses included, and its energy
    [J] at the mains.
    """

    cycle_time: float
    energy: float
    program_id: str
