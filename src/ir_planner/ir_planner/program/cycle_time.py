"""A program within a cycle time: the seconds there are go where they save most joules.

The movements of the chain are known at several values of a second (time_values). From the fastest
of all, parts are slowed down in the order of joules saved per second; a step that takes more than
the time left is passed over. Every stage of that is a program that ends early and waits, in the
mode of least energy for the wait's length; the cheapest of them is the answer. What is left of the
time is given to the next part in turn where that is cheaper than waiting.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from ir_planner.program.station_graph import Part
from ir_planner.program.time_values import Point, SlowDown, TimeValues, slow_downs
from ir_planner.timing import Movement

_NEAREST = 8  # programs that are cheapest without carried charge: with it one of them is
SHORTEST_WAIT = (
    0.05  # s: less is given to a movement, so that a program doesn't end with a twitch of a pause
)


@dataclass(frozen=True, eq=False)
class Timed:
    """A movement for every part, how long to wait at the end [s], and the joules at the mains."""

    movements: dict[Part, Movement]
    wait: float
    energy: float


@dataclass(frozen=True, eq=False)
class Task:
    """seconds: for movements and the wait. waiting(seconds): joules of the wait. slower(movement,
    seconds): the same in more seconds, None where that isn't certified. spent: joules of a whole
    program, with carried charge.
    """

    seconds: float
    waiting: Callable[[float], float]
    slower: Callable[[Movement, float], Movement | None]
    spent: Callable[[Timed], float] = lambda timed: timed.energy


def shared_out(values: TimeValues, task: Task) -> Timed | None:
    """The cheapest distribution of the time over movements and wait; None where it is too short."""
    fronts = values.fronts()
    chosen = {part: front[0] for part, front in fronts.items()}
    left = task.seconds - sum(point.seconds for point in chosen.values())
    if left < 0.0:
        return None
    steps = slow_downs(fronts)
    too_long: dict[Part, SlowDown] = {}  # the first step of a part that doesn't fit, and ends it
    found = _filled(chosen, left, steps, task)
    for k, step in enumerate(steps):
        if step.part in too_long:
            continue
        if step.seconds > left:
            too_long[step.part] = step
            continue
        chosen = {**chosen, step.part: fronts[step.part][step.to]}
        left -= step.seconds
        found += _filled(chosen, left, [*too_long.values(), *steps[k + 1 :]], task)
    found.sort(key=lambda timed: timed.energy)
    whole = [replace(timed, energy=task.spent(timed)) for timed in found[:_NEAREST]]
    return min(whole, key=lambda timed: timed.energy, default=None)


def _to_slow(point: Point) -> tuple[bool, float]:
    """The last to be slowed down is the longest movement, but none along a path at a tool's
    speed.
    """
    return not point.movement.fixed_time, point.seconds


def _filled(
    chosen: dict[Part, Point], left: float, open_steps: list[SlowDown], task: Task
) -> list[Timed]:
    """Programs of these points: one that waits at the end, and one in which a part takes the time
    left.
    """
    movements = {part: point.movement for part, point in chosen.items()}
    energy = sum(movement.energy.total for movement in movements.values())
    found = [Timed(movements, left, energy + task.waiting(left))] if left >= SHORTEST_WAIT else []
    last = bool(open_steps) and left <= open_steps[0].seconds
    if not (last or not open_steps or left < SHORTEST_WAIT):
        return found  # a whole step fits: that program comes next
    part = (
        open_steps[0].part if open_steps else max(chosen, key=lambda part: _to_slow(chosen[part]))
    )
    before = movements[part]
    after = task.slower(before, before.trajectory.duration + left)
    if after is not None:
        more = after.energy.total - before.energy.total
        found.append(Timed({**movements, part: after}, 0.0, energy + more))
    return found
