"""Movements of a program: out of one stop, across, into the next; each is planned once."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol, TypeVar

from ir_description.cell import StepVia
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.search_log import SearchLog
from ir_msgs_py.status import Status, StatusCode
from ir_planner import optimize
from ir_planner.checks import Consumption, tilt_violation
from ir_planner.errors import RequestError, TimingError
from ir_planner.program.cost_bounds import Rates
from ir_planner.program.station_graph import ACROSS, ENTER, LEAVE, HopPart
from ir_planner.program.steps import Route
from ir_planner.program.stop_nodes import StopNode
from ir_planner.regional import Searches, search_regional
from ir_planner.request import Context, Goal, Journal, Work, parse_goal
from ir_planner.service import timed_service
from ir_planner.timing import Movement, best_stretch, stretched
from ir_planner.trajectories import Via, ViaSearch
from ir_values.arrays import FloatArray

# Movements that are known, made again for another value of a second: near the path of one, from
# its own time scaling.


def optimised_near(known: Sequence[Movement], context: Context) -> Movement | None:
    """The cheapest certified movement by descent from known ones, at least one, or the cheapest of
    them slowed down; None where neither is certified.
    """
    candidates = (optimize.optimised_near_best(known, context), slowed_near(known, context))
    certified = [
        movement for movement in candidates if movement is not None and movement.prove().certified
    ]
    return min(certified, key=lambda movement: movement.cost, default=None)


def slowed_near(known: Sequence[Movement], context: Context) -> Movement | None:
    """The cheapest of known movements between the same ends, each slowed down evenly as far as that
    pays; None where none is certified.
    """
    slower = [_slowed_for(one, best_stretch(one.trajectory, context), context) for one in known]
    cheapest = sorted(slower, key=lambda movement: movement.coarse_cost)
    return next((movement for movement in cheapest if movement.prove().certified), None)


def _slowed_for(one: Movement, factor: float, context: Context) -> Movement:
    """A movement slowed down for another request; what is known of it as it is stays known."""
    if factor == 1.0:
        return one.asked_by(context)
    return Movement(one.path, stretched(one.trajectory, factor), context, one.note)


# Work of one request done by several threads: every item has work of its own, so that answers
# don't depend on how many there are or which one is first.

Item = TypeVar("Item")
Result = TypeVar("Result")


def mapped(
    task: Callable[[Item, Context], Result],
    items: Sequence[Item],
    context: Context,
    improvement: int,
    most: Sequence[int],
) -> list[Result]:
    """task(item, context of its own) for every item, in order; what each did is added to
    `context`'s journal.

    improvement: work of each for better answers; most: of each at all. Raises what the first
    failing task raises, CancelledError when asked to stop.
    """
    contexts = [_own(context, improvement, edges) for edges in most]
    count = min(context.work.threads or len(os.sched_getaffinity(0)), len(items))
    if count <= 1:
        results = [task(item, mine) for item, mine in zip(items, contexts, strict=True)]
    else:
        with ThreadPoolExecutor(count) as pool:
            results = list(pool.map(task, items, contexts))
    for mine in contexts:
        context.work.iterations += mine.work.iterations
        context.work.truncated |= mine.work.truncated
        context.journal.rejected.update(mine.journal.rejected)
    context.work.check()
    return results


def _own(context: Context, improvement: int, left: int) -> Context:
    """The context with so much work and a journal of its own."""
    work = context.work
    mine = Work(left, work.deadline, work.clock, work.cancelled, improvement, work.threads)
    return Context(
        context.scene, context.options, Journal(mine, context.journal.seed), context.station
    )


# The movements of a program: out of one stop, across, into the next. Each is planned once, however
# often the program makes it.

_PARTS = 3  # of a hop: out, across, in
Key = tuple[int, str, tuple[str, str], tuple[bytes, bytes]]  # scene, kind, names of the stops, ends


def rates_of(context: Context) -> Rates:
    """The objective of a request as cost per joule of the drives and per second."""
    options = context.options
    if options.objective == "time":
        return Rates(0.0, 1.0)
    return Rates(1.0, 0.0 if options.objective == "energy" else options.time_value)


def cost_of(report: TrajectoryReport | Consumption, rates: Rates) -> float:
    """What a movement costs."""
    return rates.joule * (report.energy - report.base_energy) + rates.second * report.duration


@dataclass(frozen=True, eq=False)
class Failure:
    """A movement that isn't found, and why."""

    status: Status


class MovementSource(Protocol):
    """Movements that were found before."""

    def movement(self, part: HopPart) -> Movement | None:
        """The movement of a part that was planned; None where none was found."""


