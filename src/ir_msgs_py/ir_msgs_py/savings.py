"""Savings of a program: against the common program, along the Pareto front, and against today's."""

from __future__ import annotations

from dataclasses import astuple, dataclass, field, replace

import numpy as np

from ir_msgs_py.report import PlannedMovement, TrajectoryReport
from ir_values.arrays import FloatArray, read_only, set_field


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

    def plus(self, other: Saving) -> Saving:
        """Both together. The ends of their intervals add up: a recording doesn't say how the
        parts hang together, and a sum has one interval wherever it is made.
        """
        return Saving(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))

    def divided(self, count: float) -> Saving:
        """That of one of so many equal parts."""
        return Saving(*(value / count for value in astuple(self)))

    @property
    def change(self) -> str:
        """The share in words: "44.5 % less", "2.8 % more"."""
        return f"{100.0 * abs(self.share):.1f} % {'more' if self.share < 0.0 else 'less'}"


QUARTER = 900.0  # s: over which suppliers measure demand


def largest_quarter(seconds: FloatArray, joules: FloatArray) -> float:
    """The largest mean power [W] of a quarter of an hour of a cycle that is repeated: stretches
    (N,) of so many seconds, in their order, each at its mean power; 0 of a cycle without duration.
    """
    cycle = seconds.sum()
    if cycle <= 0.0:
        return 0.0
    whole = QUARTER // cycle  # cycles that lie in every quarter; the rest of it lies where it costs
    rest = QUARTER - whole * cycle
    ends = np.concatenate(([0.0], np.cumsum(np.tile(seconds, 2))))
    energy = np.concatenate(([0.0], np.cumsum(np.tile(joules, 2))))
    # the largest window begins or ends where a step does
    starts = np.concatenate((ends, ends - rest))
    starts = starts[(starts >= 0.0) & (starts <= ends[-1] - rest)]
    found = np.interp(starts + rest, ends, energy) - np.interp(starts, ends, energy)
    return float((whole * joules.sum() + found.max()) / QUARTER)


@dataclass(frozen=True)
class ProgramSavings:
    """Savings of the program `program_id`; `around` of the `across` regional movements of the
    common program run around bodies. sentence: all figures with their baselines, or why there are
    none (not available). common_seconds [s]: what the common program takes where that is longer
    than what both are counted in; 0 elsewhere. common_demand [W]: the largest mean power of a
    quarter of an hour of the common program, one cycle after the other; 0 where nobody said it.
    """

    available: bool = False
    movements: Saving = field(default_factory=Saving)
    pauses: Saving = field(default_factory=Saving)
    across: int = 0
    around: int = 0
    program_id: str = ""
    sentence: str = ""
    common_seconds: float = 0.0
    common_demand: float = 0.0

    @property
    def total(self) -> Saving:
        """Movements and pauses."""
        return self.movements.plus(self.pauses)

    def of_part(self, count: float) -> ProgramSavings:
        """Those of one of `count` equal parts of the program."""
        if count == 1.0:
            return self
        return replace(
            self,
            movements=self.movements.divided(count),
            pauses=self.pauses.divided(count),
            common_seconds=self.common_seconds / count,
        )


@dataclass(frozen=True)
class ProgramPoint:
    """A program of a Pareto front: its cycle time [s], waits and pauses included, and its energy
    [J] at the mains.
    """

    cycle_time: float
    energy: float
    program_id: str


# Today's program and the planner's side by side: the planner's answer, and what a report shows.


@dataclass(frozen=True)
class HopSaving:
    """All movements from one stop to the next, or one pause: seconds, and energy [J] at the mains
    with its 90 % interval.
    """

    name: str
    is_pause: bool
    seconds: float
    energy: float
    energy_low: float
    energy_high: float
    power_mode: str = ""


@dataclass(frozen=True, eq=False)
class Side:
    """A program of the comparison. name: "today", "same cycle time", "free", "for the line";
    cycle_time [s] that it was asked for (0: free).

    movements, report, hops: empty where `problem` says why there is none. time (N,) s, watts (N,):
    power at the mains, means over even steps; high (N,): the largest of each step, without it the
    means. moving, resting: what its movements and its pauses save of today's energy; where the line
    needs more time than today's program takes, of today's that waits at its end. peak: ends of the
    90 % interval of its peak power [W].
    """

    name: str
    cycle_time: float
    movements: tuple[PlannedMovement, ...] = ()
    report: TrajectoryReport = field(default_factory=TrajectoryReport)
    hops: tuple[HopSaving, ...] = ()
    time: FloatArray = field(default_factory=lambda: np.zeros(0))
    watts: FloatArray = field(default_factory=lambda: np.zeros(0))
    high: FloatArray = field(default_factory=lambda: np.zeros(0))
    moving: Saving = field(default_factory=Saving)
    resting: Saving = field(default_factory=Saving)
    problem: str = ""
    peak: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not len(self.high):
            set_field(self, "high", self.watts)
        for name in ("time", "watts", "high"):
            set_field(self, name, read_only(getattr(self, name), name, (None,)))

    @property
    def saving(self) -> Saving:
        """What it saves in all."""
        return self.moving.plus(self.resting)

    @property
    def found(self) -> bool:
        """Whether there is such a program."""
        return bool(self.movements)

    @property
    def certified(self) -> bool:
        """Whether all of its movements are."""
        return all(step.report.certified for step in self.movements if not step.is_pause)


@dataclass(frozen=True)
class StepChange:
    """One movement or pause, as it is today and as it is planned: what is to be done, and what that
    saves.

    work: 1 a power mode, 2 other times on the same path, 3 another path. seconds: today's and
    planned.
    saving: its interval is by common draws.
    """

    name: str
    work: int
    words: str
    seconds: tuple[float, float]
    saving: Saving


@dataclass(frozen=True, eq=False)
class BeforeAfter:
    """today, and the planner's programs for the same stops and pauses; changes: from today to the
    side `towards`, those that save most, the least work first. kind: what today's program is read
    from.
    """

    name: str
    kind: str
    today: Side
    sides: tuple[Side, ...]
    towards: str
    changes: tuple[StepChange, ...]
    notes: tuple[str, ...] = ()

    @property
    def planned(self) -> Side:
        """The side that the changes lead to."""
        return next(side for side in self.sides if side.name == self.towards)


ONE_SIDED = "mostly above it: losses that the data sheet puts at zero can only add"
_NEAR = 0.2  # of the interval: a value so near to its lower end


def one_sided(value: float, low: float, high: float) -> str:
    """The reason where a value [J] is near the lower end of its interval, else ""."""
    return ONE_SIDED if high > low and value - low < _NEAR * (high - low) else ""
