"""More work on a program: one program first, then better ones while work is left.

The first program is looked for with the same effort whatever the request allows, so that a request
with more work knows everything that one with less knows. Then the chain is chosen again with more
withdrawals and a finer tolerance, and the regional movements of the best chain are planned again
with more work, both in steps of fixed size. What is cheaper is kept: more work never costs more.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

from ir_planner.errors import RequestError
from ir_planner.program.blending import (
    NOTHING_CHEAPER,
    STAGE,
    Blending,
    timed_with_blends,
)
from ir_planner.program.choice import Choice, Found, Steps
from ir_planner.program.cycle_time import cycle_gap, free_gap
from ir_planner.program.movement_fronts import FASTEST, Ladder, TimeValues
from ir_planner.program.movements import Movements, WarmStarts, cost_of, rates_of
from ir_planner.program.request import ProgramRequest, Progress, StageError
from ir_planner.program.station_chain import cheapest_chain, layers_of
from ir_planner.program.station_graph import ACROSS
from ir_planner.program.steps import Route
from ir_planner.request import Context, Work
from ir_planner.service import exit_searches

# work of a movement while configurations are chosen; more of it improves the chosen ones
_CHOOSING = 2_500
_FIRST = 8_000  # max_iterations of a stop that buy no more than the first program
_DEEPER = tuple(16_000 * 4**k for k in range(9))  # that buy a chain chosen with more effort
_MORE = tuple(8_000 * 4**k for k in range(9))  # work of a movement of the chosen chain
_HALF = 0.5  # of what is left: for the chain again; the rest is for its movements


@dataclass(frozen=True, eq=False)
class ChainAnswer:
    """A program along a chain. standing: seconds of the pauses in it; gap [%]: as in the answer, of
    the program that stands still between its movements.
    """

    choice: Choice
    steps: Steps
    standing: float
    gap: float

    @property
    def cost(self) -> float:
        """By the objective: of the movements, carried charge included; in a cycle time the joules
        of all.
        """
        context = self.choice.movements.context
        if self.choice.request.cycle_time > 0.0:
            return sum(step.report.energy for step in self.steps)
        moving = [step.report for step in self.steps if not step.is_pause]
        rates = rates_of(context)
        if context.options.objective == "movement_cost":
            return sum(report.movement_cost for report in moving)
        return sum(cost_of(report, rates) for report in moving)


def best_answer(
    request: ProgramRequest, route: Route, context: Context, progress: Progress
) -> ChainAnswer:
    """The best program that the work of a request buys. The synchronous one is a candidate of an
    asynchronous request too, unless that names a planner and isn't for the fastest.

    Raises StageError where none is found, RequestError where the cycle is too short.
    """
    options = context.options
    as_named = options.planner_id != "" and options.objective != "time"
    if options.timing != "asynchronous" or as_named:
        return _best(request, route, context, progress)
    try:
        common = _best(request, route, context.with_timing("synchronous"), progress)
    except (StageError, RequestError):
        return _best(request, route, context, progress)
    try:
        own = _best(request, route, context, progress)
    except (StageError, RequestError):
        own = common
    if own.cost < common.cost:
        return own
    context.journal.timing = "synchronous"
    return common


def _best(
    request: ProgramRequest, route: Route, context: Context, progress: Progress
) -> ChainAnswer:
    """The best program of synchronous, or of asynchronous movements."""
    work = context.work
    with _limited(work, work.left, min(work.improvement, _FIRST)):
        best = _first_program(request, route, context, progress)
    followed = request.savings or request.front_points > 0
    with _limited(work, int(_HALF * work.left) if followed else work.left, work.improvement):
        for improvement in _DEEPER:
            if improvement > work.improvement or work.exhausted:
                break
            again = _again(request, route, context, progress, improvement)
            if again is None:
                break
            best = min(best, again, key=lambda answer: answer.cost)
        return best if request.cycle_time > 0.0 else _with_better_movements(best, progress)


def _first_program(
    request: ProgramRequest, route: Route, context: Context, progress: Progress
) -> ChainAnswer:
    """The first program. A cycle time that is too short along the cheapest chain may do along that
    of the fastest program: what one objective can do is refused by none.
    """
    try:
        return planned(chosen(request, route, context, progress), progress)
    except RequestError:
        if (
            request.cycle_time <= 0.0
            or context.options.objective == "time"
            or context.work.exhausted
        ):
            raise
    return planned(chosen(request, route, context.asking("time"), progress), progress)


def chosen(request: ProgramRequest, route: Route, context: Context, progress: Progress) -> Choice:
    """The cheapest chain of configurations. Raises StageError where there is none."""
    settings = request.settings
    exits = exit_searches(settings.withdrawal)
    searches = settings.searches
    layers = layers_of(route, request.start, context, exits, progress, settings.interaction)
    near = None
    if context.options.objective == "time":  # the fastest lines are found from slower ones
        near = WarmStarts(
            scaling=Movements(route, layers, context.asking("time_and_energy"), searches)
        )
    movements = Movements(route, layers, context, searches, near)
    improvement = min(settings.improvement_iterations, _CHOOSING)
    chain = cheapest_chain(movements, improvement, progress)
    return Choice(request, Ladder(movements, improvement), chain)


def planned(choice: Choice, progress: Progress) -> ChainAnswer:
    """The program along a chain, within the cycle time of its request."""
    cycle = choice.request.cycle_time
    found: Found = choice.found(progress)
    if cycle <= 0.0 and choice.parts and choice.movements.context.options.objective == "time":
        found = _fastest(choice, found)
    standing = choice.standing(found)
    steps = choice.steps(found)
    if cycle <= 0.0 or not choice.parts:
        resting = ChainAnswer(choice, steps, standing, free_gap(choice, found, steps))
        return _without_rests(resting, found)
    timed = timed_with_blends(choice, cycle, standing, progress)
    own = sum(step.is_pause for step in steps)
    resting_steps = replace(timed, joined=()).energies
    pauses = [step for step in resting_steps if step.is_pause][:own]
    spent = sum(step.report.energy for step in resting_steps) - sum(
        pause.report.energy for pause in pauses
    )
    gap = cycle_gap(timed.choice, len(timed.timed.movements), spent, timed.bound)
    return ChainAnswer(choice, timed.steps, standing, gap)


def _without_rests(answer: ChainAnswer, found: Found) -> ChainAnswer:
    """The program with the movements joined where that costs less."""
    choice = answer.choice
    blending = Blending(choice)
    context = choice.movements.context
    if not blending.places or context.work.exhausted:
        return answer
    with context.journal.stage(STAGE) as notes:
        joined = blending.joined(found)
        passing = replace(answer, steps=choice.steps(found, joined=joined)) if joined else answer
        if passing.cost >= answer.cost:
            notes.append(NOTHING_CHEAPER)
            return answer
        notes.append(blending.said(joined))
    return passing


def _fastest(choice: Choice, found: Found) -> Found:
    """The movements of a chain, or faster ones by descent for values at which joules hardly count:
    within a cycle time these are known too.
    """
    movements = choice.movements
    if not movements.descends or movements.context.work.exhausted:
        return found
    values = TimeValues(choice.ladder, choice.parts)
    values.bracket(0.0, FASTEST - 1)
    return values.fastest


def _again(
    request: ProgramRequest, route: Route, context: Context, progress: Progress, improvement: int
) -> ChainAnswer | None:
    """The program along a chain chosen with more effort; None where that isn't done with half of
    what is left.
    """
    work = context.work
    with _limited(work, int(_HALF * work.left), improvement):
        try:
            answer = planned(chosen(request, route, context, progress), progress)
        except (StageError, RequestError):
            return None
        return None if work.exhausted else answer


def _with_better_movements(best: ChainAnswer, progress: Progress) -> ChainAnswer:
    """The program with its regional movements planned again, with more work at every turn."""
    movements = best.choice.movements
    work = best.choice.movements.context.work
    across = [part for part in best.choice.parts if part.kind == ACROSS]
    for more in _MORE:
        if (
            not across
            or more > work.improvement
            or more * len(across) > work.left
            or work.exhausted
        ):
            break
        with movements.context.journal.stage("improve"):
            movements.better(across, more)
        again = planned(best.choice, progress)
        best = again if again.cost < best.cost else best
    return best


@contextmanager
def _limited(work: Work, most: int, improvement: int) -> Iterator[None]:
    """With at most so much more work, of which `improvement` goes into better answers."""
    whole = work.max_iterations, work.improvement
    work.max_iterations = work.iterations + most
    work.improvement = improvement
    try:
        yield
    finally:
        work.max_iterations, work.improvement = whole
