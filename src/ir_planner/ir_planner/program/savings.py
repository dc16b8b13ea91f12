"""The common program, and what the planner's program saves against it in the same seconds."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np

from ir_description.robot import ROBOTS
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.savings import ProgramSavings, Saving, largest_quarter
from ir_planner.checks import interval
from ir_planner.errors import RequestError, TimingError
from ir_planner.program.blending import timed_with_blends
from ir_planner.program.choice import Choice, Steps, duration_of
from ir_planner.program.movement_fronts import FASTEST
from ir_planner.program.movements import Failure, Movements, mapped
from ir_planner.program.request import Progress, StageError
from ir_planner.program.spreads import Spreads
from ir_planner.program.station_graph import ACROSS, HopPart, StationChain
from ir_planner.scene import movement_cost
from ir_planner.timing import Movement, baseline, straight_steps
from ir_values.arrays import FloatArray

# The common program: what a commissioned robot would do at the same stations, to hold savings
# against.
#
# Baseline movements (straight joint segments as synchronous S-curves at full speed) through the
# same stations, at each stop the configuration that is nearest to the one before by W, turns
# included; the same service lines, as fast as they can; the same pauses, left to the controller's
# own timers. Where a segment is not free, the movement runs along the planner's path in straight
# steps with blended corners; `around` counts these.

Item = TypeVar("Item")
Result = TypeVar("Result")


class CommonProgram(NamedTuple):
    """Its chain with the movements of all parts; `around` of its `across` regional movements run
    around bodies.
    """

    choice: Choice
    found: Mapping[HopPart, Movement]
    around: int

    @property
    def across(self) -> int:
        """How many regional movements it has; to where the robot is already is none."""
        return sum(part.kind == ACROSS and _goes(self.found[part]) for part in self.found)

    def steps(self, until: float = 0.0) -> Steps:
        """Movements and pauses in order, and a wait at the end that lasts until `until` s."""
        return self.choice.steps(self.found, until=until, by_itself=True)


def _goes(movement: Movement) -> bool:
    """Whether it leads anywhere, by more than a robot is off after a movement."""
    q = movement.trajectory.positions
    return float(np.abs(q[-1] - q[0]).max()) > _THERE


_THERE = 1e-3  # rad


def common_program(choice: Choice) -> CommonProgram:
    """The common program of a request, which moves as fast as it can; it needs the request's layers
    only.

    Raises StageError where it has a movement that isn't found.
    """
    fastest = choice.ladder.at(FASTEST)
    improvement = choice.ladder.improvement
    nearest = choice.along(nearest_chain(fastest))
    parts = nearest.parts
    across = [part for part in parts if part.kind == ACROSS]
    lines = [part for part in parts if part.kind != ACROSS]
    chosen = dict(zip(lines, _all_found(lines, fastest, improvement), strict=True))
    plain = dict(
        zip(across, _side_by_side(lambda part: _plain(part, fastest), across, fastest), strict=True)
    )
    around = [part for part, movement in plain.items() if movement is None]
    chosen |= {part: movement for part, movement in plain.items() if movement is not None}
    own = Movements(fastest.route, fastest.layers, fastest.context, fastest.searches)
    paths = _all_found(around, own, 0)
    chosen |= zip(around, _side_by_side(_in_straight_steps, paths, fastest), strict=True)
    return CommonProgram(nearest, {part: chosen[part] for part in parts}, len(around))


def nearest_chain(movements: Movements) -> StationChain:
    """At each stop the configuration nearest to the one before by W."""
    chosen = [0]
    total = 0.0
    for hop in range(len(movements.route)):
        weights = movements.route.arriving(hop).weights
        here = movements.layers[hop][chosen[-1]].departure
        there = np.array([node.arrival for node in movements.layers[hop + 1]])
        costs = movement_cost(weights, here, there)
        chosen.append(int(np.argmin(costs)))
        total += float(costs.min())
    return StationChain(chosen, total, total, total)


def _plain(part: HopPart, movements: Movements) -> Movement | None:
    """The baseline movement of a part across, None where it isn't certified."""
    first, second = movements.ends(part)
    found = baseline(first, second, movements.asking(part, movements.context))
    return found if found is not None and found.prove().certified else None


