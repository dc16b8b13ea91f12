"""What a program saves against the common program, in three figures; and the points of its Pareto front."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Saving:
    """Joules at the mains of the common program and of the planned one, over the same seconds."""

    common: float = 0.0
    planned: float = 0.0
    seconds: float = 0.0

    @property
    def share(self) -> float:
        """Saved share of the common program's energy."""
        return 1.0 - self.planned / self.common if self.common > 0.0 else 0.0

    def __add__(self, other: Saving) -> Saving:
        return Saving(self.common + other.common, self.planned + other.planned, self.seconds + other.seconds)


@dataclass(frozen=True)
class ProgramSavings:
    """Savings of the program `program_id`; `around` of the `across` regional movements of the common program
    run around bodies. sentence: all figures with their baselines, or why there are none (not available).
    """

    available: bool = False
    movements: Saving = field(default_factory=Saving)
    pauses: Saving = field(default_factory=Saving)
    across: int = 0
    around: int = 0
    program_id: str = ""
    sentence: str = ""

    @property
    def total(self) -> Saving:
        """Movements and pauses."""
        return self.movements + self.pauses


@dataclass(frozen=True)
class ProgramPoint:
    """A program of a Pareto front: its cycle time [s], waits and pauses included, and its energy [J] at the
    mains.
    """

    cycle_time: float
    energy: float
    program_id: str
