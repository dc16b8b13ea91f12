"""One cycle as the steps of a program, and beside it the common cycle of the same order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_description import Cell, Equipment, ProgramStep
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.savings import ProgramSavings
from ir_msgs_py.status import Status, StatusCode
from ir_planner.cycle import LinearProgram, ModeWait, SteadyCycle, Visit
from ir_planner.flexible.columns import TendedRoute, UnitKey, activity_keys, exact
from ir_planner.flexible.cycle_program import (
    CycleLengths,
    MachineSlots,
    cycle_program,
    run_program,
)
from ir_planner.flexible.tending_cell import (
    front_name,
    machines_of,
    with_copies,
    with_signals,
)
from ir_planner.program import (
    ACROSS,
    ENTER,
    MOTORS,
    Choice,
    HopPart,
    Ladder,
    Movements,
    ProgramRequest,
    Route,
    Scenes,
    Spreads,
    StageError,
    StationChain,
    StopNode,
    common_program,
    placed_steps,
    rests_at,
    savings_of,
)
from ir_planner.request import Context
from ir_planner.service import ServiceLine
from ir_planner.timing import Movement

_NO_WAIT = 1e-9  # s


@dataclass(frozen=True)
class CycleSaving:
    """A cycle against the common one in the same order: movements as fast as they can, waits as
    the controller spends them by itself. joules, common [J] a part; low, high [J]: 90 % interval of
    what is saved; period, common_period [s]: the same, unless the common one can't keep it;
    on_motors [J]: of the common one that always waits on motors. parts: of a cycle, movements and
    pauses apart.
    """

    joules: float
    common: float
    low: float
    high: float
    period: float
    common_period: float
    on_motors: float
    parts: ProgramSavings

    @property
    def sentence(self) -> str:
        """The saving in words, with its baseline and its interval."""
        share = 100.0 * (self.common - self.joules) / self.common
        held = f"both in {self.period:.2f} s"
        if self.common_period > self.period:
            held = f"in {self.period:.2f} s, which the common one doesn't keep: it takes "
            held += f"{self.common_period:.2f} s"
        return (
            f"{share:.1f} % a part ({self.joules / 1e3:.2f} kJ instead of "
            f"{self.common / 1e3:.2f} kJ, predicted; 90 % interval of what is saved "
            f"{self.low / 1e3:.2f} to {self.high / 1e3:.2f} kJ) against movements at 100 % in the "
            f"same order with the controller's own timers, {held}; always on motors that takes "
            f"{self.on_motors / 1e3:.2f} kJ"
        )


def _in_time_of(own: Sequence[PlannedMovement], parts: ProgramSavings) -> ProgramSavings:
    """Savings as those of as many cycles as the planned one makes: the common one may take longer,
    and each part is held against a part of it.
    """
    resting = sum(step.duration for step in own if step.is_pause)
    moving = sum(step.duration for step in own) - resting
    return replace(
        parts,
        movements=replace(parts.movements, seconds=moving),
        pauses=replace(parts.pauses, seconds=resting),
    )


class RouteSteps:
    """Programs among the configurations of a route, with certified movements, each proved in the
    scene in which it is driven. empty: no part is in a machine at the begin, else those of the
    cycle are, finished.
    """

    def __init__(
        self, request: ProgramRequest, tending: TendedRoute, cycle: SteadyCycle, *, empty: bool
    ) -> None:
        self.tending = tending
        self.cell = _cell_of(request.cell, tending, cycle, empty=empty)
        first = cycle.visits[0].activity
        start = tending.nodes[tending.route.visits[first]].departure
        self.request = replace(request, cell=self.cell, start=start, stations=(), cycle_time=0.0)
        self._scenes = Scenes(self.cell, request.power, request.settings.drives(self.cell.robot))
        self._names = {front_name(name): name for name in tending.route.visits}
        self._proved: dict[tuple[UnitKey, int, str], Movement] = {}

    def along(
        self,
        program: tuple[ProgramStep, ...],
        nodes: Mapping[str, Sequence[StopNode]],
        context: Context,
    ) -> Choice:
        """A program over configurations at the stations; it ends where it starts."""
        steps = placed_steps(self.cell, program, self.cell.parts_at_start(), self.request.doors)
        route = Route.over(steps, self._scenes)
        begin = StopNode(ServiceLine(self.request.start[None]))
        layers = [[begin]]
        for place in range(len(route)):
            name = route.name(place)
            if name in self._names:
                at = nodes[self._names[name]]
                layers.append([StopNode(ServiceLine(node.departure[None])) for node in at])
            else:
                layers.append(list(nodes[name]))
        layers[-1] = [begin]
        context = context.inside(self._scenes.before(route.steps[0]))
        settings = self.request.settings
        movements = Movements(route, layers, context, settings.searches)
        chain = StationChain([0] * len(layers), 0.0, 0.0, 0.0)
        return Choice(self.request, Ladder(movements, settings.improvement_iterations), chain)

    def steps(
        self,
        program: tuple[ProgramStep, ...],
        units: Sequence[int],
        movements: Mapping[UnitKey, Movement],
        context: Context,
    ) -> tuple[PlannedMovement, ...]:
        """The program in these movements; units: of its transports in order. Raises StageError for
        one that isn't free there.
        """
        choice = self.along(program, {n: [node] for n, node in self.tending.nodes.items()}, context)
        route = choice.movements.route
        taken = np.cumsum([route.at(place).step.attach != "" for place in range(len(route))])
        found = {
            part: self._exact(part, route, movements, units[taken[part.hop] - 1])
            for part in choice.parts
        }
        return choice.steps(found)

    def _exact(
        self, part: HopPart, route: Route, movements: Mapping[UnitKey, Movement], unit: int
    ) -> Movement:
        """A movement of the cycle in the scene of its hop, where the robot and the machines hold
        what they do then; proved once for each. Raises StageError.
        """
        ends = [self._station(route.name(part.hop - 1)), self._station(route.name(part.hop))]
        if part.kind != ACROSS:
            ends = [ends[part.kind == ENTER]] * 2
        loaded = route.at(part.hop).before.held != ""
        station = "" if part.kind == ACROSS else ends[0]
        key = (part.kind, ends[0], ends[1], loaded), unit
        scene = route.arriving(part.hop)
        known = key, id(scene), station
        if known not in self._proved:
            self._proved[known] = exact(movements[key], scene, station)
        found = self._proved[known]
        violation = found.prove().violation
        if violation is not None:
            sentence = f"{part.kind} {' to '.join(ends)}: {violation.sentence}"
            raise StageError(Status(StatusCode.PLANNING_FAILED, sentence))
        return found

    def _station(self, name: str) -> str:
        return self._names.get(name, name)


def _cell_of(cell: Cell, tending: TendedRoute, cycle: SteadyCycle, *, empty: bool) -> Cell:
    """With as many parts as can be in flight: those that machines hold at most, and one for the
    gripper. Those that are in machines when the cycle begins are there, the others aren't yet.
    """
    route = tending.route
    scene = tending.empty
    held = zip(route.visits[1:-1], cycle.full, cycle.most, strict=True)
    places = [
        station if number < full and not empty else ""
        for station, full, most in held
        for number in range(most)
    ]
    fronts = {
        name: scene.chain.tcp_poses(node.departure[None])[0] for name, node in tending.nodes.items()
    }
    standing = with_copies(cell, dict(enumerate([*places, ""], 1)))
    slots = MachineSlots(cell, cycle).finished(empty=empty)
    return with_signals(cell, standing, fronts, slots)


class CycleSteps:
    """The steps of a cycle with the chosen movements."""

    def __init__(
        self,
        request: ProgramRequest,
        tending: TendedRoute,
        cycle: SteadyCycle,
        movements: Mapping[UnitKey, Movement],
        context: Context,
    ) -> None:
        self._request = request
        self._tending = tending
        self._cycle = cycle
        self._context = context
        self._movements = movements
        self._route = RouteSteps(request, tending, cycle, empty=False)
        program = cycle_program(self._route.cell, cycle)
        self.cell: Cell = replace(self._route.cell, program=program)
        units = [visit.unit for visit in cycle.visits]
        self.steps = self._route.steps(program, units, movements, context)

    @property
    def request(self) -> ProgramRequest:
        """The request for the program of the cycle, from in front of its first station."""
        return replace(self._route.request, cell=self.cell)

    def run(self, cycles: int) -> tuple[Cell, tuple[PlannedMovement, ...]]:
        """The steps that fill the line from empty and make so many whole cycles, and their cell."""
        route = RouteSteps(self._request, self._tending, self._cycle, empty=True)
        program, units = run_program(route.cell, self._cycle, self._run_lengths(), cycles)
        steps = route.steps(program, units, self._movements, self._context)
        return replace(route.cell, program=program), steps

    def _run_lengths(self) -> CycleLengths:
        """Seconds of every activity and every empty hop in the chosen movements."""
        visits = self._tending.route.visits
        count = len(visits) - 1
        units = range(self._cycle.units)
        seconds = {key: found.trajectory.duration for key, found in self._movements.items()}
        handling = 2.0 * self._tending.route.handling
        activities = {
            (a, unit): handling + sum(seconds[key, unit] for key in activity_keys(visits, a))
            for a in range(count)
            for unit in units
        }
        across = {
            ((a, unit), b): ((ACROSS, visits[a + 1], visits[b], False), unit)
            for a in range(count)
            for b in range(count)
            for unit in units
        }
        hops = {hop: seconds[key] for hop, key in across.items() if key in seconds}
        return CycleLengths(activities, hops)

    def _along(self, cycle: SteadyCycle, nodes: Mapping[str, Sequence[StopNode]]) -> Choice:
        return self._route.along(cycle_program(self._route.cell, cycle), nodes, self._context)

    def saving(self, spreads: Spreads) -> CycleSaving:
        """Against the common cycle. Raises StageError where that isn't found."""
        common = common_program(self._along(self._cycle, self._tending.choices))
        cycle = self._as_soon_as_possible(common.choice, common.found)
        waiting = self._along(cycle, self._tending.choices).along(common.choice.chain)
        steps = waiting.steps(common.found, by_itself=True)
        own = self.steps
        parts = savings_of(steps, own, len(steps) + len(own), common, spreads.of)
        total = parts.total
        units = cycle.units
        return CycleSaving(
            joules=total.planned / units,
            common=total.common / units,
            low=total.saved_low / units,
            high=total.saved_high / units,
            period=self._cycle.period,
            common_period=cycle.period,
            on_motors=(total.common + self._more_on_motors(cycle)) / units,
            parts=_in_time_of(own, parts),
        )

    def _more_on_motors(self, cycle: SteadyCycle) -> float:
        """Joules more where the waits are spent on motors instead of by the controller."""
        more = 0.0
        for visit in cycle.visits:
            node = self._tending.nodes[self._tending.route.visits[visit.activity]]
            rests = rests_at(node.arrival, self._tending.empty, self._request.settings.transitions)
            for wait in visit.before:
                more += rests.motors * wait.seconds - rests.cost((), wait.seconds)[0]
        return more

    def _as_soon_as_possible(
        self, choice: Choice, found: Mapping[HopPart, Movement]
    ) -> SteadyCycle:
        """The cycle of other movements in the same order that waits for machines only, and at its
        end until the period is over.
        """
        lengths = self._lengths(choice, found)
        visits = self._cycle.visits
        begins, period = soonest(self._cycle, lengths, self._machines())
        again: list[Visit] = []
        free = 0.0
        for visit, (moving, hop), begin in zip(visits, lengths, begins, strict=True):
            waited = begin - free if again else period - begins[-1] - sum(lengths[-1])
            before = (ModeWait(MOTORS, waited),) if waited > _NO_WAIT else ()
            again.append(Visit(visit.activity, visit.unit, begin, moving, hop, before, ()))
            free = begin + moving + hop
        return replace(self._cycle, visits=tuple(again), period=period, joules=np.nan)

    def _machines(self) -> list[Equipment]:
        cell = self._tending.cell
        return [cell.machine(name) for name in machines_of(cell)[1:-1]]

    def _lengths(
        self, choice: Choice, found: Mapping[HopPart, Movement]
    ) -> list[tuple[float, float]]:
        """Seconds of every activity and of the hop after it."""
        route = choice.movements.route
        handling = 2.0 * self._tending.route.handling
        lengths = [[handling, 0.0] for _ in self._cycle.visits]
        visit = -1
        hopping = [0] * len(route)
        for place in range(len(route)):
            step = route.at(place).step
            visit += step.attach != ""
            own = route.name(place) == front_name(route.name(place - 1)) if place else False
            hopping[place] = int(not (step.attach or step.detach or own))
            for part in choice.parts:
                if part.hop == place:
                    lengths[visit][hopping[place]] += found[part].trajectory.duration
        return [(moving, hop) for moving, hop in lengths]


