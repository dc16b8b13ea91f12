"""A program held against the common program, over the same seconds.

Without a cycle time, and within one that the common program can't keep, the planner's program is
planned for the time that the common program takes. In a longer cycle both wait at their ends.
"""

from dataclasses import dataclass

from ir_msgs_py.savings import ProgramSavings
from ir_planner.errors import RequestError
from ir_planner.program.choice import Choice, Steps, duration_of
from ir_planner.program.common_program import common_program
from ir_planner.program.cycle_plan import timed_choice
from ir_planner.program.request import Progress, StageError
from ir_planner.program.savings import savings_of
from ir_planner.program.spreads import Spreads

_ENDED = "planning_time or max_iterations ended before the common program was compared"


@dataclass(frozen=True, eq=False)
class Comparison:
    """Savings, of which steps, what was compared in words, and the steps of the common program."""

    savings: ProgramSavings
    steps: Steps
    compared: str
    common: Steps


def held_against_common(
    choice: Choice,
    own: Steps,
    cycle_time: float,
    standing: float,
    spreads: Spreads,
    progress: Progress,
) -> Comparison | str:
    """The comparison of a program; own: its steps in a cycle time (0: free), of which `standing` s
    are pauses. Where there is none, the sentence why.
    """
    progress("savings", 0, 1, choice.chain.cost)
    context = choice.movements.context
    with context.journal.stage("savings") as notes:
        if context.work.exhausted:
            notes.append("none")
            return f"no savings: {_ENDED}"
        try:
            common = common_program(choice)
            plain = common.steps()
            seconds = duration_of(plain)
            if cycle_time >= seconds:
                waiting = common.steps(until=cycle_time)
                words = f"both in the cycle time of {cycle_time:g} s"
                if len(waiting) > len(plain):
                    words += (
                        f", of which the common program waits {waiting[-1].duration:.2f} s "
                        "at its end"
                    )
                savings = savings_of(waiting, own, _pauses(plain), common, spreads.of)
                return Comparison(savings, own, words, waiting)
            if context.work.exhausted:
                notes.append("none")
                return f"no savings: {_ENDED}"
            steps = timed_choice(choice, seconds, standing, progress).steps
        except (StageError, RequestError) as error:
            notes.append("none")
            return f"no savings: {error}"
        words = f"both in the common program's {seconds:.2f} s"
        words += f", which can't keep {cycle_time:g} s" if cycle_time > 0.0 else ""
        return Comparison(
            savings_of(plain, steps, _pauses(plain), common, spreads.of), steps, words, plain
        )


def _pauses(steps: Steps) -> int:
    return sum(step.is_pause for step in steps)
