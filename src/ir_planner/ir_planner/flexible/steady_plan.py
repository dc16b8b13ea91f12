"""The cheapest steady cycle of a route: order, speeds, waits and power modes, as a program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ir_description import Cell
from ir_msgs_py.modes import DEEPER
from ir_msgs_py.report import PlanningInfo
from ir_msgs_py.status import Status, StatusCode
from ir_planner.cycle import (
    Curve,
    SteadyCycle,
    SteadyProblem,
    WaitMode,
    cheapest_cycle,
    fastest_cycle,
    in_turn,
    shared_among,
)
from ir_planner.errors import RequestError
from ir_planner.flexible.columns import Column, Key, Tending, planned_columns
from ir_planner.flexible.cycle_steps import CycleSaving, CycleSteps
from ir_planner.flexible.tending_cell import held_from, machines_of, route_of
from ir_planner.presentation import plot_cycle, plot_throughputs
from ir_planner.program import (
    ACROSS,
    ENTER,
    LEAVE,
    MOTORS,
    ProgramPlan,
    ProgramRequest,
    Rests,
    Scenes,
    Spreads,
    StageError,
    at_once,
    program_of,
    rests_at,
)
from ir_planner.request import Context, Journal, Work, bounded
from ir_planner.timing import Movement

HOUR = 3600.0
FRONT_MAX = 50
_LONGEST_WAIT = 86_400.0  # s: no wait of a cycle is longer
_ROUNDING = 1e-6  # s: of the linear program
_SLACK = 1.0005  # of the shortest period: the first point of the front
_SAME = 1e-9  # s


@dataclass(frozen=True)
class CyclePoint:
    """A certified cycle: parts an hour, its period [s], joules a part, and by how much [%] of them
    a cheaper one may exist.
    """

    parts_per_hour: float
    period: float
    joules: float
    gap: float


@dataclass(frozen=True, eq=False)
class SteadyPlan:
    """cycle: the schedule; gap [%]: how far above the cheapest one it can be, for the
    configurations that were chosen and movements that begin with an empty capacitor. program: its
    movements and pauses, in `cell`. fastest [s]: the shortest period.
    """

    status: Status
    info: PlanningInfo
    parts_per_hour: float = 0.0
    machines: tuple[str, ...] = ()
    process: tuple[float, ...] = ()
    request: ProgramRequest | None = None
    cycle: SteadyCycle | None = None
    gap: float = 0.0
    fastest: float = 0.0
    cell: Cell | None = None
    program: ProgramPlan | None = None
    saving: CycleSaving | None = None
    front: tuple[CyclePoint, ...] = field(default=())

    def __repr__(self) -> str:
        if self.cycle is None or self.program is None:
            return f"SteadyPlan({self.status.message})"
        return (
            f"SteadyPlan({HOUR / self.cycle.period:.1f} parts an hour, "
            f"{self.cycle.period:.2f} s, {self.program.report.energy:.0f} J a part, "
            f"gap {self.gap:.2f} %)"
        )

    def plot(self) -> Any:
        """Robot, machines and power over a cycle; a matplotlib figure."""
        if self.cycle is None or self.program is None:
            return plot_cycle((), {}, (), repr(self))
        return plot_cycle(robot_bars(self), machine_bars(self), self.program.movements, repr(self))

    def plot_front(self) -> Any:
        """Joules a part over parts an hour; a matplotlib figure."""
        points = [(point.parts_per_hour, point.joules) for point in self.front]
        return plot_throughputs(points, repr(self))


def robot_bars(plan: SteadyPlan) -> tuple[tuple[str, float, float, str], ...]:
    """What the robot does: name, begin, length [s], and kind: transport, hop or a power mode."""
    assert plan.cycle is not None
    bars = []
    following = (*plan.cycle.visits[1:], plan.cycle.visits[0])
    for visit, after in zip(plan.cycle.visits, following, strict=True):
        names = plan.machines[visit.activity], plan.machines[visit.activity + 1]
        here = visit.start
        entries = [(f"{names[0]} to {names[1]}", visit.seconds, "transport")]
        entries += [(wait.mode, wait.seconds, wait.mode) for wait in visit.after]
        entries.append((f"to {plan.machines[after.activity]}", visit.hop, "hop"))
        entries += [(wait.mode, wait.seconds, wait.mode) for wait in after.before]
        for name, seconds, kind in entries:
            if seconds > _SAME:
                bars.append((name, here, seconds, kind))
            here += seconds
    return tuple(bars)


def machine_bars(plan: SteadyPlan) -> dict[str, tuple[tuple[float, float], ...]]:
    """When each machine works in the cycle: begin and length [s]; over its end it goes on at its
    begin.
    """
    assert plan.cycle is not None
    period = plan.cycle.period
    bars: dict[str, tuple[tuple[float, float], ...]] = {}
    for visit in sorted(plan.cycle.visits, key=lambda each: each.activity):
        place = visit.activity + 1
        if place > len(plan.process):
            continue
        seconds = plan.process[place - 1]
        begin = (visit.start + visit.seconds) % period
        before = min(seconds, period - begin)
        rest = ((0.0, seconds - before),) if seconds > before else ()
        bars[plan.machines[place]] = ((begin, before), *rest)
    return bars


def plan_steady_cycle(
    request: ProgramRequest,
    parts_per_hour: float,
    work: Work,
    *,
    front_points: int = 0,
    saving: bool = False,
) -> SteadyPlan:
    """The cheapest cycle of the route of the request's cell that makes at least so many parts an
    hour; 0: as many as possible. Raises RequestError for a request that makes no sense,
    CancelledError when stopped.
    """
    bounded(parts_per_hour, 0.0, HOUR, "parts_per_hour")
    bounded(front_points, 0, FRONT_MAX, "front_points")
    route = route_of(request.cell)
    request.check()
    journal = Journal(work, request.options.seed)
    journal.planner_id = "steady cycle"
    scenes = Scenes(request.cell, request.power, request.settings.drives(request.cell.robot))
    context = Context(scenes.of(request.cell.parts_at_start()), request.options, journal)
    try:
        tending = planned_columns(request, route, context)
    except StageError as failed:
        info = journal.info(request.start, context.joint_names)
        return SteadyPlan(failed.status, info)
    model = _TendingModel(request, tending)
    with journal.stage("steady cycle") as notes:
        fastest = fastest_cycle(model.problem)
        assert fastest is not None  # without a bound there is one
        period = HOUR / parts_per_hour if parts_per_hour > 0.0 else fastest.period * _SLACK
        if period < fastest.period - _ROUNDING:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"parts_per_hour is {parts_per_hour:g}, a cycle of {period:.2f} s: at most "
                f"{HOUR / fastest.period:.2f} are possible, a cycle of {fastest.period:.2f} s",
            )
        chosen = model.cheapest(max(period, fastest.period * _SLACK))
        notes.append(f"{chosen.cycle.period:.2f} s, {chosen.cycle.joules:.0f} J")
    try:
        made = CycleSteps(request, tending, chosen.cycle, chosen.movements, context)
    except StageError as failed:
        return SteadyPlan(failed.status, journal.info(request.start, context.joint_names))
    plan = SteadyPlan(
        status=Status.success(),
        info=journal.info(request.start, context.joint_names),
        parts_per_hour=parts_per_hour,
        machines=machines_of(request.cell),
        process=model.problem.process,
        cycle=chosen.cycle,
        request=made.request,
        gap=chosen.gap,
        fastest=fastest.period,
        cell=made.cell,
        program=program_of(made.steps),
    )
    if saving:
        with journal.stage("saving"):
            plan = replace(plan, saving=made.saving(Spreads(made.request)))
    if front_points:
        with journal.stage("front"):
            plan = replace(plan, front=_front(model, fastest.period, front_points))
    return replace(plan, info=journal.info(request.start, context.joint_names))


@dataclass(frozen=True, eq=False)
class _Chosen:
    """A cycle of certified movements, and what no cycle can be below."""

    cycle: SteadyCycle
    movements: Mapping[Key, Movement]
    bound: float

    @property
    def gap(self) -> float:
        return 100.0 * max(self.cycle.joules - self.bound, 0.0) / self.cycle.joules


class _TendingModel:
    """The linear problem of a route, and its solutions as certified movements."""

    def __init__(self, request: ProgramRequest, tending: Tending) -> None:
        self.tending = tending
        visits = tending.route.visits
        self.visits = visits
        cell = request.cell
        times = request.settings.transitions
        scene = tending.empty
        self._handling = [self._handled(request, place) for place in range(len(visits))]
        modes = {
            name: wait_modes(rests_at(node.departure, scene, times))
            for name, node in tending.nodes.items()
        }
        self.problem = SteadyProblem(
            activities=tuple(self._activity(a) for a in range(len(visits) - 1)),
            hops={arc: tending.columns[key].curve for arc, key in self._hops().items()},
            after=tuple(modes[name] for name in visits[1:]),
            before=tuple(modes[name] for name in visits[:-1]),
            process=tuple(cell.machine(name).process for name in machines_of(cell)[1:-1]),
        )

    def _handled(self, request: ProgramRequest, place: int) -> tuple[float, float]:
        """Joules of the gripper's time at a station: after a part was taken, and was left."""
        route = self.tending.route
        q = self.tending.nodes[route.visits[place]].interaction
        times = request.settings.transitions
        held = self.tending.scenes.of(held_from(route, min(place, len(route.visits) - 2)))
        return (
            rests_at(q, held, times).motors * route.handling,
            rests_at(q, self.tending.empty, times).motors * route.handling,
        )

    def _keys(self, activity: int) -> list[Key]:
        """The movements of an activity in order."""
        start = self.visits[activity]
        end = self.visits[activity + 1]
        return [
            (ENTER, start, start, False),
            (LEAVE, start, start, True),
            (ACROSS, start, end, True),
            (ENTER, end, end, True),
            (LEAVE, end, end, False),
        ]

    def _activity(self, activity: int) -> Curve:
        curves = [self.tending.columns[key].curve for key in self._keys(activity)]
        return self._with_handling(in_turn(curves), activity)

    def _with_handling(self, curve: Curve, activity: int) -> Curve:
        joules = self._handling[activity][0] + self._handling[activity + 1][1]
        return curve.shifted(2.0 * self.tending.route.handling, joules)

    def _hops(self) -> dict[tuple[int, int], Key]:
        count = len(self.visits) - 1
        return {
            (a, b): (ACROSS, self.visits[a + 1], self.visits[b], False)
            for a in range(count)
            for b in range(count)
            if b not in (a, a + 1)
        }

    def cheapest(self, period: float) -> _Chosen:
        """The cheapest cycle within a period [s], of movements that are certified at the durations
        that the linear problem chose, and its waits once more for these.
        """
        cycle = cheapest_cycle(self.problem, period=period)
        assert cycle is not None  # the period isn't below the shortest
        movements = self._realised(cycle)
        again = cheapest_cycle(self._fixed(movements), period=period + _ROUNDING)
        assert again is not None  # no movement takes longer than was chosen
        return _Chosen(again, movements, cycle.bound)

    def _realised(self, cycle: SteadyCycle) -> dict[Key, Movement]:
        columns = self.tending.columns
        hops = self._hops()
        movements = {key: columns[key].movements[0] for key in hops.values()}
        following = (*cycle.visits[1:], cycle.visits[0])
        for visit, after in zip(cycle.visits, following, strict=True):
            keys = self._keys(visit.activity)
            own = [columns[key] for key in keys]
            moving = visit.seconds - 2.0 * self.tending.route.handling
            lengths = shared_among([column.curve for column in own], moving)
            for key, column, seconds in zip(keys, own, lengths, strict=True):
                movements[key] = column.taking(seconds)
            arc = visit.activity, after.activity
            if arc in hops:
                movements[hops[arc]] = columns[hops[arc]].taking(visit.hop)
        return movements

    def _fixed(self, movements: Mapping[Key, Movement]) -> SteadyProblem:
        """The problem with these movements alone."""
        activities = tuple(
            self._with_handling(
                in_turn([Column.of([movements[key]]).curve for key in self._keys(a)]), a
            )
            for a in range(len(self.visits) - 1)
        )
        hops = {arc: Column.of([movements[key]]).curve for arc, key in self._hops().items()}
        return replace(self.problem, activities=activities, hops=hops)


