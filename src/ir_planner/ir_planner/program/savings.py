"""What a program saves, in three figures that stand up: movements, pauses, total.

Movements are held against the common program at equal cycle time: the planner's program is planned for the
time that the common program takes, its wait at the end counts as movement. Pauses are held against what the
controller does by itself. All energies are those at the mains, controller and tool included.
"""

from dataclasses import dataclass

from ir_msgs_py.report import PlannedMovement


@dataclass(frozen=True)
class Saving:
    """Joules at the mains of the common program and of the planned one, over the same seconds."""

    common: float
    planned: float
    seconds: float

    @property
    def share(self) -> float:
        """Saved share of the common program's energy."""
        return 1.0 - self.planned / self.common if self.common > 0.0 else 0.0


@dataclass(frozen=True)
class Savings:
    """movements, pauses and both; `around` of the `across` movements of the common program run around bodies,
    along the planner's path.
    """

    movements: Saving
    pauses: Saving
    across: int
    around: int

    @property
    def total(self) -> Saving:
        """Movements and pauses."""
        a, b = self.movements, self.pauses
        return Saving(a.common + b.common, a.planned + b.planned, a.seconds + b.seconds)

    @property
    def sentence(self) -> str:
        """All three, each with its baseline."""
        movements, pauses, total = self.movements, self.pauses, self.total
        return (
            f"movements {_percent(movements)} in {movements.seconds:.2f} s against synchronous S-curve PTP "
            f"at 100 % ({self.around} of {self.across} around bodies); pauses {_percent(pauses)} in "
            f"{pauses.seconds:.1f} s against the controller's own timers; total {_percent(total)}"
        )


def _percent(saving: Saving) -> str:
    return (
        f"{100.0 * saving.share:.1f} % less ({saving.planned / 1e3:.2f} kJ instead of "
        f"{saving.common / 1e3:.2f} kJ)"
    )


def savings_of(
    common: tuple[PlannedMovement, ...], planned: tuple[PlannedMovement, ...], across: int, around: int
) -> Savings:
    """The savings of a program over a common one with the same pauses; `planned` may wait at its end."""
    pauses = [step for step in common if step.is_pause]
    own = [step for step in planned if step.is_pause][: len(pauses)]
    moving = _energy(common) - _energy(pauses)
    seconds = sum(step.duration for step in common) - sum(step.duration for step in pauses)
    return Savings(
        Saving(moving, _energy(planned) - _energy(own), seconds),
        Saving(_energy(pauses), _energy(own), sum(step.duration for step in pauses)),
        across,
        around,
    )


def _energy(steps: tuple[PlannedMovement, ...] | list[PlannedMovement]) -> float:
    return float(sum(step.report.energy for step in steps))
