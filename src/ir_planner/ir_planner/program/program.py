"""A whole program: configurations at the stations, all movements and pauses between them, loads and power
modes.

Configurations first (shortest path of eq. 9), then the movements in order, each with what is held at that
moment.
"""

import hashlib

import numpy as np
from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.status import Status, StatusCode

from ir_planner.checks import total_report
from ir_planner.errors import TimingError
from ir_planner.program.assembly import assembled
from ir_planner.program.chain import cheapest_chain, layers_of
from ir_planner.program.cycle_time import Legs, within_cycle
from ir_planner.program.movements import Movements
from ir_planner.program.request import ProgramPlan, ProgramRequest, Progress, StageError
from ir_planner.program.route import Route
from ir_planner.program.station_graph import Node
from ir_planner.program.steps import Scenes, placed_steps, steps_of
from ir_planner.request import Context, Journal, Work
from ir_planner.service import exit_searches


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
    except TimingError as error:
        movements, status = (), Status(StatusCode.PLANNING_FAILED, str(error))
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
    movements = Movements(route, context, request.settings.searches)
    chain, cost = cheapest_chain(layers, movements, context, progress)
    legs = _legs(movements, chain, progress, cost)

    def assemble(legs: Legs) -> tuple[PlannedMovement, ...]:
        return assembled(route.steps, legs, route.scenes, request.settings.transitions, request.start)

    def hurried() -> Legs:
        faster = Movements(route, context.asking("time"), request.settings.searches)
        return _legs(faster, chain, progress, cost)

    if request.cycle_time > 0.0:
        return within_cycle(request.cycle_time, legs, assemble, hurried, context.safety_distance)
    return assemble(legs)


def _legs(movements: Movements, chain: list[Node], progress: Progress, cost: float) -> Legs:
    """Movements to every stop along a chain of configurations, by the step they belong to."""
    route, legs = movements.route, {}
    with movements.context.journal.stage("movements") as notes:
        for place, step in enumerate(route.stops):
            progress("movements", place, len(route), cost)
            legs[step] = movements.leg(place, chain[place], chain[place + 1])
        notes.append(f"{sum(len(leg.movements) for leg in legs.values())} movements")
    return legs
