"""The chain that a request chose, and its steps as they are sent."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, Protocol

from ir_msgs_py.report import MovementKind, PlannedMovement, TrajectoryReport
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import clearance_violation
from ir_planner.program.movement_fronts import Ladder
from ir_planner.program.movements import Failure, Movements
from ir_planner.program.pauses import AUTO, Charge, PlannedPause, pause_by_itself, planned_pause
from ir_planner.program.request import ProgramRequest, Progress, StageError
from ir_planner.program.station_chain import parts_of
from ir_planner.program.station_graph import ACROSS, ENTER, LEAVE, HopPart, StationChain
from ir_planner.program.steps import PlacedStep, Route, Scenes, signal_text
from ir_planner.scene import PlanningScene
from ir_planner.timing import Movement
from ir_values.arrays import FloatArray

# Which states of machines a movement relies on: those without which its clearance would be
# violated.


@dataclass
class Reliance:
    """Of movements that keep `safety_distance` [m]; each is checked once, in every other state of
    every machine.
    """

    safety_distance: float
    _scenes: dict[int, tuple[PlanningScene, tuple[tuple[str, PlanningScene], ...]]] = field(
        default_factory=dict
    )
    _found: dict[tuple[int, str, str], tuple[str, ...]] = field(default_factory=dict)

    def of(
        self, trajectory: JointTrajectory, scene: PlanningScene, station: str
    ) -> tuple[str, ...]:
        """States that a movement in a scene relies on, such as "lathe=door_open"."""
        key = id(scene), trajectory.trajectory_id, station
        if key not in self._found:
            relied = (
                text
                for text, other in self._otherwise(scene)
                if clearance_violation(trajectory, other, self.safety_distance, station) is not None
            )
            self._found[key] = tuple(dict.fromkeys(relied))
        return self._found[key]

    def _otherwise(self, scene: PlanningScene) -> tuple[tuple[str, PlanningScene], ...]:
        """The scene in every other state of its machines, with the state that it is in; it is kept,
        so that nobody else gets its id.
        """
        if id(scene) not in self._scenes:
            others = tuple(
                (
                    f"{machine.name}={machine.state}",
                    replace(scene, cell=scene.cell.with_equipment(machine.name, state=state.name)),
                )
                for machine in scene.cell.equipment
                if machine.enabled
                for state in machine.states
                if state.name != machine.state
            )
            self._scenes[id(scene)] = scene, others
        return self._scenes[id(scene)][1]


# The steps of a program as they are sent: movements with what is held, pauses with their power
# mode.

_KINDS = {
    LEAVE: MovementKind.SERVICE_EXIT,
    ACROSS: MovementKind.REGIONAL,
    ENTER: MovementKind.SERVICE_ENTRY,
}
_AT_STOPS = (MovementKind.SERVICE_ENTRY, MovementKind.CARTESIAN)


@dataclass(frozen=True, eq=False)
class JoinedMovement:
    """A movement of several parts of hops, without rest between them; kind: of the part whose
    station's contacts hold. passes: stops between them.
    """

    movement: Movement
    parts: tuple[HopPart, ...]
    kind: MovementKind
    passes: tuple[str, ...] = ()


class LegMovement(NamedTuple):
    """A movement of a leg: from where to where, and `station`, whose allowed contacts hold."""

    kind: MovementKind
    movement: Movement
    from_name: str
    to_name: str
    station: str
    passes: tuple[str, ...] = ()


class Leg(NamedTuple):
    """How a stop is reached: its movements, and the scene in which they run."""

    to_name: str
    scene: PlanningScene
    movements: tuple[LegMovement, ...]


Legs = dict[int, Leg]  # by the step they belong to
MakePause = Callable[[PlannedPause], PlannedMovement]


class Complete(Protocol):
    """Adds to a step what is said about its movement in a scene, after what left `charge`."""

    def __call__(
        self, step: PlannedMovement, made: LegMovement, scene: PlanningScene, charge: Charge
    ) -> PlannedMovement:
        """The step with its report."""


def in_full(reliance: Reliance) -> Complete:
    """As an answer needs it: everything that is known, and the states of machines that it relies
    on.
    """

    def complete(
        step: PlannedMovement, made: LegMovement, scene: PlanningScene, charge: Charge
    ) -> PlannedMovement:
        movement = made.movement
        states = reliance.of(movement.trajectory, scene, made.station)
        step = replace(step, report=movement.report, states=states)
        return charge.moved(step, movement.energy, movement.context.scene)

    return complete


def energies_only(
    step: PlannedMovement, made: LegMovement, scene: PlanningScene, charge: Charge
) -> PlannedMovement:
    """As programs are compared: duration and energies, the same as in full."""
    movement = made.movement
    energy = charge.taken(movement.energy, movement.context.scene)
    report = TrajectoryReport(duration=step.duration, energy=energy.total, base_energy=energy.base)
    return replace(step, report=report)


def legs_of(
    route: Route,
    hops: list[list[HopPart]],
    movements: Mapping[HopPart, Movement],
    joined: Sequence[JoinedMovement],
) -> Legs:
    """The legs of a route from the movements of its parts, hop by hop; what is joined belongs to
    the hop where it ends.
    """
    ending = {join.parts[-1]: join for join in joined}
    within = {part for join in joined for part in join.parts[:-1]}

    def made(part: HopPart) -> LegMovement:
        join = ending.get(part)
        if join is None:
            kind = _kind_of(part, route)
            station = _station_of(kind, route.name(part.hop - 1), route.name(part.hop))
            here, there = (station,) * 2 if station else _names(part, part, route)
            return LegMovement(kind, movements[part], here, there, station)
        here, there = _names(join.parts[0], part, route)
        station = _station_of(join.kind, here, there)
        return LegMovement(join.kind, join.movement, here, there, station, join.passes)

    return {
        step: Leg(
            route.name(hop),
            route.arriving(hop),
            tuple(made(part) for part in hops[hop] if part not in within),
        )
        for hop, step in enumerate(route.stops)
    }


def _names(first: HopPart, last: HopPart, route: Route) -> tuple[str, str]:
    """Between which stops parts lead; the end of a station's line counts as the station."""
    here = first.hop - (first.kind != ENTER)
    return route.name(here), route.name(last.hop - (last.kind == LEAVE))


