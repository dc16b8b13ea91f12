"""What a program saves, in three figures that stand up: movements, pauses, total.

Movements are held against the common program at equal cycle time; a wait at the end counts as
movement. Pauses are held against what the controller does by itself. All energies are those at the
mains, controller and tool included.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.savings import ProgramSavings, Saving
from ir_planner.checks import ROBOTS, interval
from ir_planner.program.choice import Steps, duration_of
from ir_planner.program.common_program import CommonProgram

Added = Callable[[Steps], list[FloatArray]]


def savings_of(
    common: Steps, planned: Steps, pauses: int, program: CommonProgram, added: Added
) -> ProgramSavings:
    """The savings of `planned` steps over those of the common `program` in the same time; the first
    `pauses` of both are the program's own, one more is a wait at the end. added: what the drawn
    robots add to steps.
    """
    standing, own = (_first_pauses(steps, pauses) for steps in (common, planned))
    seconds = duration_of(common) - duration_of(standing)
    moving = (_energy(common) - _energy(standing), _energy(planned) - _energy(own))
    resting = (_energy(standing), _energy(own))
    moved, rested = _spreads(common, planned, pauses, added)
    saved = interval(_saved(moving), moved), interval(_saved(resting), rested)
    total = interval(_saved(moving) + _saved(resting), moved + rested)
    return ProgramSavings(
        available=True,
        movements=Saving(*moving, seconds, saved[0].low, saved[0].high),
        pauses=Saving(*resting, duration_of(standing), saved[1].low, saved[1].high),
        total_low=total.low,
        total_high=total.high,
        across=program.across,
        around=program.around,
    )


def _spreads(
    common: Steps, planned: Steps, pauses: int, added: Added
) -> tuple[FloatArray, FloatArray]:
    """What the drawn robots add (ROBOTS,) J to what movements save, and to what pauses save."""
    moved = np.zeros(ROBOTS)
    rested = np.zeros(ROBOTS)
    for steps, sign in ((common, 1.0), (planned, -1.0)):
        standing = {id(step) for step in _first_pauses(steps, pauses)}
        for step, robots in zip(steps, added(steps), strict=True):
            if id(step) in standing:
                rested += sign * robots
            else:
                moved += sign * robots
    return moved, rested


def _saved(pair: tuple[float, float]) -> float:
    return pair[0] - pair[1]


def _first_pauses(steps: Steps, count: int) -> list[PlannedMovement]:
    return [step for step in steps if step.is_pause][:count]


def named(savings: ProgramSavings, program_id: str, compared: str) -> ProgramSavings:
    """The same as an answer: of which program, and in words, with what was compared."""
    return replace(savings, program_id=program_id, sentence=f"{sentence_of(savings)}; {compared}")


def sentence_of(savings: ProgramSavings) -> str:
    """All three figures, each with its baseline."""
    movements = savings.movements
    pauses = savings.pauses
    standing = (
        f"pauses {_percent(pauses)} in {pauses.seconds:.1f} s against the controller's own timers"
        if pauses.seconds > 0.0
        else "no pauses"
    )
    return (
        f"movements {_percent(movements)} in {movements.seconds:.2f} s against synchronous "
        f"S-curve PTP at 100 % ({savings.around} of {savings.across} around bodies); {standing}; "
        f"total {_percent(savings.total)}"
    )


def _percent(saving: Saving) -> str:
    within = f"{saving.saved_low / 1e3:.2f} to {saving.saved_high / 1e3:.2f} kJ"
    sure = saving.certain or saving.common == saving.planned
    doubt = "" if sure else "; zero lies in it: it is open whether anything is saved"
    return (
        f"{100.0 * saving.share:.1f} % less ({saving.planned / 1e3:.2f} kJ instead of "
        f"{saving.common / 1e3:.2f} kJ, predicted; 90 % interval of what is saved {within}{doubt})"
    )


def _energy(steps: Sequence[PlannedMovement]) -> float:
    return float(sum(step.report.energy for step in steps))
