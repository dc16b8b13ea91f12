"""Companions of a request: further runs that ask for something else, compared with its own run.

A descent ends in a local minimum, and in which depends on what it is asked for. Movements of least
W have few turns; those of a high price of time come from smoother descents; some of both are faster
than what the descent for time ends in. So companions run beside a request, and its answer is the
cheapest movement of all runs: no other request would have found a better one. The default portfolio
compares the baseline movement too.

| objective | companions of a free duration |
| --- | --- |
| time | fewest turns near its own paths (W); in a hurry (a high price of time); other prices |
| movement_cost | the answer for J |
| energy | none; faster and slower movements near its own answer |
| time_and_energy | none |

A requested duration is met in three attempts, the later ones only where the earlier ones may have
missed a cheaper movement:

1. the request's own descents;
2. the answer for J near their paths, stretched to the duration;
3. the fastest answer, with all companions of `time`, stretched to the duration.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ir_planner.checks import FreeSpace, ToolUse
from ir_planner.errors import RequestError, TimingError
from ir_planner.optimize import QUICK_TIMING, Portfolio, Refinement, path_of, rescaled
from ir_planner.optimize import optimised_near as near
from ir_planner.regional.exploration import Path, Searches, improve
from ir_planner.request import DURATION_MAX, Context
from ir_planner.scene import STILL
from ir_planner.search import Ends, straight_along
from ir_planner.timing import (
    DURATION_SLACK,
    Movement,
    baseline,
    baseline_costs_at_least,
    straight_steps,
)
from ir_values.arrays import FloatArray

Answer = tuple[str, Movement]  # the search that found it
# Coarse solutions that are refined for another objective; the best of them thoroughly.
_OPTIMISED_AGAIN = 2
# Factors on the duration of least joules that are tried, in so many steps.
_OTHER_DURATIONS = (0.75, 1.33)
_DURATION_STEPS = 4
_COARSELY = 0.99  # of a bound by a few durations: the best of all is little below it
_HURRY = 100.0  # times the robot's own value of a second
_HURRIES = (1000.0, 300.0, 10.0)  # of further descents near the own paths
_NEAR = 1.03  # times the duration of the fastest: a descent gains less
_AT_A_BOUND = 0.999  # of a bound of the tool's speed or acceleration: the movement was slowed to it
_WORTH_PROVING = 1.01  # times the cost of the best: coarse costs are off by less
DIRECT = "direct"  # the search that finds straight segments


@dataclass(frozen=True, eq=False)
class Exploration:
    """What the improvement of a request starts from."""

    ends: Ends
    paths: list[Path]
    space: FreeSpace
    searches: Searches


# Companions: further runs beside a request. Each gets the portfolio of the request's own run, and
# gives the best movement by its own question.

Companion = Callable[[Portfolio, Exploration, Context], Answer | None]


def _fewest_turns(own: Portfolio, exploration: Exploration, context: Context) -> Answer | None:
    """The movement of least W near the paths of the request's own run."""
    return _optimised_again(own, context.asking("movement_cost"))


def _in_a_hurry(own: Portfolio, exploration: Exploration, context: Context) -> Answer | None:
    """The fastest movement near the best one for a high price of time: joules smooth the descent,
    and lead to other local minima than time alone. None where that is far from the own best one.
    """
    context = context.asking("time")
    best = own.best()
    hasty = _explored(exploration, context.valuing_time(_HURRY)).best()
    hurried = _as_asked(hasty, context)[0]
    if hurried is None or (best is not None and hurried[1].cost > _NEAR * best[1].cost):
        return None
    method, movement = hurried
    fastest = near(movement, context)
    return _cheaper(hurried, None if fastest is None else (method, fastest))


def _in_other_hurries(own: Portfolio, exploration: Exploration, context: Context) -> Answer | None:
    """The fastest of the movements of other prices of time near the paths of the request's own
    run.
    """
    context = context.asking("time")
    best: Answer | None = None
    for times in _HURRIES:
        if context.work.exhausted:
            break
        hurried = _optimised_again(own, context.valuing_time(times))
        best = _cheaper(best, _as_asked(hurried, context)[0])
    return best


def _for_both(own: Portfolio, exploration: Exploration, context: Context) -> Answer | None:
    """The answer for J."""
    return _explored(exploration, context.asking("time_and_energy")).best()


COMPANIONS: Mapping[str, tuple[Companion, ...]] = {
    "time": (_fewest_turns, _in_a_hurry, _in_other_hurries),
    "movement_cost": (_for_both,),
    "energy": (),
    "time_and_energy": (),
}


