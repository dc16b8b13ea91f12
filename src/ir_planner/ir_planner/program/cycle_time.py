"""Programs of least energy at the mains in a cycle time, and the front over cycle times."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ir_kernels import portable
from ir_msgs_py.status import Status, StatusCode
from ir_planner.errors import RequestError
from ir_planner.program.choice import Choice, Found, JoinedMovement, Steps
from ir_planner.program.movement_fronts import FASTEST, FrontPoint, SlowDown, TimeValues, slow_downs
from ir_planner.program.movements import rates_of
from ir_planner.program.request import Progress, StageError
from ir_planner.program.station_chain import cheapest_chain
from ir_planner.program.station_graph import HopPart, StationChain
from ir_planner.request import DURATION_MAX
from ir_planner.timing import Movement

# A program within a cycle time: the seconds there are go where they save most joules.
#
# The movements of the chain are known at several values of a second (movement_fronts). From the
# fastest of all, parts are slowed down in the order of joules saved per second; a step that takes
# more than the time left is passed over. Every stage of that is a program that ends early and
# waits, in the mode of least energy for the wait's length; the cheapest of them is the answer.
# What is left of the time is given to the next part in turn where that is cheaper than waiting.

_NEAREST = 8  # programs that are cheapest without carried charge: with it one of them is
# s: less is given to a movement, so that a program doesn't end with a twitch of a pause
SHORTEST_WAIT = 0.05


@dataclass(frozen=True, eq=False)
class Timed:
    """A movement for every part, how long to wait at the end [s], and the joules at the mains."""

    movements: dict[HopPart, Movement]
    wait: float
    energy: float


class CycleTask(NamedTuple):
    """seconds: for movements and the wait. waiting(seconds): joules of the wait. slower(movement,
    seconds): the same in more seconds, None where that isn't certified. spent: joules of a whole
    program, with carried charge.
    """

    seconds: float
    waiting: Callable[[float], float]
    slower: Callable[[Movement, float], Movement | None]
    spent: Callable[[Timed], float] = lambda timed: timed.energy


def shared_out(values: TimeValues, task: CycleTask) -> Timed | None:
    """The cheapest distribution of the time over movements and wait; None where it is too short."""
    fronts = values.fronts()
    chosen = {part: front[0] for part, front in fronts.items()}
    spare = task.seconds - sum(point.seconds for point in chosen.values())
    if spare < 0.0:
        return None
    steps = slow_downs(fronts)
    too_long: dict[HopPart, SlowDown] = {}  # the first step of a part that doesn't fit, and ends it
    options = _filled(chosen, spare, steps, task)
    for k, step in enumerate(steps):
        if step.part in too_long:
            continue
        if step.seconds > spare:
            too_long[step.part] = step
            continue
        chosen = {**chosen, step.part: fronts[step.part][step.to]}
        spare -= step.seconds
        options += _filled(chosen, spare, [*too_long.values(), *steps[k + 1 :]], task)
    options.sort(key=lambda timed: timed.energy)
    whole = [replace(timed, energy=task.spent(timed)) for timed in options[:_NEAREST]]
    return min(whole, key=lambda timed: timed.energy, default=None)


def _to_slow(point: FrontPoint) -> tuple[bool, float]:
    """The last to be slowed down is the longest movement, but none along a path at a tool's
    speed.
    """
    return not point.movement.fixed_time, point.seconds


def _filled(
    chosen: dict[HopPart, FrontPoint], left: float, open_steps: list[SlowDown], task: CycleTask
) -> list[Timed]:
    """Programs of these points: one that waits at the end, and one in which a part takes the time
    left.
    """
    movements = {part: point.movement for part, point in chosen.items()}
    energy = sum(movement.energy.total for movement in movements.values())
    options = [Timed(movements, left, energy + task.waiting(left))] if left >= SHORTEST_WAIT else []
    if not chosen:  # pauses alone: nothing can be slowed down
        return options or [Timed(movements, 0.0, energy)]
    last = bool(open_steps) and left <= open_steps[0].seconds
    if not (last or not open_steps or left < SHORTEST_WAIT):
        return options  # a whole step fits: that program comes next
    part = (
        open_steps[0].part if open_steps else max(chosen, key=lambda part: _to_slow(chosen[part]))
    )
    before = movements[part]
    after = task.slower(before, before.trajectory.duration + left)
    if after is not None:
        more = after.energy.total - before.energy.total
        options.append(Timed({**movements, part: after}, 0.0, energy + more))
    return options


# How far above the best an answer can be: of its cost, what lies above a lower bound, in percent.
#
# The bound is that of the chains (station_graph), less what carried charge could save: at most
# the capacitor's energy per movement. Within a cycle time it is the Lagrangian one: no chain
# costs less at a value of a second than the best one at that value, so none has less energy than
# that leaves of any time spent moving.

_SHARES = 128  # of a cycle that may be spent moving, at which the bound is looked at


def free_gap(choice: Choice, found: Found, steps: Steps) -> float:
    """Gap [%] of a program without a cycle time."""
    context = choice.movements.context
    chain = choice.chain
    rates = rates_of(context)
    if rates.joule == 0.0 or context.options.objective == "movement_cost" or not found:
        return 100.0 * chain.gap
    alone = sum(movement.energy.total for movement in found.values())
    received = alone - sum(step.report.energy for step in steps if not step.is_pause)
    return _above(chain.cost - received, chain.bound - could_be_carried(choice, len(found)))


def cycle_gap(choice: Choice, count: int, energy: float, bound: float) -> float:
    """Gap [%] of a program of `count` movements within a cycle time: its energy at the mains
    without the pauses in it, and the `bound` of `cycle_bound` [J].
    """
    return _above(energy, bound - could_be_carried(choice, count))


def cycle_bound(choice: Choice, least: float, value: float, seconds: float) -> float:
    """Least energy [J] at the mains of movements and wait in a cycle of `seconds`, where no chain
    costs less than `least` at a value of a second [W].
    """
    base = choice.movements.context.scene.base_watts
    waits = np.linspace(0.0, seconds, _SHARES + 1)
    standing = np.array([choice.waiting(float(wait)) if wait > 0.0 else 0.0 for wait in waits])
    moving = seconds - waits
    return float((least + (base - value) * moving + standing).min())


def could_be_carried(choice: Choice, count: int) -> float:
    """What charge can save [J] at most over `count` movements."""
    bus = choice.movements.context.scene.dc_bus
    return bus.capacity_energy * max(count - 1, 0) if bus.regeneration != "none" else 0.0


def _above(cost: float, bound: float) -> float:
    return 100.0 * max(cost - max(bound, 0.0), 0.0) / cost if cost > 0.0 else 0.0


# Which chain of configurations and which movements fill a cycle time with the least energy at the
# mains.
#
# The values of a second that movements are known for form a ladder (movement_fronts); a rung is one
# of them, FASTEST the one where time alone counts. The rung that a chain needs for a cycle says
# what a second is worth there; another chain may be the cheapest at that value. standing: seconds
# of the program's pauses, which no choice changes.

_ROUNDING = 1e-6  # s: durations are whole nanoseconds, stretched by millionths
# rungs from the request's own value, over which its chain is taken to stay the best
_SAME_CHAIN = 1


_CUT = "no program of {:g} s found"
_LITTLE = (
    "no program of {:g} s found, the shortest is {:.3f} s{}; max_iterations ended before all was "
    "tried: more of it may help"
)


@dataclass(frozen=True, eq=False)
class TimedChoice:
    """A chain with movements that fill a cycle; bound: the least that movements and wait can take
    from the mains [J], with a rest between any two. joined: in place of movements of the chain.
    """

    choice: Choice
    timed: Timed
    cycle_time: float
    bound: float = 0.0
    joined: tuple[JoinedMovement, ...] = ()

    @property
    def steps(self) -> Steps:
        """The steps of the program, with the wait that fills its cycle."""
        return self.choice.steps(self.timed.movements, until=self._until, joined=self.joined)

    @property
    def energies(self) -> Steps:
        """The same steps with what they last and cost alone."""
        return self.choice.energies(self.timed.movements, until=self._until, joined=self.joined)

    @property
    def energy(self) -> float:
        """Joules of all steps at the mains, carried charge included."""
        return sum(step.report.energy for step in self.energies)

    @property
    def _until(self) -> float:
        return self.cycle_time if self.timed.wait > 0.0 else 0.0


def timed_choice(
    choice: Choice, cycle_time: float, standing: float, progress: Progress
) -> TimedChoice:
    """The cheapest movements for a cycle [s] of which `standing` s are pauses. Candidates are the
    given chain, and the one that is cheapest at the value that a second has in the cycle.

    Raises RequestError where the cycle is shorter than the fastest movements, StageError where more
    work could find faster ones.
    """
    seconds = cycle_time - standing + _ROUNDING
    best, bound = _cheaper_chain(choice, seconds, standing, progress)
    if best.timed is None:
        best = _fastest(best, seconds, standing, progress)
    if best.timed is None:
        raise _too_short(best, cycle_time, standing)
    return TimedChoice(best.choice, best.timed, cycle_time, bound)


def _cheaper_chain(
    choice: Choice, seconds: float, standing: float, progress: Progress
) -> tuple["_Tried", float]:
    """The cheaper of the given chain and of the one that is cheapest at the rung that the given one
    needs; and the bound of energy [J] that the cheapest chain at either value gives.
    """
    first = _tried(choice, seconds, standing, None)
    rates = rates_of(choice.movements.context)
    bound = 0.0
    if rates.joule and choice.movements.context.options.objective != "movement_cost":
        bound = first.bound(choice.chain, rates.second, seconds)

    rung = first.rung
    if first.timed is not None and rung == FASTEST:
        rung -= 1  # the chain that is fastest of all is not needed, and says nothing of joules
    if abs(rung - choice.ladder.first) <= _SAME_CHAIN:
        return first, bound
    rival = _cheapest_at(rung, choice, progress)
    if rival is None:
        return first, bound

    best = first
    if rival.chain.chosen != choice.chain.chosen:
        second = _tried(rival, seconds, standing, rung)
        best = second if second.energy < first.energy else first
    if rung != FASTEST:
        bound = max(bound, best.bound(rival.chain, choice.ladder.rates(rung).second, seconds))
    return best, bound


def _too_short(best: "_Tried", cycle_time: float, standing: float) -> StageError | RequestError:
    """Why no program fits the cycle: the work ended, or nothing is as fast."""
    work = best.choice.movements.context.work
    shortest = best.values.shortest + standing
    fixed = sum(
        movement.trajectory.duration
        for movement in best.values.fastest.values()
        if movement.fixed_time
    )
    along = f"{fixed:.3f} s are paths of the tool at their speed" if fixed else ""
    if work.exhausted:
        return StageError(Status(StatusCode.PLANNING_FAILED, _CUT.format(cycle_time)))
    if work.left < work.improvement:  # the last movements had less than they can use
        little = _LITTLE.format(cycle_time, shortest, f", of which {along}" if along else "")
        return StageError(Status(StatusCode.PLANNING_FAILED, little))
    return RequestError(
        StatusCode.INVALID_GOAL_CONSTRAINTS,
        f"cycle_time is {cycle_time:g} s: the shortest is {shortest:.3f} s, "
        f"of which {standing:.3f} s are pauses{f' and {along}' if along else ''}",
    )


class _Tried(NamedTuple):
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

    def bound(self, chain: StationChain, value: float, seconds: float) -> float:
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
    chain = best.choice
    again = [chain] if chain.ladder.first == FASTEST else []
    rival = _cheapest_at(FASTEST, chain, progress)
    if rival is not None and rival.chain.chosen != chain.chain.chosen:
        again.append(rival)
    tried = [best, *(_tried(choice, seconds, standing, FASTEST - 1) for choice in again)]
    return min(tried, key=lambda each: (each.energy, each.values.shortest))


def _cheapest_at(rung: int, choice: Choice, progress: Progress) -> Choice | None:
    """The chain that is cheapest at a value of a second; None where that has none."""
    try:
        chain = cheapest_chain(choice.ladder.roughly(rung), choice.ladder.improvement, progress)
    except StageError:
        return None
    return choice.along(chain)


def task_of(choice: Choice, seconds: float, standing: float) -> CycleTask:
    """What is to be shared out over a chain's movements and the wait; standing [s]: of pauses
    besides.
    """

    def spent(timed: Timed) -> float:
        return TimedChoice(choice, timed, seconds + standing).energy

    return CycleTask(seconds, choice.waiting, _movement_lasting, spent)


def _movement_lasting(movement: Movement, duration: float) -> Movement | None:
    """The same movement in `duration` s, verified again; None where it isn't certified, lasts too
    long, or keeps a tool's speed.
    """
    if duration > DURATION_MAX or movement.fixed_time:
        return None
    factor = np.floor(1e6 * duration / movement.trajectory.duration) / 1e6
    slower = movement.stretched_by(max(float(factor), 1.0))
    return slower if slower.prove().certified else None


# A program's energy at the mains over its cycle time: every point a certified program.
#
# All points go along the chain of the free plan, which is not the cheapest for every cycle time; a
# request with a point's cycle time looks for a better one as well.

_FULLEST = 1.001  # of the movements' shortest time: durations are rounded to nanoseconds


def front_of(choice: Choice, count: int, standing: float, progress: Progress) -> list[TimedChoice]:
    """`count` programs from the shortest cycle time to twice the free one, shortest first;
    standing: seconds of the pauses in the program.

    Energy falls to the cheapest cycle time and rises from there, by what a second of waiting costs.
    There is none where time or work have ended.
    """
    work = choice.movements.context.work
    values = TimeValues(choice.ladder, choice.parts)
    if work.exhausted:
        return []
    values.bracket(0.0)
    shortest = values.shortest * _FULLEST
    longest = max(2.0 * values.own_seconds + standing, shortest)
    times = portable.geomspace(shortest, longest, count) if count > 1 else np.array([shortest])
    for k, seconds in enumerate(times.tolist()):
        progress("pareto front", k, count, choice.chain.cost)
        if not work.exhausted:
            values.bracket(seconds)
    front = []
    for seconds in times.tolist():  # every point from all movements that are known by now
        timed = shared_out(values, task_of(choice, seconds, standing))
        if timed is not None:
            front.append(TimedChoice(choice, timed, seconds + standing))
    return front
