"""The steps of a program as they are sent: movements with what is held, pauses with their power
mode.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Protocol

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import MovementKind, PlannedMovement, TrajectoryReport
from ir_planner.program.charge import Charge
from ir_planner.program.pauses import Pause
from ir_planner.program.reliance import Reliance
from ir_planner.program.route import Route
from ir_planner.program.station_graph import ACROSS, ENTER, LEAVE, Part
from ir_planner.program.steps import PlacedStep, Scenes, signal_text
from ir_planner.scene import PlanningScene
from ir_planner.timing import Movement

_KINDS = {
    LEAVE: MovementKind.SERVICE_EXIT,
    ACROSS: MovementKind.REGIONAL,
    ENTER: MovementKind.SERVICE_ENTRY,
}
_AT_STOPS = (MovementKind.SERVICE_ENTRY, MovementKind.CARTESIAN)


@dataclass(frozen=True, eq=False)
class Leg:
    """How a stop is reached: its movements with their kind, and the scene in which they run."""

    from_name: str
    to_name: str
    scene: PlanningScene
    movements: tuple[tuple[MovementKind, Movement], ...]

    def station_of(self, kind: MovementKind) -> str:
        """The station or path whose allowed contacts hold in a movement of this kind."""
        if kind == MovementKind.SERVICE_EXIT:
            return self.from_name
        return self.to_name if kind in _AT_STOPS else ""


Legs = dict[int, Leg]  # by the step they belong to
MakePause = Callable[[Pause], PlannedMovement]


class Complete(Protocol):
    """Adds to a step what is said about its movement in a scene, at a station, after what left
    `charge`.
    """

    def __call__(
        self, step: PlannedMovement, movement: Movement, leg: Leg, station: str, charge: Charge
    ) -> PlannedMovement:
        """The step with its report."""


def in_full(reliance: Reliance) -> Complete:
    """As an answer needs it: everything that is known, and the states of machines that it relies
    on.
    """

    def complete(
        step: PlannedMovement, movement: Movement, leg: Leg, station: str, charge: Charge
    ) -> PlannedMovement:
        states = reliance.of(movement.trajectory, leg.scene, station)
        step = replace(step, report=movement.report, states=states)
        return charge.moved(step, movement.energy, movement.context.scene)

    return complete


def energies_only(
    step: PlannedMovement, movement: Movement, leg: Leg, station: str, charge: Charge
) -> PlannedMovement:
    """As programs are compared: duration and energies, the same as in full."""
    energy = charge.taken(movement.energy, movement.context.scene)
    report = TrajectoryReport(duration=step.duration, energy=energy.total, base_energy=energy.base)
    return replace(step, report=report)


def legs_of(route: Route, hops: list[list[Part]], movements: Mapping[Part, Movement]) -> Legs:
    """The legs of a route from the movements of its parts, hop by hop."""
    return {
        step: Leg(
            route.name(hop - 1),
            route.name(hop),
            route.arriving(hop),
            tuple((_kind_of(part, route), movements[part]) for part in hops[hop]),
        )
        for hop, step in enumerate(route.stops)
    }


def _kind_of(part: Part, route: Route) -> MovementKind:
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
            q = leg.movements[-1][1].trajectory.positions[-1] if leg.movements else q
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
            spent = Pause(here, step.dwell, step.power_mode, q, scene)
            standing = charge.stood(pause(spent), spent)
            result.append(
                replace(
                    standing,
                    wait_for=waiting if late else (),
                    attach=step.attach if late else "",
                    detach=step.detach if late else "",
                    set_signals=setting if late else (),
                )
            )
    return tuple(result)


def _moves(leg: Leg, charge: Charge, complete: Complete) -> list[PlannedMovement]:
    moves = []
    for kind, movement in leg.movements:
        station = leg.station_of(kind)
        step = PlannedMovement(
            kind=kind,
            from_station=station or leg.from_name,
            to_station=station or leg.to_name,
            trajectory_id=movement.trajectory.trajectory_id,
            trajectory=movement.trajectory,
            duration=movement.trajectory.duration,
            load=leg.scene.load_text,
        )
        moves.append(complete(step, movement, leg, station, charge))
    return moves