class WarmStarts(NamedTuple):
    """Known movements from which others are made, instead of searched: across, by descent from the
    best of those of `across`; along service lines, those of `lines` slowed down, or by descent from
    those of `scaling`. Those of them that can plan do so first.
    """

    across: tuple[MovementSource, ...] = ()
    lines: tuple["Movements", ...] = ()
    scaling: "Movements | None" = None


class Movements:
    """Movements between the configurations in `layers` of a route, by the objective of `context`;
    `near` those that are known, where that is given.
    """

    def __init__(
        self,
        route: Route,
        layers: list[list[StopNode]],
        context: Context,
        searches: Searches,
        near: WarmStarts | None = None,
    ) -> None:
        self.route = route
        self.layers = layers
        self.context = context
        self.searches = searches
        # whether movements may be made from known ones by descent
        self.descends = context.options.planner_id == "" and context.options.timing == "synchronous"
        self._near = near if near is not None and self.descends else WarmStarts()
        self._found: dict[Key, Movement | Failure] = {}
        self._logs: dict[Key, list[SearchLog]] = {}
        self.unreachable = Status(
            StatusCode.PLANNING_FAILED, "no chain of configurations connects the stations"
        )

    @property
    def planned(self) -> int:
        """How many movements were planned."""
        return len(self._found)

    def plan(self, parts: Sequence[HopPart], improvement: int) -> list[Movement | Failure]:
        """The movements of parts of hops; those that aren't known yet side by side."""
        new = {key: part for part in parts if (key := self._key(part)) not in self._found}
        near = self._near
        lines = [part for part in new.values() if part.kind != ACROSS]
        for earlier in (*near.lines, *([near.scaling] if near.scaling else [])):
            earlier.plan(lines, improvement)
        for earlier in (each for each in near.across if isinstance(each, Movements)):
            earlier.plan([part for part in new.values() if part.kind == ACROSS], improvement)
        planned = self._shared(list(new.values()), improvement)
        for key, planned_part in zip(new, planned, strict=True):
            self._found[key] = planned_part
            if isinstance(planned_part, Failure):
                self.unreachable = planned_part.status
        return [self._found[self._key(part)] for part in parts]

    def _shared(self, parts: list[HopPart], improvement: int) -> list[Movement | Failure]:
        """Movements of parts that share the work left: all the same, but those along service lines,
        which are known without any, no more than if the whole program was still to plan. What isn't
        found with its share gets the work that the others left: at least half of their shares,
        which isn't for improvement.
        """
        left = self.context.work.left
        of_one = left // max(len(parts), 1)
        of_line = left // (_PARTS * max(len(self.route), 1))
        most = [of_one if part.kind == ACROSS else min(of_one, of_line) for part in parts]
        improving = min(improvement, of_one // 2)
        planned = mapped(self._movement_of, parts, self.context, improving, most)
        failed = [k for k, answer in enumerate(planned) if isinstance(answer, Failure)]
        for later, k in enumerate(failed, start=1 - len(failed)):
            if most[k] < (left := self.context.work.left):
                improving = min(improvement, left // (2 - 2 * later))
                again = mapped(self._movement_of, [parts[k]], self.context, improving, [left])
                planned[k] = again[0]
        return planned

    def movement(self, part: HopPart) -> Movement | None:
        """The movement of a part that was planned; None where none was found."""
        answer = self._found[self._key(part)]
        return answer if isinstance(answer, Movement) else None

    def logs(self, part: HopPart) -> list[SearchLog]:
        """What the search for the movement of a part did, where it keeps a log."""
        return self._logs.get(self._key(part), [])

    def better(self, parts: Sequence[HopPart], improvement: int) -> None:
        """Plan parts again with more work, and keep what is cheaper."""
        rates = rates_of(self.context)
        known = {key: self._found.pop(key) for key in dict.fromkeys(map(self._key, parts))}
        self.plan(parts, improvement)
        for key, before in known.items():
            again = self._found[key]
            if (
                isinstance(before, Failure)
                or isinstance(again, Failure)
                or cost_of(before.consumption, rates) <= cost_of(again.consumption, rates)
            ):
                self._found[key] = before

    def _key(self, part: HopPart) -> Key:
        """What two parts that are the same movement have in common."""
        first, second = self.nodes(part)
        names = self.route.name(part.hop - 1), self.route.name(part.hop)
        lines = first.line.points.tobytes(), second.line.points.tobytes()
        ends = (
            lines if part.kind != ACROSS else (first.departure.tobytes(), second.arrival.tobytes())
        )
        step = self.route.at(part.hop).step
        kind = part.kind if part.kind != ACROSS else f"{part.kind} {self._planner(part)} {step.via}"
        return id(self.route.arriving(part.hop)), kind, names, ends

    def _planner(self, part: HopPart) -> str:
        """The search that a regional movement is asked for by its step, else by the request."""
        return self.route.at(part.hop).step.planner or self.context.options.planner_id

    def nodes(self, part: HopPart) -> tuple[StopNode, StopNode]:
        """The configurations of a part; the same twice where it is a service movement."""
        layers = self.layers
        first = (
            layers[part.hop][part.first]
            if part.kind != ENTER
            else layers[part.hop + 1][part.second]
        )
        second = layers[part.hop + 1][part.second] if part.kind != LEAVE else first
        return first, second

    def ends(self, part: HopPart) -> tuple[FloatArray, FloatArray]:
        """Where a part starts and ends (n,)."""
        first, second = self.nodes(part)
        if part.kind == ACROSS:
            return first.departure, second.arrival
        if part.kind == LEAVE:
            return first.interaction, first.departure
        return first.arrival, first.interaction

    def asking(self, part: HopPart, context: Context) -> Context:
        """A context with what the movement of a part has to keep: its scene, and how far the tool
        may lean.
        """
        inside = context.inside(self.route.arriving(part.hop))
        return inside.leaning_by(self.route.tilt(part.hop)).upright_from(self.ends(part)[0])

    def _movement_of(self, part: HopPart, context: Context) -> Movement | Failure:
        """The movement of a part, or why there is none."""
        inside = self.asking(part, context)
        return self._across(part, inside) if part.kind == ACROSS else self._along_line(part, inside)

    def _across(self, part: HopPart, context: Context) -> Movement | Failure:
        """The movement of a hop between zones: past the places of its step, near a known one, or by
        a search; or why there is none.
        """
        near = _movements_of_part(self._near.across, part)
        timed = context.planned_by(self._planner(part))
        via = self.route.at(part.hop).step.via
        if via is not None:
            status, movement = self._past_places(part, via, timed)
            slower = slowed_near(near, context)  # a descent could miss a place
            if slower is not None and (movement is None or slower.cost < movement.cost):
                return slower
        else:
            again = optimised_near(near, context) if near else None
            if again is not None:
                return again
            status, movement = search_regional(*self.ends(part), timed, self.searches)
        self._logs[self._key(part)] = context.journal.logs
        here = self.route.name(part.hop - 1)
        there = self.route.name(part.hop)
        what = f"from {here or 'the start'} to {there}"
        return movement or Failure(Status(status.code, f"{what}: {status.message}"))

    def _past_places(
        self, part: HopPart, via: StepVia, context: Context
    ) -> tuple[Status, Movement | None]:
        """The movement past the places of a step; each leg gets the same share of the work."""
        first, second = self.ends(part)
        cell = self.route.scenes.cell
        places = tuple(parse_goal(name, cell, "via") for name in via.places)
        work = context.work
        share = work.left // (len(places) + 2)
        improvement = work.improvement // (len(places) + 2)

        def leg() -> Context:
            share_of_work = Work(
                share, work.deadline, work.clock, work.cancelled, improvement, work.threads
            )
            return replace(context, journal=Journal(share_of_work, context.journal.seed))

        asked = Via(places, via.tolerance, via.distance)
        goal = Goal(configuration=second)
        try:
            return ViaSearch(first, asked, goal, context, leg, self.searches).search()
        except RequestError as error:  # none of what was found is certified
            return error.status, None

    def _along_line(self, part: HopPart, context: Context) -> Movement | Failure:
        """The movement of a hop into or out of a zone along its service line: near a known one, or
        timed anew; or why there is none.
        """
        entry = part.kind == ENTER
        station = self.route.name(part.hop if entry else part.hop - 1)
        driven = self.nodes(part)[0].driven
        if entry and driven is not None:
            held = self.route.tilt(part.hop) is not None
            leaning = tilt_violation(driven.trajectory, context.cone) if held else None
            if leaning is not None:
                what = f"along {station}: {leaning.sentence}"
                return Failure(Status(StatusCode.PLANNING_FAILED, what))
            return driven.asked_by(context.leaning_freely())
        what = f"{'entering' if entry else 'leaving'} {station}"
        at = context.at(station)
        slower = slowed_near(_movements_of_part(self._near.lines, part), at)
        if slower is not None:
            return slower
        scaling = _movements_of_part((self._near.scaling,), part)
        try:
            movement = timed_service(
                self.nodes(part)[0].line, entry, at, scaling[0] if scaling else None
            )
        except TimingError as error:
            return Failure(Status(StatusCode.PLANNING_FAILED, f"{what}: {error}"))
        violation = movement.prove().violation
        if violation is not None:
            return Failure(Status(StatusCode.PLANNING_FAILED, f"{what}: {violation.sentence}"))
        same = slowed_near(scaling, at)
        return same if same is not None and same.cost < movement.cost else movement


def _movements_of_part(those: Sequence[MovementSource | None], part: HopPart) -> list[Movement]:
    """The movements of a part among those that were planned."""
    return [known for one in those if one is not None and (known := one.movement(part)) is not None]
