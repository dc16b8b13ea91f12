"""The cheapest steady cycle of a route: order, speeds, waits and power modes, as a program."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ir_description import Cell
from ir_description.cell import PartRoute
from ir_msgs_py.modes import DEEPER
from ir_msgs_py.report import PlanningInfo
from ir_msgs_py.status import Status, StatusCode
from ir_planner.cycle import (
    UNITS_MAX,
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
from ir_planner.flexible.columns import (
    Key,
    MovementColumn,
    TendedRoute,
    UnitKey,
    activity_keys,
    planned_columns,
)
from ir_planner.flexible.cycle_steps import CycleSaving, CycleSteps
from ir_planner.flexible.tending_cell import (
    held_from,
    machines_of,
    route_of,
    slot_name,
    without_cycle,
)
from ir_planner.presentation import plot_cycle, plot_throughputs
from ir_planner.program import (
    ACROSS,
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
CYCLES_MAX = 50
_LONGEST_WAIT = 86_400.0  # s: no wait of a cycle is longer
_ROUNDING = 1e-6  # s: of the linear program
_SLACK = 1.0005  # of the shortest period: the first point of the front
_SAME = 1e-9  # s
_CONTENTS_MAX = 2000  # ways in which machines can be full: a linear program each
_PARTS_MAX = 24  # of a cycle in which parts take the slots of all machines in turn


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
    """once: the schedule; cycle: the same, made until every slot of a machine has been used;
    gap [%]: how far above the cheapest one it can be, for the configurations that were chosen and
    movements that begin with an empty capacitor. program: its movements and pauses, in `cell`.
    problem: what the cycle was chosen from. fastest [s]: the shortest period of a part. run: the
    program that fills the line and makes the cycles that were asked for, in `run_cell`; None for
    none.
    """

    status: Status
    info: PlanningInfo
    parts_per_hour: float = 0.0
    stations: tuple[str, ...] = ()
    machines: tuple[str, ...] = ()
    process: tuple[float, ...] = ()
    problem: SteadyProblem | None = None
    request: ProgramRequest | None = None
    once: SteadyCycle | None = None
    cycle: SteadyCycle | None = None
    gap: float = 0.0
    fastest: float = 0.0
    cell: Cell | None = None
    program: ProgramPlan | None = None
    saving: CycleSaving | None = None
    run: ProgramPlan | None = None
    run_cell: Cell | None = None
    front: tuple[CyclePoint, ...] = field(default=())

    @property
    def joules(self) -> float:
        """Joules a part; of a program with what the capacitor carries from one movement to the
        next.
        """
        if self.cycle is None or self.program is None:
            return np.nan
        return self.program.report.energy / self.cycle.units

    def __repr__(self) -> str:
        if self.cycle is None:
            return f"SteadyPlan({self.status.message})"
        return (
            f"SteadyPlan({self.cycle.units * HOUR / self.cycle.period:.1f} parts an hour, "
            f"{self.cycle.period:.2f} s, {self.joules:.0f} J a part, "
            f"gap {self.gap:.2f} %)"
        )

    def plot(self) -> Any:
        """Robot, machines and power over a cycle; a matplotlib figure."""
        if self.cycle is None:
            return plot_cycle((), {}, (), repr(self))
        steps = () if self.program is None else self.program.movements
        return plot_cycle(robot_bars(self), machine_bars(self), steps, repr(self))

    def plot_front(self) -> Any:
        """Joules a part over parts an hour; a matplotlib figure."""
        points = [(point.parts_per_hour, point.joules) for point in self.front]
        return plot_throughputs(points, repr(self))


TRANSPORT = "transport"
HOP = "hop"
WAIT = "wait"


@dataclass(frozen=True)
class CycleStep:
    """A step of a cycle: a transport of a part, of which unit, an empty hop, or a wait in a power
    mode, between stations of the route. start, seconds [s].
    """

    kind: str
    from_station: str
    to_station: str
    unit: int
    start: float
    seconds: float
    power_mode: str = ""


def timed_steps(plan: SteadyPlan) -> tuple[CycleStep, ...]:
    """The steps of one cycle in order."""
    assert plan.cycle is not None
    steps: list[CycleStep] = []
    following = (*plan.cycle.visits[1:], plan.cycle.visits[0])
    for visit, after in zip(plan.cycle.visits, following, strict=True):
        here = plan.stations[visit.activity + 1]
        there = plan.stations[after.activity]
        now = visit.start
        parts = [(TRANSPORT, plan.stations[visit.activity], here, visit.seconds, "")]
        parts += [(WAIT, here, here, wait.seconds, wait.mode) for wait in visit.after]
        parts.append((HOP, here, there, visit.hop, ""))
        parts += [(WAIT, there, there, wait.seconds, wait.mode) for wait in after.before]
        for kind, start, end, seconds, mode in parts:
            if seconds > _SAME:
                steps.append(CycleStep(kind, start, end, visit.unit, now, seconds, mode))
            now += seconds
    return tuple(steps)


def robot_bars(plan: SteadyPlan) -> tuple[tuple[str, float, float, str], ...]:
    """What the robot does: name, begin, length [s], and kind: transport, hop or a power mode."""
    machine = dict(zip(plan.stations, plan.machines, strict=True))
    bars = []
    for step in timed_steps(plan):
        there = f"to {machine[step.to_station]}"
        if step.kind == TRANSPORT:
            there = f"{machine[step.from_station]} {there}"
        bars.append(
            (step.power_mode or there, step.start, step.seconds, step.power_mode or step.kind)
        )
    return tuple(bars)


def machine_bars(plan: SteadyPlan) -> dict[str, tuple[tuple[float, float], ...]]:
    """When each machine works in the cycle, on the part in each of its slots: begin and length [s];
    over its end it goes on at its begin.
    """
    assert plan.cycle is not None
    assert plan.problem is not None
    period = plan.cycle.period
    bars: dict[str, tuple[tuple[float, float], ...]] = {}
    slots: dict[str, list[tuple[float, float]]]
    for place, seconds in enumerate(plan.process, 1):
        if seconds == 0.0:
            continue
        most = plan.cycle.most[place - 1]
        slots = {slot_name(plan.machines[place], k, most): [] for k in range(most)}
        queued = plan.cycle.queued(place - 1, seconds, plan.problem.capacity[place - 1])
        loads = [visit for visit in plan.cycle.visits if visit.activity == place - 1]
        for load in loads:
            begin = (load.start + load.seconds + queued[load.unit]) % period
            slot = slot_name(plan.machines[place], plan.cycle.number(load), most)
            pieces = slots[slot]
            left = seconds
            while left > 0.0:
                pieces.append((begin, min(left, period - begin)))
                left -= pieces[-1][1]
                begin = 0.0
        bars |= {slot: tuple(pieces) for slot, pieces in slots.items()}
    return bars


def plan_steady_cycle(
    request: ProgramRequest,
    parts_per_hour: float,
    work: Work,
    *,
    front_points: int = 0,
    saving: bool = False,
    cycles: int = 0,
    units: int = 1,
) -> SteadyPlan:
    """The cheapest cycle of the route of the request's cell that makes at least so many parts an
    hour; 0: as many as possible. units: parts a cycle at most. cycles: whole ones of the run that
    fills the line from empty and goes on so; 0: no run. Raises RequestError for a request that
    makes no sense, CancelledError when stopped.
    """
    bounded(parts_per_hour, 0.0, HOUR, "parts_per_hour")
    bounded(front_points, 0, FRONT_MAX, "front_points")
    bounded(cycles, 0, CYCLES_MAX, "cycles")
    bounded(units, 1, UNITS_MAX, "units")
    request = replace(request, cell=without_cycle(request.cell))
    route_of(request.cell)
    request.check()
    journal = Journal(work, request.options.seed)
    journal.planner_id = "steady cycle"
    scenes = Scenes(request.cell, request.power, request.settings.drives(request.cell.robot))
    context = Context(scenes.of(request.cell.parts_at_start()), request.options, journal)
    try:
        ways = _Ways(request, context)
    except StageError as failed:
        info = journal.info(request.start, context.joint_names)
        return SteadyPlan(failed.status, info)
    with journal.stage("steady cycle") as notes:
        fastest = ways.fastest(units)
        period = HOUR / parts_per_hour if parts_per_hour > 0.0 else fastest * _SLACK
        if period < fastest - _ROUNDING:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"parts_per_hour is {parts_per_hour:g}, one in {period:.2f} s: at most "
                f"{HOUR / fastest:.2f} are possible, one in {fastest:.2f} s",
            )
        model, chosen = ways.cheapest(max(period, fastest * _SLACK), units)
        once = chosen.cycle
        chosen = chosen.in_turn()
        notes.append(f"{chosen.cycle.period:.2f} s, {chosen.cycle.joules:.0f} J")
    plan = SteadyPlan(
        status=Status.success(),
        info=journal.info(request.start, context.joint_names),
        parts_per_hour=parts_per_hour,
        stations=model.tending.route.visits,
        machines=machines_of(model.request.cell),
        process=model.problem.process,
        problem=model.problem,
        once=once,
        cycle=chosen.cycle,
        gap=chosen.gap,
        fastest=fastest,
    )
    try:
        plan = _with_program(plan, model, chosen, context, saving=saving, cycles=cycles)
    except StageError as failed:
        return SteadyPlan(failed.status, journal.info(request.start, context.joint_names))
    if front_points:
        with journal.stage("front"):
            plan = replace(plan, front=_front(ways, fastest, front_points, units))
    return replace(plan, info=journal.info(request.start, context.joint_names))


def _with_program(
    plan: SteadyPlan,
    model: _TendingModel,
    chosen: _Chosen,
    context: Context,
    *,
    saving: bool,
    cycles: int,
) -> SteadyPlan:
    """The plan with its program, and what was asked for beside it. Raises StageError where a
    movement isn't free in the scene in which it is driven.
    """
    journal = context.journal
    made = CycleSteps(model.request, model.tending, chosen.cycle, chosen.movements, context)
    plan = replace(plan, request=made.request, cell=made.cell, program=program_of(made.steps))
    if saving:
        with journal.stage("saving"):
            held = made.saving(Spreads(made.request))
            own = program_of(made.steps)
            longer = held.common_period if held.common_period > held.period else 0.0
            said = replace(
                held.parts,
                program_id=own.program_id,
                sentence=held.sentence,
                common_seconds=longer,
            )
            plan = replace(plan, saving=held, program=replace(own, savings=said))
    if cycles:
        with journal.stage("run"):
            run_cell, steps = made.run(cycles)
        plan = replace(plan, run=program_of(steps), run_cell=run_cell)
    return plan


@dataclass(frozen=True, eq=False)
class _Chosen:
    """A cycle of certified movements, and what no cycle can be below."""

    cycle: SteadyCycle
    movements: Mapping[UnitKey, Movement]
    bound: float  # J of a cycle

    @property
    def gap(self) -> float:
        return 100.0 * max(self.cycle.joules - self.bound, 0.0) / self.cycle.joules

    def in_turn(self) -> _Chosen:
        """The same made until every slot of a machine has been used. Raises RequestError where that
        takes too many parts.
        """
        turns = self.cycle.turns
        units = self.cycle.units
        if turns * units > _PARTS_MAX:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"machines hold {', '.join(map(str, self.cycle.most))} parts, so it takes "
                f"{turns * units} parts until all have used their slots in turn, at most "
                f"{_PARTS_MAX} are planned: give machines a capacity or a buffer of like numbers",
            )
        movements = {
            (key, turn * units + unit): movement
            for (key, unit), movement in self.movements.items()
            for turn in range(turns)
        }
        return _Chosen(self.cycle.repeated(turns), movements, turns * self.bound)


class _TendingModel:
    """The linear problem of a route, and its solutions as certified movements."""

    def __init__(self, request: ProgramRequest, tending: TendedRoute, work: Work) -> None:
        self.request = request
        self.tending = tending
        self._work = work
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
        machines = [cell.machine(name) for name in machines_of(cell)[1:-1]]
        self._room = [np.inf, *(each.places for each in machines), np.inf]
        self.problem = SteadyProblem(
            activities=tuple(self._activity(a) for a in range(len(visits) - 1)),
            hops={arc: tending.columns[key].curve for arc, key in self._hops().items()},
            after=tuple(modes[name] for name in visits[1:]),
            before=tuple(modes[name] for name in visits[:-1]),
            process=tuple(machine.process for machine in machines),
            capacities=tuple(machine.capacity for machine in machines),
            buffers=tuple(machine.buffer for machine in machines),
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

    def _activity(self, activity: int) -> Curve:
        curves = [self.tending.columns[key].curve for key in activity_keys(self.visits, activity)]
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
            if b not in (a, a + 1) or (a == b and min(self._room[a : a + 2]) > 1)
        }

    def fastest(self, units: int) -> SteadyCycle:
        """The fastest cycle of at most so many units."""
        cycles = [
            fastest_cycle(self.problem, units=count, stopped=self._stopped(count))
            for count in range(1, units + 1)
        ]
        self._work.check()
        found = [cycle for cycle in cycles if cycle is not None]  # without a bound there is one
        return min(found, key=lambda cycle: cycle.seconds_per_part)

    def cheapest(self, period: float, units: int) -> _Chosen | None:
        """The cheapest cycle of at most so many units within a period a part [s]."""
        found = [self._cheapest(period, count) for count in range(1, units + 1)]
        self._work.check()
        known = [chosen for chosen in found if chosen is not None]
        return min(known, key=lambda chosen: chosen.cycle.joules_per_part, default=None)

    def _stopped(self, units: int) -> Callable[[], bool]:
        """Whether a search for a cycle of so many units ends: on request, and where there is one of
        fewer units when the time is up.
        """
        work = self._work
        return lambda: work.cancelled() or (units > 1 and work.late)

    def _cheapest(self, period: float, units: int) -> _Chosen | None:
        """Of exactly so many units, of movements that are certified at the durations that the
        linear problem chose, and its waits once more for these; None where there is none.
        """
        stopped = self._stopped(units)
        cycle = cheapest_cycle(self.problem, period=period, units=units, stopped=stopped)
        if cycle is None or self._work.cancelled():
            return None
        movements = self._realised(cycle)
        again = cheapest_cycle(
            self._fixed(movements, units), period=period + _ROUNDING, units=units
        )
        assert again is not None  # no movement takes longer than was chosen
        return _Chosen(again, movements, cycle.bound)

    def _realised(self, cycle: SteadyCycle) -> dict[UnitKey, Movement]:
        """The movement that each activity and empty hop of the cycle is driven by: of its column,
        the one that takes the seconds that the linear program chose.
        """
        columns = self.tending.columns
        hops = self._hops()
        movements = {
            (key, unit): columns[key].movements[0]
            for key in hops.values()
            for unit in range(cycle.units)
        }
        following = (*cycle.visits[1:], cycle.visits[0])
        for visit, after in zip(cycle.visits, following, strict=True):
            keys = activity_keys(self.visits, visit.activity)
            own = [columns[key] for key in keys]
            moving = visit.seconds - 2.0 * self.tending.route.handling
            lengths = shared_among([column.curve for column in own], moving)
            for key, column, seconds in zip(keys, own, lengths, strict=True):
                movements[key, visit.unit] = column.taking(seconds)
            arc = visit.activity, after.activity
            if arc in hops:
                movements[hops[arc], visit.unit] = columns[hops[arc]].taking(visit.hop)
        return movements

    def _fixed(self, movements: Mapping[UnitKey, Movement], units: int) -> SteadyProblem:
        """The problem with these movements alone."""
        own = {}
        hops = {}
        for unit in range(units):
            for a in range(len(self.visits) - 1):
                curves = [
                    MovementColumn.of([movements[key, unit]]).curve
                    for key in activity_keys(self.visits, a)
                ]
                own[a, unit] = self._with_handling(in_turn(curves), a)
            for (a, b), key in self._hops().items():
                hops[(a, unit), b] = MovementColumn.of([movements[key, unit]]).curve
        return replace(self.problem, own=own, own_hops=hops)


def _ways_that_are_there(cell: Cell) -> list[PartRoute]:
    """The ways of a part over machines that are switched on. Raises RequestError where there is
    none.
    """
    off = {
        way: [name for name in way.visits if not cell.machine(cell.station(name).equipment).enabled]
        for way in cell.part_routes
    }
    there = [way for way, missing in off.items() if not missing]
    if not there:
        station = next(iter(off.values()))[0]
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"the route visits {station} of {cell.station(station).equipment}, which is switched "
            "off: it must be enabled, or the route go without it",
        )
    return there


def _check_contents(cell: Cell) -> None:
    """Raise RequestError where the machines of the route can be full in too many ways."""
    ways = math.prod(1 + cell.machine(name).places for name in machines_of(cell)[1:-1])
    if ways > _CONTENTS_MAX:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"the machines of the route can hold parts in {ways} ways, at most {_CONTENTS_MAX} "
            "are planned: give fewer a capacity or a buffer",
        )


class _Ways:
    """The ways of a part through the cell, each with its model; the first one has the fewest
    visits. Raises StageError where no way can be driven.
    """

    def __init__(self, request: ProgramRequest, context: Context) -> None:
        self._models: list[_TendingModel] = []
        failures = []
        for way in _ways_that_are_there(request.cell):
            route = replace(way, by_states=False)
            own = replace(request, cell=replace(request.cell, route=route))
            _check_contents(own.cell)
            try:
                tending = planned_columns(own, route, context)
            except StageError as failed:
                failures.append(failed)
                continue
            self._models.append(_TendingModel(own, tending, context.journal.work))
        if not self._models:
            raise failures[0]

    @property
    def longest(self) -> float:
        """A period [s] for one unit that suffices on every way."""
        return max(model.problem.longest for model in self._models)

    def fastest(self, units: int) -> float:
        """The shortest period a part [s]."""
        return min(model.fastest(units).seconds_per_part for model in self._models)

    def cheapest(self, period: float, units: int) -> tuple[_TendingModel, _Chosen]:
        """The way of the cheapest cycle within a period a part [s] that one of them keeps, and the
        cycle, whose bound is that of all ways.
        """
        found = [(model, model.cheapest(period, units)) for model in self._models]
        known = [(model, chosen) for model, chosen in found if chosen is not None]
        model, best = min(known, key=lambda each: each[1].cycle.joules_per_part)
        bound = min(chosen.bound / chosen.cycle.units for _, chosen in known)
        return model, replace(best, bound=min(bound * best.cycle.units, best.bound))


def wait_modes(rests: Rests) -> tuple[WaitMode, ...]:
    """The sequences of modes that a wait of known length can be spent in, each ready at its end."""
    modes = [WaitMode(MOTORS, 0.0, rests.timer, 0.0, rests.motors)]
    for sequence in rests.sequences:
        last = at_once(sequence)[-1]
        shortest = last.free + last.rest.times.leave
        joules = rests.in_time(sequence, shortest) - last.rest.watts * shortest
        name = DEEPER.join(rest.name for rest in sequence)
        modes.append(WaitMode(name, shortest, _LONGEST_WAIT, joules, last.rest.watts))
    return tuple(modes)


def _front(ways: _Ways, fastest: float, count: int, units: int) -> tuple[CyclePoint, ...]:
    """Cycles from the fastest on to the cheapest of all, by even steps of their period; at a
    lower throughput what is cheaper at a higher one is kept.
    """
    _, free = ways.cheapest(ways.longest, units)
    begin = fastest * _SLACK
    end = max(free.cycle.seconds_per_part, begin)
    points: list[CyclePoint] = []
    for period in np.linspace(begin, end, count):
        _, chosen = ways.cheapest(float(period), units)
        seconds = chosen.cycle.seconds_per_part
        joules = chosen.cycle.joules_per_part
        point = CyclePoint(HOUR / seconds, seconds, joules, chosen.gap)
        if points and points[-1].joules <= point.joules:
            continue
        points.append(point)
    return tuple(points)
