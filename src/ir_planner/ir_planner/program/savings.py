"""What a program saves, in three figures that stand up: movements, pauses, total.

Movements are held against the common program at equal cycle time; a wait at the end counts as movement.
Pauses are held against what the controller does by itself. All energies are those at the mains, controller
and tool included.
"""

from collections.abc import Sequence
from dataclasses import replace

from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.savings import ProgramSavings, Saving
from ir_planner.program.choice import Steps, duration_of
from ir_planner.program.common_program import CommonProgram


def savings_of(common: Steps, planned: Steps, pauses: int, program: CommonProgram) -> ProgramSavings:
    """The savings of `planned` steps over those of the common `program` in the same time; the first `pauses`
    of both are the program's own, one more is a wait at the end.
    """
    standing, own = (_first_pauses(steps, pauses) for steps in (common, planned))
    seconds = duration_of(common) - duration_of(standing)
    return ProgramSavings(
        available=True,
        movements=Saving(_energy(common) - _energy(standing), _energy(planned) - _energy(own), seconds),
        pauses=Saving(_energy(standing), _energy(own), duration_of(standing)),
        across=program.across,
        around=program.around,
    )


def _first_pauses(steps: Steps, count: int) -> list[PlannedMovement]:
    return [step for step in steps if step.is_pause][:count]


def named(savings: ProgramSavings, program_id: str, compared: str) -> ProgramSavings:
    """The same as an answer: of which program, and in words, with what was compared."""
    return replace(savings, program_id=program_id, sentence=f"{sentence_of(savings)}; {compared}")


def sentence_of(savings: ProgramSavings) -> str:
    """All three figures, each with its baseline."""
    movements, pauses = savings.movements, savings.pauses
    standing = (
        f"pauses {_percent(pauses)} in {pauses.seconds:.1f} s against the controller's own timers"
        if pauses.seconds > 0.0
        else "no pauses"
    )
    return (
        f"movements {_percent(movements)} in {movements.seconds:.2f} s against synchronous S-curve PTP "
        f"at 100 % ({savings.around} of {savings.across} around bodies); {standing}; "
        f"total {_percent(savings.total)}"
    )


def _percent(saving: Saving) -> str:
    return (
        f"{100.0 * saving.share:.1f} % less ({saving.planned / 1e3:.2f} kJ instead of "
        f"{saving.common / 1e3:.2f} kJ)"
    )


def _energy(steps: Sequence[PlannedMovement]) -> float:
    return float(sum(step.report.energy for step in steps))
