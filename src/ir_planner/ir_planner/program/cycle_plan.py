"""Which chain of configurations and which movements fill a cycle time with the least energy at the mains."""

from dataclasses import dataclass

import numpy as np

from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError
from ir_planner.program.chain import cheapest_chain
from ir_planner.program.choice import Choice, Steps
from ir_planner.program.cycle_time import Task, Timed, shared_out
from ir_planner.program.gap import cycle_bound
from ir_planner.program.ladder import FASTEST, LADDER
from ir_planner.program.movements import rates_of
from ir_planner.program.request import Progress, StageError
from ir_planner.program.time_values import TimeValues
from ir_planner.request import DURATION_MAX
from ir_planner.timing import Movement

_ROUNDING = 1e-6  # s: durations are whole nanoseconds, stretched by millionths
_SAME_CHAIN = 1  # rungs from the request's own value, over which its chain is taken to stay the best


@dataclass(frozen=True, eq=False)
class TimedChoice:
    """A chain with movements that fill a cycle; bound: the least that movements and wait can take from the
    mains [J].
    """

    choice: Choice
    timed: Timed
    cycle_time: float
    bound: float = 0.0

    @property
    def steps(self) -> Steps:
        """The steps of the program, with the wait that fills its cycle."""
        until = self.cycle_time if self.timed.wait > 0.0 else 0.0
        return self.choice.steps(self.timed.movements, until=until)


def timed_choice(choice: Choice, cycle_time: float, standing: float, progress: Progress) -> TimedChoice:
    """The cheapest movements for a cycle [s] of which `standing` s are pauses. Candidates are the given
    chain, and the one that is cheapest at the value that a second has in the cycle.

    Raises RequestError where the cycle is shorter than the fastest movements.
    """
    seconds, journal = cycle_time - standing + _ROUNDING, choice.movements.context.journal
    values = TimeValues(choice.ladder, choice.parts)
    with journal.stage("cycle time") as notes:
        rung = values.bracket(seconds)
        best = choice, shared_out(values, task_of(choice, seconds, standing))
        notes.append("too short for the chain" if best[1] is None else f"{best[1].energy:.0f} J")
    rates = rates_of(choice.movements.context)
    bound = 0.0
    if rates.joule and choice.movements.context.options.objective != "movement_cost":
        bound = cycle_bound(choice, choice.chain, rates.second, seconds)
    if abs(rung - choice.ladder.first) > _SAME_CHAIN:
        other = _cheapest_at(rung, choice, progress)
        if other is not None and rung != FASTEST:
            bound = max(bound, cycle_bound(choice, other.chain, LADDER[rung], seconds))
        if other is not None and other.chain.chosen != choice.chain.chosen:
            values = TimeValues(other.ladder, other.parts)
            with journal.stage("cycle time") as notes:
                values.bracket(seconds, rung)
                timed = shared_out(values, task_of(other, seconds, standing))
                if timed is not None and (best[1] is None or timed.energy < best[1].energy):
                    best = other, timed
                notes.append("too short for the chain" if timed is None else f"{timed.energy:.0f} J")
    if best[1] is None:
        shortest = values.seconds(FASTEST)
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"cycle_time is {cycle_time:g} s: the shortest is {shortest + standing:.3f} s, "
            f"of which {standing:.3f} s are pauses",
        )
    return TimedChoice(best[0], best[1], cycle_time, bound)


def _cheapest_at(rung: int, choice: Choice, progress: Progress) -> Choice | None:
    """The chain that is cheapest at a value of a second; None where that has none."""
    try:
        chain = cheapest_chain(choice.ladder.at(rung), choice.ladder.improvement, progress)
    except StageError:
        return None
    return choice.along(chain)


def task_of(choice: Choice, seconds: float, standing: float) -> Task:
    """What is to be shared out over a chain's movements and the wait; standing [s]: of pauses besides."""

    def spent(timed: Timed) -> float:
        return sum(step.report.energy for step in TimedChoice(choice, timed, seconds + standing).steps)

    return Task(seconds, choice.waiting, _slower, spent)


def _slower(movement: Movement, duration: float) -> Movement | None:
    """The same movement in `duration` s, verified again; None where it isn't certified or lasts too long."""
    if duration > DURATION_MAX:
        return None
    factor = np.floor(1e6 * duration / movement.trajectory.duration) / 1e6
    slower = movement.stretched_by(max(float(factor), 1.0))
    return slower if slower.certified else None
