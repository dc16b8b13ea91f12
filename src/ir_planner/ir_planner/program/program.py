"""A whole program: configurations at the stations, all movements and pauses between them, loads and power
modes.

The chain of configurations that costs least by the objective, with the movements that it consists of, each
with what is held at that moment.
"""

import hashlib

import numpy as np
from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_msgs_py.status import Status

from ir_planner.checks import total_report
from ir_planner.program.assembly import Leg, assembled
from ir_planner.program.chain import cheapest_chain, layers_of, parts_of
from ir_planner.program.cycle_time import Legs, within_cycle
from ir_planner.program.movements import Failure, Movements
from ir_planner.program.request import ProgramPlan, ProgramRequest, Progress, StageError
from ir_planner.program.route import Route
from ir_planner.program.station_graph import ACROSS, ENTER, LEAVE, Chain
from ir_planner.program.steps import Scenes, placed_steps, steps_of
from ir_planner.request import Context, Journal, Work
from ir_planner.service import exit_searches

_KINDS = {
    LEAVE: MovementKind.SERVICE_EXIT,
    ACROSS: MovementKind.REGIONAL,
    ENTER: MovementKind.SERVICE_ENTRY,
}
_CHOOSING = 8_000  # work of a movement while configurations are chosen; more of it improves the chosen ones


def plan_program(request: ProgramRequest, work: Work, progress: Progress) -> ProgramPlan:
    """Plan a program. Raises RequestError for a request that makes no sense, CancelledError when stopped."""
    request.check()
    cell, journal = request.cell, Journal(work, request.options.seed)
    steps = placed_steps(cell, steps_of(cell, request.stations), cell.parts_at_start())
    bare = request.options.load == NO_LOAD
    scenes = Scenes(cell, request.power, request.settings.braking_energy, bare)
    route = Route.over(steps, scenes)
    context = Context(scenes.of(cell.parts_at_start()), request.options, journal)
    try:
        movements, status = _planned(request, route, context, progress), Status.success()
    except StageError as failed:
        movements, status = (), failed.status
    journal.planner_id = "station graph"
    info = journal.info(request.start, context.joint_names)
    if not movements:
        return ProgramPlan(status, info)
    elapsed = np.concatenate([[0.0], np.cumsum([movement.duration for movement in movements])[:-1]])
    report = total_report(tuple(movement.report for movement in movements), tuple(elapsed.tolist()))
    return ProgramPlan(status, info, program_hash(movements), movements, report)


def program_hash(movements: tuple[PlannedMovement, ...]) -> str:
    """Id of a program: hash of its steps and the ids of their trajectories."""
    digest = hashlib.sha256()
    for m in movements:
        texts = (m.kind, m.from_station, m.to_station, m.trajectory_id, repr(m.duration), m.power_mode)
        handling = (m.attach, m.detach, m.load, *m.wait_for, "|", *m.set_signals)
        digest.update("\0".join(str(value) for value in (*texts, *handling)).encode() + b"\n")
    return digest.hexdigest()[:16]


def _planned(
    request: ProgramRequest, route: Route, context: Context, progress: Progress
) -> tuple[PlannedMovement, ...]:
    """Movements and pauses in order. Raises StageError where a stage finds nothing."""
    layers = layers_of(route, request.start, context, exit_searches(request.settings.withdrawal), progress)
    movements = Movements(route, layers, context, request.settings.searches)
    improvement = min(context.work.improvement, _CHOOSING)
    chain = cheapest_chain(movements, improvement, progress)
    _improve(movements, chain, improvement)
    legs = _legs(movements, chain, improvement, progress)

    def assemble(legs: Legs) -> tuple[PlannedMovement, ...]:
        return assembled(route.steps, legs, route.scenes, request.settings.transitions, request.start)

    def hurried() -> Legs:
        faster = Movements(route, layers, context.asking("time"), request.settings.searches)
        return _legs(faster, chain, improvement, progress)

    if request.cycle_time > 0.0:
        return within_cycle(request.cycle_time, legs, assemble, hurried)
    return assemble(legs)


def _improve(movements: Movements, chain: Chain, improvement: int) -> None:
    """Plan the regional movements of a chain again where the request has more work than the choice took."""
    work = movements.context.work
    across = [part for parts in parts_of(chain, movements) for part in parts if part.kind == ACROSS]
    more = min(work.improvement, (work.max_iterations - work.iterations) // max(len(across), 1))
    if across and more > improvement and not work.exhausted:
        with movements.context.journal.stage("improve"):
            movements.plan(across, improvement)
            movements.better(across, more)


def _legs(movements: Movements, chain: Chain, improvement: int, progress: Progress) -> Legs:
    """Movements to every stop along a chain of configurations, by the step they belong to."""
    route, legs, context = movements.route, {}, movements.context
    parts = parts_of(chain, movements)
    with context.journal.stage("movements") as notes:
        for place, step in enumerate(route.stops):
            progress("movements", place, len(route), chain.cost)
            found = []
            for part, movement in zip(parts[place], movements.plan(parts[place], improvement), strict=True):
                if isinstance(movement, Failure):
                    raise StageError(movement.status)
                found.append((_KINDS[part.kind], movement))
            legs[step] = Leg(route.name(place - 1), route.name(place), route.arriving(place), tuple(found))
        notes.append(f"{sum(len(leg.movements) for leg in legs.values())} movements")
    return legs