def _station_of(kind: MovementKind, here: str, there: str) -> str:
    """The station or path whose allowed contacts hold in a movement of this kind between stops."""
    if kind == MovementKind.SERVICE_EXIT:
        return here
    return there if kind in _AT_STOPS else ""


def _kind_of(part: HopPart, route: Route) -> MovementKind:
    along = part.kind == ENTER and route.at(part.hop).step.kind == "PATH"
    return MovementKind.CARTESIAN if along else _KINDS[part.kind]


def assembled(
    steps: tuple[PlacedStep, ...],
    legs: Legs,
    scenes: Scenes,
    start: FloatArray,
    pause: MakePause,
    charge: Charge,
    complete: Complete,
) -> tuple[PlannedMovement, ...]:
    """Movements and pauses in order, from start (n,). `legs`: by the step they belong to. pause:
    how pauses are spent. charge: what the capacitor holds at first; carried from step to step.
    complete: adds to each movement what is said about it.

    A step runs in this order: wait for signals, move, attach or detach, set signals, dwell.
    """
    result: list[PlannedMovement] = []
    here = ""
    q = start
    for k, placed in enumerate(steps):
        step = placed.step
        waiting = tuple(signal_text(signal) for signal in step.wait_for)
        setting = tuple(signal_text(signal) for signal in step.set_signals)
        leg = legs.get(k)
        moves = [] if leg is None else _moves(leg, charge, complete)
        if leg is not None:
            here = leg.to_name
            q = leg.movements[-1].movement.trajectory.positions[-1] if leg.movements else q
        handling = bool(step.attach or step.detach or setting)
        if moves:
            moves[0] = replace(moves[0], wait_for=waiting)
            moves[-1] = replace(
                moves[-1], attach=step.attach, detach=step.detach, set_signals=setting
            )
        result.extend(moves)
        if step.dwell > 0.0 or (not moves and (handling or waiting)):
            late = not moves
            scene = scenes.after(placed) if moves else scenes.before(placed)
            spent = PlannedPause(here, step.dwell, step.power_mode, q, scene)
            standing = charge.stood(pause(spent), spent)
            result.append(
                replace(
                    standing,
                    wait_for=waiting if late else (),
                    attach=step.attach if late else "",
                    detach=step.detach if late else "",
                    set_signals=setting if late else (),
                    since=step.since,
                )
            )
    return tuple(result)


