"""Which chain of configurations and which movements fill a cycle time with the least energy at the
mains.
"""

from dataclasses import dataclass

import numpy as np

from ir_msgs_py.status import Status, StatusCode
from ir_planner.errors import RequestError
from ir_planner.program.chain import cheapest_chain
from ir_planner.program.choice import Choice, Steps
from ir_planner.program.cycle_time import Task, Timed, shared_out
from ir_planner.program.gap import cycle_bound
from ir_planner.program.ladder import FASTEST, LADDER
from ir_planner.program.movements import rates_of
from ir_planner.program.request import Progress, StageError
from ir_planner.program.station_graph import Chain
from ir_planner.program.time_values import TimeValues
from ir_planner.request import DURATION_MAX
from ir_planner.timing import Movement

_ROUNDING = 1e-6  # s: durations are whole nanoseconds, stretched by millionths
_SAME_CHAIN = (
    1  # rungs from the request's own value, over which its chain is taken to stay the best
)


_CUT = "no program of {:g} s found"
_LITTLE = (
    "no program of {:g} s found, the shortest is {:.3f} s; max_iterations ended before all was "
    "tried: more of it may help"
)


@dataclass(frozen=True, eq=False)
class TimedChoice:
    """A chain with movements that fill a cycle; bound: the least that movements and wait can take
    from the mains [J].
    """

    choice: Choice
    timed: Timed
    cycle_time: float
    bound: float = 0.0

    @property
    def steps(self) -> Steps:
        """The steps of the program, with the wait that fills its cycle."""
        return self.choice.steps(self.timed.movements, until=self._until)

    @property
    def energy(self) -> float:
        """Joules of all steps at the mains, carried charge included."""
        return sum(
            step.report.energy
            for step in self.choice.energies(self.timed.movements, until=self._until)
        )

    @property
    def _until(self) -> float:
        return self.cycle_time if self.timed.wait > 0.0 else 0.0


def timed_choice(  # noqa: C901
    choice: Choice, cycle_time: float, standing: float, progress: Progress
) -> TimedChoice:
    """The cheapest movements for a cycle [s] of which `standing` s are pauses. Candidates are the
    given chain, and the one that is cheapest at the value that a second has in the cycle.

    Raises RequestError where the cycle is shorter than the fastest movements, StageError where more
    work could find faster ones.
    """
    seconds = cycle_time - standing + _ROUNDING
    first = _tried(choice, seconds, standing, None)
    rates = rates_of(choice.movements.context)
    rung = first.rung
    bound = 0.0
    if rates.joule and choice.movements.context.options.objective != "movement_cost":
        bound = first.bound(choice.chain, rates.second, seconds)
    if first.timed is not None and rung == FASTEST:
        rung = (
            FASTEST - 1
        )  # the chain that is fastest of all is not needed, and says nothing of joules
    other = None
    if abs(rung - choice.ladder.first) > _SAME_CHAIN:
        other = _cheapest_at(rung, choice, progress)
    best = first
    if other is not None:
        if other.chain.chosen != choice.chain.chosen:
            second = _tried(other, seconds, standing, rung)
            best = second if second.energy < first.energy else first
        if rung != FASTEST:
            bound = max(bound, best.bound(other.chain, LADDER[rung], seconds))
    if best.timed is None:
        best = _fastest(best, seconds, standing, progress)
    if best.timed is None:
        work = choice.movements.context.work
        shortest = best.values.shortest
        if work.exhausted:
            raise StageError(Status(StatusCode.PLANNING_FAILED, _CUT.format(cycle_time)))
        if work.left < work.improvement:  # the last movements had less than they can use
            little = _LITTLE.format(cycle_time, shortest + standing)
            raise StageError(Status(StatusCode.PLANNING_FAILED, little))
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"cycle_time is {cycle_time:g} s: the shortest is {shortest + standing:.3f} s, "
            f"of which {standing:.3f} s are pauses",
        )
    return TimedChoice(best.choice, best.timed, cycle_time, bound)


@dataclass(frozen=True, eq=False)
class _Tried:
    """A chain in a cycle: its movements by value, the rung that it needs, its program (None: too
    slow).
    """

    choice: Choice
    values: TimeValues
    rung: int
    timed: Timed | None

    @property
    def energy(self) -> float:
        """Of the program [J]."""
        return np.inf if self.timed is None else self.timed.energy

    def bound(self, chain: Chain, value: float, seconds: float) -> float:
        """Least energy [J] in a cycle, by the bound of the cheapest chain at a value; movements of
        other values that are cheaper at this one show that the bound is too high.
        """
        return cycle_bound(self.choice, min(chain.bound, self.values.least(value)), value, seconds)


def _tried(choice: Choice, seconds: float, standing: float, rung: int | None) -> _Tried:
    values = TimeValues(choice.ladder, choice.parts)
    with choice.movements.context.journal.stage("cycle time") as notes:
        found = values.bracket(seconds, rung)
        timed = shared_out(values, task_of(choice, seconds, standing))
        notes.append("too short for the chain" if timed is None else f"{timed.energy:.0f} J")
    return _Tried(choice, values, found, timed)


def _fastest(best: _Tried, seconds: float, standing: float, progress: Progress) -> _Tried:
    """The chain that is fastest of all, where that is faster than the best so far, which is too
    slow; once work has ended, the one of straight segments. At high values of a second some
    movements are faster than those for time alone, which are all that a request for time has tried.
    """
    own = best.choice
    again = [own] if own.ladder.first == FASTEST else []
    other = _cheapest_at(FASTEST, own, progress)
    if other is not None and other.chain.chosen != own.chain.chosen:
        again.append(other)
    tried = [best, *(_tried(choice, seconds, standing, FASTEST - 1) for choice in again)]
    return min(tried, key=lambda each: (each.energy, each.values.shortest))


def _cheapest_at(rung: int, choice: Choice, progress: Progress) -> Choice | None:
    """The chain that is cheapest at a value of a second; None where that has none."""
    try:
        chain = cheapest_chain(choice.ladder.roughly(rung), choice.ladder.improvement, progress)
    except StageError:
        return None
    return choice.along(chain)


def task_of(choice: Choice, seconds: float, standing: float) -> Task:
    """What is to be shared out over a chain's movements and the wait; standing [s]: of pauses
    besides.
    """

    def spent(timed: Timed) -> float:
        return TimedChoice(choice, timed, seconds + standing).energy

    return Task(seconds, choice.waiting, _slower, spent)


def _slower(movement: Movement, duration: float) -> Movement | None:
    """The same movement in `duration` s, verified again; None where it isn't certified, lasts too
    long, or keeps a tool's speed.
    """
    if duration > DURATION_MAX or movement.fixed_time:
        return None
    factor = np.floor(1e6 * duration / movement.trajectory.duration) / 1e6
    slower = movement.stretched_by(max(float(factor), 1.0))
    return slower if slower.certified else None