def _all_found(parts: list[HopPart], movements: Movements, improvement: int) -> list[Movement]:
    """The movements of parts. Raises StageError for the first that isn't found."""
    found = list[Movement]()
    for each in movements.plan(parts, improvement):
        if isinstance(each, Failure):
            raise StageError(each.status)
        found.append(each)
    return found


def _in_straight_steps(found: Movement) -> Movement:
    """The movement along the planner's path; that itself where the other isn't certified."""
    try:
        along = straight_steps(found.path, found.context)
    except TimingError:
        return found
    return along if along.prove().certified else found


def _side_by_side(
    task: Callable[[Item], Result], items: Sequence[Item], movements: Movements
) -> list[Result]:
    """What a task that needs no work makes of every item."""
    return mapped(lambda item, _: task(item), items, movements.context, 0, [0] * len(items))


# What a program saves, in three figures that stand up: movements, pauses, total.
#
# Movements are held against the common program at equal cycle time; a wait at the end counts as
# movement. Pauses are held against what the controller does by itself. All energies are those at
# the mains, controller and tool included.

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
    saved = interval(_difference(moving), moved), interval(_difference(resting), rested)
    return ProgramSavings(
        available=True,
        movements=Saving(*moving, seconds, saved[0].low, saved[0].high),
        pauses=Saving(*resting, duration_of(standing), saved[1].low, saved[1].high),
        across=program.across,
        around=program.around,
        common_demand=_demand(common),
    )


def _demand(steps: Steps) -> float:
    """The largest mean power [W] of a quarter of an hour of these steps, repeated."""
    seconds = np.array([step.duration for step in steps])
    return largest_quarter(seconds, np.array([step.report.energy for step in steps]))


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


def _difference(pair: tuple[float, float]) -> float:
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
    moving = (
        f"movements {_percent(movements)} in {movements.seconds:.2f} s against synchronous "
        f"S-curve PTP at 100 % ({savings.around} of {savings.across} around bodies)"
        if movements.seconds > 0.0
        else "no movements"
    )
    return f"{moving}; {standing}; total {_percent(savings.total)}"


def _percent(saving: Saving) -> str:
    small = max(saving.common, saving.planned) < 1e3  # J
    unit, scale, digits = ("J", 1.0, 1) if small else ("kJ", 1e-3, 2)
    low, high = (f"{scale * end:.{digits}f}" for end in (saving.saved_low, saving.saved_high))
    within = f"{low} to {high} {unit}"
    sure = saving.certain or saving.common == saving.planned
    doubt = "" if sure else "; zero lies in it: it is open whether anything is saved"
    return (
        f"{saving.change} ({scale * saving.planned:.{digits}f} {unit} instead of "
        f"{scale * saving.common:.{digits}f} {unit}, predicted; "
        f"90 % interval of what is saved {within}{doubt})"
    )


def _energy(steps: Sequence[PlannedMovement]) -> float:
    return float(sum(step.report.energy for step in steps))


# A program held against the common program, over the same seconds.
#
# Without a cycle time, and within one that the common program can't keep, the planner's program is
# planned for the time that the common program takes. In a longer cycle both wait at their ends.

_ENDED = "planning_time or max_iterations ended before the common program was compared"


class SavingsComparison(NamedTuple):
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
) -> SavingsComparison | str:
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
                return SavingsComparison(savings, own, words, waiting)
            if context.work.exhausted:
                notes.append("none")
                return f"no savings: {_ENDED}"
            steps = timed_with_blends(choice, seconds, standing, progress).steps
        except (StageError, RequestError) as error:
            notes.append("none")
            return f"no savings: {error}"
        words = f"both in the common program's {seconds:.2f} s"
        words += f", which can't keep {cycle_time:g} s" if cycle_time > 0.0 else ""
        return SavingsComparison(
            savings_of(plain, steps, _pauses(plain), common, spreads.of), steps, words, plain
        )


def _pauses(steps: Steps) -> int:
    return sum(step.is_pause for step in steps)