class _Comparison:
    """The cheapest answer to a request so far, and the shortest own duration [s] of any movement
    that was compared.
    """

    def __init__(self, context: Context, own: Portfolio) -> None:
        self._context = context
        self.best = own.best()
        self.shortest = own.refinement.shortest

    def consider(self, found: Answer | None) -> None:
        """Compare a movement of another question, as an answer to this request."""
        answer, duration = _as_asked(found, self._context)
        self.best = _cheaper(self.best, answer)
        self.shortest = min(self.shortest, duration)

    def consider_companions(self, objective: str, own: Portfolio, exploration: Exploration) -> None:
        """Compare the companions of a run for an objective."""
        for companion in COMPANIONS[objective]:
            self.consider(companion(own, exploration, self._context))


def best_found(exploration: Exploration, context: Context) -> tuple[Answer | None, float]:
    """The best answer by the searches and descents of the request and of its companions, and the
    shortest duration [s] met where none is as short as requested.
    """
    portfolio = _explored(exploration, context)
    options = context.options
    if options.planner_id:
        return portfolio.best(), portfolio.refinement.shortest
    if options.duration > 0.0:
        return _of_duration(portfolio, exploration, context)
    compared = _Comparison(context, portfolio)
    compared.consider_companions(options.objective, portfolio, exploration)
    best = compared.best
    if options.objective == "energy" and best is not None:
        best = best[0], _least_over_durations(best[1], context)
    return best, compared.shortest


def _of_duration(
    own: Portfolio, exploration: Exploration, context: Context
) -> tuple[Answer | None, float]:
    """The cheapest of the requested duration: by its own descents where they meet it, else a
    movement of free duration, else the fastest there is, stretched.
    """
    work = context.work
    best = own.best()
    if best is not None:
        method, path = exploration.paths[0]
        if not (work.exhausted or np.array_equal(best[1].path, path)):
            own.refine_anew(method, path)
        shortest = own.refinement.shortest
        if not np.isfinite(shortest):  # there is time for least energy
            if not work.exhausted:
                own.refine_exactly()
            return own.best(), shortest

    compared = _Comparison(context, own)
    free = _optimised_again(own, context.asking("time_and_energy"))
    compared.consider(free)
    if free is not None and free[1].trajectory.duration <= context.options.duration:
        return compared.best, compared.shortest

    hasty = _explored(exploration, context.asking("time"))  # there is no time for least cost
    compared.consider(hasty.best())
    compared.consider_companions("time", hasty, exploration)
    return compared.best, compared.shortest


def _least_over_durations(best: Movement, context: Context) -> Movement:
    """The movement, or a faster or slower one near its path that takes less: joules depend so
    little on a long duration that a descent ends far from the best one.
    """
    with context.journal.stage("other durations") as notes:
        begin = best
        steps = 0
        for factor in _OTHER_DURATIONS:
            while best is begin or steps < _DURATION_STEPS:
                duration = factor * best.trajectory.duration
                candidate = (
                    None
                    if duration > DURATION_MAX
                    else near(best, context.asking("energy", duration))
                )
                steps += 1
                if candidate is None or candidate.cost >= best.cost:
                    break
                best = replace(candidate, context=context)
            if best is not begin:
                break
        notes.append(f"{begin.trajectory.duration:.3f} s became {best.trajectory.duration:.3f} s")
    return best


def not_worse_than_baseline(
    best: Answer | None, paths: list[Path], context: Context
) -> Answer | None:
    """The best answer, or a movement along a free straight segment that costs less: to the goal of
    the best answer, or to the first goal that has one. None where there is neither.
    """
    straight = [path for _, path in paths if len(path) == 2]
    if best is not None:
        reached = best[1].path[-1]
        straight = [path for path in straight if np.array_equal(path[-1], reached)] or straight
    for path in straight[:1]:
        with context.journal.stage("baseline") as notes:
            if best is not None and _is_excluded(path, best[1], context):
                notes.append("costs more even where torque is no limit")
                continue
            better = [
                movement
                for movement in _segment_movements(path, context, hurried=best is None)
                if (best is None or movement.coarse_cost < _WORTH_PROVING * best[1].cost)
                and movement.prove().certified
                and (best is None or movement.cost < best[1].cost)
            ]
            notes.append("costs less" if better else "costs more, or can't be done")
            if better:
                return DIRECT, min(better, key=lambda movement: movement.cost)
    return best


def _is_excluded(segment: FloatArray, best: Movement, context: Context) -> bool:
    """Whether a bound says that the baseline along a segment (2, n) costs more than the best
    movement.
    """
    start, goal = segment
    if context.options.objective == "time" or np.abs(goal - start).max() < STILL:
        return False
    return best.cost < _COARSELY * baseline_costs_at_least(start, goal, context)