def _moves(leg: Leg, charge: Charge, complete: Complete) -> list[PlannedMovement]:
    moves = []
    for made in leg.movements:
        trajectory = made.movement.trajectory
        step = PlannedMovement(
            kind=made.kind,
            from_station=made.from_name,
            to_station=made.to_name,
            trajectory_id=trajectory.trajectory_id,
            trajectory=trajectory,
            duration=trajectory.duration,
            load=leg.scene.load_text,
            passes=made.passes,
        )
        moves.append(complete(step, made, leg.scene, charge))
    return moves


# The chain that a request chose, its steps with given movements, and the wait that fills a
# cycle.

_NO_WAIT = 1e-3  # s: durations are whole nanoseconds, stretched by millionths
Steps = tuple[PlannedMovement, ...]
Found = Mapping[HopPart, Movement]


@dataclass(frozen=True, eq=False)
class Choice:
    """A chain of configurations for a request, and its movements at the values of a second."""

    request: ProgramRequest
    ladder: Ladder
    chain: StationChain

    @cached_property
    def _reliance(self) -> Reliance:
        return Reliance(self.request.options.safety_distance)

    @property
    def movements(self) -> Movements:
        """The movements of the request's own objective."""
        return self.ladder.own

    @property
    def parts(self) -> list[HopPart]:
        """The parts of the chain that move, in order."""
        return [part for hop in parts_of(self.chain, self.movements) for part in hop]

    def along(self, chain: StationChain) -> "Choice":
        """The choice with another chain."""
        return replace(self, chain=chain)

    def found(self, progress: Progress) -> dict[HopPart, Movement]:
        """The movements of all parts. Raises StageError where one of them isn't found."""
        movements = self.movements
        result = dict[HopPart, Movement]()
        journal = movements.context.journal
        with journal.stage("movements") as notes:
            for hop, parts in enumerate(parts_of(self.chain, movements)):
                progress("movements", hop, len(movements.route), self.chain.cost)
                for part, found in zip(
                    parts, movements.plan(parts, self.ladder.improvement), strict=True
                ):
                    if isinstance(found, Failure):
                        raise StageError(found.status)
                    result[part] = found
            notes.append(f"{len(result)} movements")
        own_laws = any(movement.timing == "asynchronous" for movement in result.values())
        journal.timing = "asynchronous" if own_laws else "synchronous"
        return result

    def steps(
        self,
        found: Found,
        *,
        until: float = 0.0,
        by_itself: bool = False,
        joined: Sequence[JoinedMovement] = (),
    ) -> Steps:
        """The steps of the program with these movements, and a wait at its end that lasts until
        `until` s.
        by_itself: pauses as the controller spends them when nobody asks for a mode. joined:
        movements in place of those of their parts.
        """
        return self._steps(found, until, self._pause(by_itself), in_full(self._reliance), joined)

    def energies(
        self, found: Found, *, until: float = 0.0, joined: Sequence[JoinedMovement] = ()
    ) -> Steps:
        """The same steps with what they last and cost alone, in a fraction of the time: to
        compare.
        """
        return self._steps(found, until, self._pause(by_itself=False), energies_only, joined)

    def _steps(
        self,
        found: Found,
        until: float,
        pause: MakePause,
        complete: Complete,
        joined: Sequence[JoinedMovement],
    ) -> Steps:
        route = self.movements.route
        charge = Charge(self.request.settings.transitions)
        legs = legs_of(route, parts_of(self.chain, self.movements), found, joined)
        steps = assembled(
            route.steps, legs, route.scenes, self.request.start, pause, charge, complete
        )
        left = until - duration_of(steps)
        if left <= _NO_WAIT:
            return steps
        wait = self._end(left)
        return (*steps, charge.stood(pause(wait), wait))

    def standing(self, found: Found) -> float:
        """Seconds of the pauses in the program."""
        return sum(step.duration for step in self.energies(found) if step.is_pause)

    def waiting(self, seconds: float) -> float:
        """Joules of a wait at the end, in the mode of least energy."""
        return self._pause(by_itself=False)(self._end(seconds)).report.energy

    def _end(self, seconds: float) -> PlannedPause:
        route = self.movements.route
        end = route.scenes.after(route.steps[-1])
        q = self.movements.layers[-1][self.chain.chosen[-1]].interaction
        return PlannedPause(route.name(len(route) - 1), seconds, AUTO, q, end)

    def _pause(self, by_itself: bool) -> MakePause:
        times = self.request.settings.transitions
        if by_itself:
            return lambda pause: pause_by_itself(pause, times)
        return lambda pause: planned_pause(pause, times)


def duration_of(steps: Sequence[PlannedMovement]) -> float:
    """How long steps take [s]."""
    return sum(step.duration for step in steps)