def wait_modes(rests: Rests) -> tuple[WaitMode, ...]:
    """The sequences of modes that a wait of known length can be spent in, each ready at its end."""
    modes = [WaitMode(MOTORS, 0.0, rests.timer, 0.0, rests.motors)]
    for sequence in rests.sequences:
        last = at_once(sequence)[-1]
        shortest = last.free + last.rest.leave
        joules = rests.in_time(sequence, shortest) - last.rest.watts * shortest
        name = DEEPER.join(rest.name for rest in sequence)
        modes.append(WaitMode(name, shortest, _LONGEST_WAIT, joules, last.rest.watts))
    return tuple(modes)


def _front(model: _TendingModel, fastest: float, count: int) -> tuple[CyclePoint, ...]:
    """Cycles from the fastest on to the cheapest of all, by even steps of their period; at a
    lower throughput what is cheaper at a higher one is kept.
    """
    free = model.cheapest(model.problem.longest)
    begin = fastest * _SLACK
    end = max(free.cycle.period, begin)
    points: list[CyclePoint] = []
    for period in np.linspace(begin, end, count):
        chosen = model.cheapest(float(period))
        best = chosen.cycle
        point = CyclePoint(HOUR / best.period, best.period, best.joules, chosen.gap)
        if points and points[-1].joules <= point.joules:
            continue
        points.append(point)
    return tuple(points)