def _segment_movements(
    segment: FloatArray, context: Context, *, hurried: bool
) -> Iterator[Movement]:
    """The baseline along a segment (2, n), and where time is short also the fastest law that there
    is.
    """
    common = baseline(segment[0], segment[1], context)
    if common is not None:
        yield common
    if hurried or context.options.objective == "time":
        try:
            yield straight_steps(segment, context)
        except (TimingError, RequestError) as error:
            context.journal.reject(f"straight segment: {error}")


def _explored(exploration: Exploration, context: Context) -> Portfolio:
    """The paths that the searches find, and the movements that come of them."""
    portfolio = Portfolio(exploration.space, Refinement(context))
    improve(exploration.ends, exploration.paths, portfolio, context, exploration.searches)
    return portfolio


def _optimised_again(portfolio: Portfolio, context: Context) -> Answer | None:
    """The best movement near the same paths for another objective."""
    again = Portfolio(portfolio.space, Refinement(context))
    with context.journal.stage(f"for {context.options.objective}"):
        for candidate in portfolio.candidates:
            again.add(candidate.method, [candidate.path])
        again.refine_best(_OPTIMISED_AGAIN)
        again.deepen()
    return again.best()


def _as_asked(found: Answer | None, context: Context) -> tuple[Answer | None, float]:
    """A movement of another objective as an answer to this request, stretched where a duration is
    requested; None where it isn't certified or takes longer. And its own duration [s].
    """
    if found is None:
        return None, np.inf
    method, movement_found = found
    duration = movement_found.trajectory.duration
    requested = context.options.duration
    movement = movement_found.asked_by(context)
    if requested > 0.0:
        if duration > requested * (1.0 + DURATION_SLACK):
            return None, duration
        movement = movement.stretched_by(max(requested / duration, 1.0))
    return ((method, movement) if movement.prove().certified else None), duration


def _cheaper(best: Answer | None, other: Answer | None) -> Answer | None:
    if best is None or other is None:
        return best or other
    return other if other[1].cost < best[1].cost else best


def slowed_where_fast(answer: Answer, context: Context) -> Answer:
    """An answer that is slow for its tool all along, or the movement along its path that is so only
    where the tool would be too fast, if that costs less.
    """
    method, movement = answer
    bounds = context.tool_bounds
    if not bounds.asked or context.options.objective == "movement_cost":
        return answer
    if ToolUse(movement.trajectory, context.scene, bounds).longer.max() < _AT_A_BOUND:
        return answer
    with context.journal.stage("tool speed") as notes:
        along = rescaled(movement, context, QUICK_TIMING)
        if along is None or along.cost >= movement.cost:
            notes.append("slower all along")
            return answer
        notes.append("slower where the tool would be too fast")
        return method, along


def over_free_steps(movement: Movement, space: FreeSpace) -> Movement:
    """The same trajectory with free straight steps along it as waypoints; as it is where its own
    are free, or where no work is left.
    """
    if space.edges_free(movement.path[:-1], movement.path[1:]).all():
        return movement
    along = straight_along(path_of(movement.trajectory, space.scene), space, space.scene.weights)
    return movement if along is None else movement.passing(along)


LATE = "timing is synchronous: no time was left for own laws of the joints"
SYNCHRONOUS = "timing is synchronous: own laws for the joints serve no better"


def with_own_laws(synchronous: Movement, context: Context) -> Movement:
    """The better of the synchronous answer and of the same free path in straight steps, each joint
    with its own law; it notes when it is the synchronous one. The synchronous one too where
    planning_time is over.
    """
    with context.journal.stage("asynchronous") as notes:
        if _is_too_late(context):
            notes.append(LATE)
            return synchronous
        asynchronous = _own(synchronous, context)
        if asynchronous is None or not (
            _is_asked_by_name(context) or asynchronous.cost <= synchronous.cost
        ):
            notes.append(SYNCHRONOUS)
            return synchronous
        notes.append(asynchronous.note or "each joint has its own law")
        context.journal.timing = asynchronous.timing
        return asynchronous


def _is_too_late(context: Context) -> bool:
    """Whether planning_time is over, with an answer at hand."""
    return not _is_asked_by_name(context) and context.work.exhausted and context.work.truncated


def _is_asked_by_name(context: Context) -> bool:
    """Whether asynchronous joints are asked for at any cost: a PTP by name, unless the fastest."""
    return context.options.planner_id == DIRECT and context.options.objective != "time"


def _own(synchronous: Movement, context: Context) -> Movement | None:
    """The movement over the free path that the synchronous one came from; None where no joint has a
    law of its own, or it isn't certified.
    """
    try:
        space = FreeSpace.of(
            context.scene, context.safety_distance, context.work, cone=context.cone
        )
        movement = straight_steps(over_free_steps(synchronous, space).path, context)
    except (TimingError, RequestError) as error:
        context.journal.reject(f"own laws: {error}")
        return None
    if movement.timing == "synchronous":
        return None
    return movement if movement.prove().certified else None
