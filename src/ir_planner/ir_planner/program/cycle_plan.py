"""Which chain of configurations and which movements fill a cycle time with the least energy at the mains."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError
from ir_planner.program.chain import cheapest_chain, parts_of
from ir_planner.program.cycle_time import Task, Timed, shared_out
from ir_planner.program.movements import Movements
from ir_planner.program.request import Progress
from ir_planner.program.station_graph import Chain
from ir_planner.program.time_values import FASTEST, TimeValues
from ir_planner.request import DURATION_MAX
from ir_planner.timing import Movement

_ROUNDING = 1e-6  # s: durations are whole nanoseconds, stretched by millionths


@dataclass(frozen=True, eq=False)
class Cycle:
    """seconds: of the cycle. standing: of the pauses in the program [s]. waiting(chain, seconds): joules of
    the wait at the end.
    """

    seconds: float
    standing: float
    waiting: Callable[[Chain, float], float]


def timed_chain(
    cycle: Cycle, movements: Movements, chain: Chain, improvement: int, progress: Progress
) -> tuple[Chain, Timed]:
    """The chain and its movements within the cycle. Candidates are the given chain, and the one that is
    cheapest at the value that a second has in the cycle.

    Raises RequestError where the cycle is shorter than the fastest movements.
    """
    seconds = cycle.seconds - cycle.standing + _ROUNDING
    values = values_of(chain, movements, improvement)
    with movements.context.journal.stage("cycle time") as notes:
        rung = values.bracket(seconds)
        best = chain, shared_out(values, task_of(cycle, chain, seconds))
        notes.append("too short for the chain" if best[1] is None else f"{best[1].energy:.0f} J")
    again = values.movements(rung)
    other = cheapest_chain(again, improvement, progress)
    if other.chosen != chain.chosen:
        values = values_of(other, again, improvement)
        with movements.context.journal.stage("cycle time") as notes:
            values.bracket(seconds)
            timed = shared_out(values, task_of(cycle, other, seconds))
            if timed is not None and (best[1] is None or timed.energy < best[1].energy):
                best = other, timed
            notes.append("too short for the chain" if timed is None else f"{timed.energy:.0f} J")
    if best[1] is None:
        shortest = values.seconds(FASTEST)
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"cycle_time is {cycle.seconds:g} s: the shortest is {shortest + cycle.standing:.3f} s, "
            f"of which {cycle.standing:.3f} s are pauses",
        )
    return best[0], best[1]


def values_of(chain: Chain, movements: Movements, improvement: int) -> TimeValues:
    """The movements of a chain at the values of a second."""
    parts = [part for hop in parts_of(chain, movements) for part in hop]
    return TimeValues(movements, parts, improvement)


def task_of(cycle: Cycle, chain: Chain, seconds: float) -> Task:
    """What is to be shared out over a chain's movements and the wait."""
    return Task(seconds, lambda left: cycle.waiting(chain, left), _slower)


def _slower(movement: Movement, duration: float) -> Movement | None:
    """The same movement in `duration` s, verified again; None where it isn't certified or lasts too long."""
    if duration > DURATION_MAX:
        return None
    factor = np.floor(1e6 * duration / movement.trajectory.duration) / 1e6
    slower = movement.stretched_by(max(float(factor), 1.0))
    return slower if slower.certified else None
