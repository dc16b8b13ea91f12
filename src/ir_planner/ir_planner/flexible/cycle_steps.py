"""One cycle as the steps of a program, and beside it the common cycle of the same order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ir_description import Cell
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.status import Status, StatusCode
from ir_planner.checks import interval
from ir_planner.cycle import SteadyCycle, Visit, Wait
from ir_planner.flexible.columns import Key, Tending, exact
from ir_planner.flexible.tending_cell import (
    cycle_program,
    front_name,
    machines_of,
    program_cell,
)
from ir_planner.program import (
    ACROSS,
    ENTER,
    MOTORS,
    Chain,
    Choice,
    Ladder,
    Movements,
    Node,
    Part,
    PlacedStep,
    ProgramRequest,
    Route,
    Scenes,
    Spreads,
    StageError,
    common_program,
    placed_steps,
    rests_at,
)
from ir_planner.request import Context
from ir_planner.service import ServiceLine
from ir_planner.timing import Movement


@dataclass(frozen=True)
class CycleSaving:
    """A cycle against the common one in the same order: movements as fast as they can, waits as
    the controller spends them by itself. joules, common [J] a part; low, high [J]: 90 % interval of
    what is saved; period, common_period [s]: the same, unless the common one can't keep it;
    on_motors [J]: of the common one that always waits on motors.
    """

    joules: float
    common: float
    low: float
    high: float
    period: float
    common_period: float
    on_motors: float

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


class CycleSteps:
    """The steps of a cycle with the chosen movements, each proved in the scene it is driven in."""

    def __init__(
        self,
        request: ProgramRequest,
        tending: Tending,
        cycle: SteadyCycle,
        movements: Mapping[Key, Movement],
        context: Context,
    ) -> None:
        self._tending = tending
        self._cycle = cycle
        scene = tending.empty
        fronts = {
            name: scene.chain.tcp_poses(node.departure[None])[0]
            for name, node in tending.nodes.items()
        }
        self.cell: Cell = program_cell(request.cell, cycle, fronts)
        first = tending.route.visits[cycle.visits[0].activity]
        start = tending.nodes[first].departure
        self._request = replace(request, cell=self.cell, start=start, stations=(), cycle_time=0.0)
        self._context = context
        self._scenes = Scenes(self.cell, request.power, request.settings.drives(self.cell.robot))
        self._names = {front_name(name): name for name in tending.route.visits}
        self._choice = self._along(cycle, {name: [n] for name, n in tending.nodes.items()})
        self._found = {part: self._exact(part, movements) for part in self._choice.parts}

    @property
    def request(self) -> ProgramRequest:
        """The request for the program of the cycle, from in front of its first station."""
        return self._request

    @property
    def steps(self) -> tuple[PlannedMovement, ...]:
        """Movements and pauses of one cycle."""
        return self._choice.steps(self._found)

    def _placed(self, cycle: SteadyCycle) -> tuple[PlacedStep, ...]:
        program = cycle_program(self._tending.cell, cycle)
        return placed_steps(self.cell, program, self.cell.parts_at_start(), self._request.doors)

    def _along(self, cycle: SteadyCycle, nodes: Mapping[str, list[Node]]) -> Choice:
        """The steps of a cycle over configurations at the stations; it ends where it starts."""
        route = Route.over(self._placed(cycle), self._scenes)
        begin = Node(ServiceLine(self._request.start[None]))
        layers = [[begin]]
        for place in range(len(route)):
            name = route.name(place)
            if name in self._names:
                at = nodes[self._names[name]]
                layers.append([Node(ServiceLine(node.departure[None])) for node in at])
            else:
                layers.append(nodes[name])
        layers[-1] = [begin]
        context = self._context.inside(self._scenes.before(route.steps[0]))
        settings = self._request.settings
        movements = Movements(route, layers, context, settings.searches)
        chain = Chain([0] * len(layers), 0.0, 0.0, 0.0)
        return Choice(self._request, Ladder(movements, settings.improvement_iterations), chain)

    def _exact(self, part: Part, movements: Mapping[Key, Movement]) -> Movement:
        route = self._choice.movements.route
        ends = [self._station(route.name(part.hop - 1)), self._station(route.name(part.hop))]
        if part.kind != ACROSS:
            ends = [ends[part.kind == ENTER]] * 2
        loaded = route.at(part.hop).before.held != ""
        station = "" if part.kind == ACROSS else ends[0]
        key = part.kind, ends[0], ends[1], loaded
        found = exact(movements[key], route.arriving(part.hop), station)
        if found.violation is not None:
            sentence = f"{part.kind} {' to '.join(ends)}: {found.violation.sentence}"
            raise StageError(Status(StatusCode.PLANNING_FAILED, sentence))
        return found

    def _station(self, name: str) -> str:
        return self._names.get(name, name)

    def saving(self, spreads: Spreads) -> CycleSaving:
        """Against the common cycle. Raises StageError where that isn't found."""
        common = common_program(self._along(self._cycle, self._tending.choices))
        cycle = self._as_soon_as_possible(common.choice, common.found)
        waiting = self._along(cycle, self._tending.choices).along(common.choice.chain)
        steps = waiting.steps(common.found, by_itself=True)
        own = self.steps
        energies = [sum(step.report.energy for step in each) for each in (own, steps)]
        added = sum(spreads.of(steps), np.zeros(1)) - sum(spreads.of(own), np.zeros(1))
        saved = interval(energies[1] - energies[0], added)
        return CycleSaving(
            joules=energies[0],
            common=energies[1],
            low=saved.low,
            high=saved.high,
            period=self._cycle.period,
            common_period=cycle.period,
            on_motors=energies[1] + self._more_on_motors(cycle),
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

    def _as_soon_as_possible(self, choice: Choice, found: Mapping[Part, Movement]) -> SteadyCycle:
        """The cycle of other movements in the same order that waits for machines only, and at its
        end until the period is over.
        """
        lengths = self._lengths(choice, found)
        visits = self._cycle.visits
        cell = self._tending.cell
        process = [cell.machine(name).process for name in machines_of(cell)]
        order = [visit.activity for visit in visits]
        count = len(order)
        waits = np.zeros(count)
        for _ in range(4 * count):
            for k, activity in enumerate(order):
                if activity == 0:
                    continue
                i = order.index(activity - 1)
                since = lengths[i][1]
                i = (i + 1) % count
                while i != k:
                    since += waits[i] + sum(lengths[i])
                    i = (i + 1) % count
                waits[k] = max(process[activity] - since, 0.0)
        period = float(waits.sum()) + sum(map(sum, lengths))
        waits[0] += max(self._cycle.period - period, 0.0)
        again = []
        here = 0.0
        for k, visit in enumerate(visits):
            here += float(waits[k]) if k else 0.0
            before = (Wait(MOTORS, float(waits[k])),) if waits[k] > 0.0 else ()
            again.append(Visit(visit.activity, 0, here, *lengths[k], before, ()))
            here += sum(lengths[k])
        return SteadyCycle(tuple(again), max(period, self._cycle.period), 1, np.nan, np.nan)

    def _lengths(self, choice: Choice, found: Mapping[Part, Movement]) -> list[tuple[float, float]]:
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
