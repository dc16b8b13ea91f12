"""The stages of a descent: from a coarse spline and a smooth cost to a fine one and the bus as it
is.

A movement of least energy holds the power of the common bus near zero for long: what one joint
gives, another takes. There the cost of a joule jumps from nothing to its full price, and a descent
on the exact bus ends at the kink long before the least energy. So the switch is rounded, less from
stage to stage, until the
rounding weighs less than NEGLIGIBLE of the cost: movements of few joules take more stages.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

NEGLIGIBLE = 5e-3  # share of the cost


@dataclass(frozen=True)
class Stage:
    """One descent: halvings of the coarse spline's intervals (level), W over which the switch of
    the bus is rounded, stiffness of the penalties, evaluations of the cost, and the gain of ten
    steps that ends it.
    """

    level: int
    smoothing: float
    stiffness: float
    evaluations: int
    tolerance: float


@dataclass(frozen=True)
class Effort:
    """The stages of a refinement, the coarse one first."""

    stages: tuple[Stage, ...]

    @property
    def coarse(self) -> int:
        """Evaluations on the coarse spline."""
        return self.stages[0].evaluations

    def after(self, level: int) -> Iterator[Stage]:
        """The stages on finer splines."""
        return (stage for stage in self.stages if stage.level > level)

    @property
    def last(self) -> Stage:
        """With penalties as stiff as they get."""
        return self.stages[-1]


def decisive(stage: Stage, last: Stage, rounding: float) -> Stage:
    """The stage itself, or the last one at once where the rounding of the bus, in shares of the
    cost per W of smoothing, doesn't matter any more.
    """
    return replace(last, level=stage.level) if stage.smoothing * rounding < NEGLIGIBLE else stage


QUICK = Effort(
    (
        Stage(0, 200.0, 1.0, 50, 1e-4),
        Stage(1, 60.0, 2.0, 60, 1e-4),
        Stage(2, 10.0, 8.0, 40, 1e-4),
        Stage(2, 2.0, 40.0, 30, 1e-4),
    )
)
THOROUGH = Effort(
    (
        Stage(0, 200.0, 1.0, 80, 5e-5),
        Stage(1, 60.0, 2.0, 200, 2e-5),
        Stage(2, 20.0, 4.0, 100, 5e-5),
        Stage(2, 5.0, 16.0, 80, 5e-5),
        Stage(2, 1.5, 40.0, 60, 5e-5),
    )
)
# Where a duration is requested there are joules alone to gain. Movements of few joules need long
# descents at
# every stage: one that ended early on a coarse spline ends elsewhere on the fine one, 2 to 8 %
# above.
EXACT = Effort(
    (
        *(
            replace(stage, evaluations=3 * stage.evaluations, tolerance=stage.tolerance / 5)
            for stage in THOROUGH.stages
        ),
        Stage(3, 0.3, 40.0, 300, 1e-5),
    )
)