def soonest(
    cycle: SteadyCycle, lengths: Sequence[tuple[float, float]], machines: Sequence[Equipment]
) -> tuple[list[float], float]:
    """When the visits of a cycle begin [s] in the same order with other seconds of each and of the
    hop after it, where the robot waits for machines only, and the period: no shorter than before.
    """
    program = LinearProgram()
    busiest = max(cycle.units * machine.process / machine.capacity for machine in machines)
    period = program.variable(max(cycle.period, busiest), cost=1.0)
    begins = [program.variable(0.0, np.inf if k else 0.0) for k in range(len(lengths))]
    for k, length in enumerate(lengths):
        after = begins[k + 1] if k + 1 < len(lengths) else period
        program.row({after: 1.0, begins[k]: -1.0}, low=sum(length))
    places = {(visit.activity, visit.unit): k for k, visit in enumerate(cycle.visits)}
    for visit in cycle.visits:
        if visit.activity == 0:
            continue
        machine = machines[visit.activity - 1]
        for before in range(cycle.units):  # parts that it finishes one after the other
            unit = visit.unit - cycle.full[visit.activity - 1] - before * machine.capacity
            load = places[visit.activity - 1, unit % cycle.units]
            program.row(
                {
                    begins[places[visit.activity, visit.unit]]: 1.0,
                    begins[load]: -1.0,
                    period: -(unit // cycle.units),
                },
                low=lengths[load][0] + (before + 1) * machine.process,
            )
    shortest = program.relaxed().cost
    program.cost = [float(k != period) for k in range(len(program.cost))]
    program.low[period] = program.high[period] = shortest
    values = program.solve().values
    assert values is not None  # the cycle itself, slowed down
    return [float(values[k]) for k in begins], shortest
