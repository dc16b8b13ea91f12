"""A whole program: configurations at the stations, all movements and pauses between them, loads and power
modes.

The chain of configurations that costs least by the objective, with the movements that it consists of, each
with what is held at that moment.
"""

import hashlib
from collections.abc import Mapping

import numpy as np

from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.status import Status
from ir_planner.checks import total_report
from ir_planner.program.assembly import assembled, legs_of
from ir_planner.program.chain import cheapest_chain, layers_of, parts_of
from ir_planner.program.cycle_plan import Cycle, timed_chain
from ir_planner.program.cycle_time import Timed
from ir_planner.program.movements import Failure, Movements
from ir_planner.program.pauses import AUTO, Pause, planned_pause
from ir_planner.program.request import ProgramPlan, ProgramRequest, Progress, StageError
from ir_planner.program.route import Route
from ir_planner.program.station_graph import ACROSS, Chain, Part
from ir_planner.program.steps import Scenes, placed_steps, steps_of
from ir_planner.request import Context, Journal, Work
from ir_planner.service import exit_searches
from ir_planner.timing import Movement

_CHOOSING = 8_000  # work of a movement while configurations are chosen; more of it improves the chosen ones


def plan_program(request: ProgramRequest, work: Work, progress: Progress) -> ProgramPlan:
    """Plan a program. Raises RequestError for a request that makes no sense, CancelledError when stopped."""
    journal = Journal(work, request.options.seed)
    route, context = prepared(request, journal)
    try:
        movements, status = _planned(request, route, context, progress), Status.success()
    except StageError as failed:
        movements, status = (), failed.status
    return finished(request, context, status, movements)


def finished(
    request: ProgramRequest, context: Context, status: Status, movements: tuple[PlannedMovement, ...]
) -> ProgramPlan:
    """The answer, with the report of all movements; without them where there are none."""
    context.journal.planner_id = "station graph"
    info = context.journal.info(request.start, context.joint_names)
    if not movements:
        return ProgramPlan(status, info)
    elapsed = np.concatenate([[0.0], np.cumsum([movement.duration for movement in movements])[:-1]])
    report = total_report(tuple(movement.report for movement in movements), tuple(elapsed.tolist()))
    return ProgramPlan(status, info, program_hash(movements), movements, report)


def prepared(request: ProgramRequest, journal: Journal) -> tuple[Route, Context]:
    """The route of a request and what its stages need to know. Raises RequestError for one without sense."""
    request.check()
    cell = request.cell
    steps = placed_steps(cell, steps_of(cell, request.stations), cell.parts_at_start())
    settings, bare = request.settings, request.options.load == NO_LOAD
    scenes = Scenes(cell, request.power, settings.braking_energy, bare)
    return Route.over(steps, scenes), Context(scenes.of(cell.parts_at_start()), request.options, journal)


def program_hash(movements: tuple[PlannedMovement, ...]) -> str:
    """Id of a program: hash of its steps and the ids of their trajectories."""
    digest = hashlib.sha256()
    for m in movements:
        texts = (m.kind, m.from_station, m.to_station, m.trajectory_id, repr(m.duration), m.power_mode)
        handling = (m.attach, m.detach, m.load, *m.wait_for, "|", *m.set_signals)
        digest.update("\0".join(str(value) for value in (*texts, *handling)).encode() + b"\n")
    return digest.hexdigest()[:16]


def chosen_chain(
    request: ProgramRequest, route: Route, context: Context, progress: Progress
) -> tuple[Movements, Chain, int]:
    """The chain of configurations with its movements, and the work that each of them had.

    Raises StageError where there is none.
    """
    layers = layers_of(route, request.start, context, exit_searches(request.settings.withdrawal), progress)
    movements = Movements(route, layers, context, request.settings.searches)
    improvement = min(context.work.improvement, _CHOOSING)
    return movements, cheapest_chain(movements, improvement, progress), improvement


def _planned(
    request: ProgramRequest, route: Route, context: Context, progress: Progress
) -> tuple[PlannedMovement, ...]:
    """Movements and pauses in order. Raises StageError where a stage finds nothing."""
    movements, chain, improvement = chosen_chain(request, route, context, progress)
    if request.cycle_time <= 0.0:
        _improve(movements, chain, improvement)
        found = _movements_of(movements, chain, improvement, progress)
        return steps_along(request, movements, chain, found)
    found = _movements_of(movements, chain, improvement, progress)
    cycle = cycle_of(request, movements, chain, found)
    chain, timed = timed_chain(cycle, movements, chain, improvement, progress)
    return filled(request, movements, chain, timed, request.cycle_time)


def steps_along(
    request: ProgramRequest, movements: Movements, chain: Chain, found: Mapping[Part, Movement]
) -> tuple[PlannedMovement, ...]:
    """The steps of the program with the movements of a chain's parts."""
    route, times = movements.route, request.settings.transitions
    legs = legs_of(route, parts_of(chain, movements), found)
    return assembled(
        route.steps, legs, route.scenes, request.start, lambda pause: planned_pause(pause, times)
    )


def cycle_of(
    request: ProgramRequest, movements: Movements, chain: Chain, found: Mapping[Part, Movement]
) -> Cycle:
    """The request's cycle time with what pauses take of it, and what a wait at its end costs."""
    standing = sum(step.duration for step in steps_along(request, movements, chain, found) if step.is_pause)
    return Cycle(
        request.cycle_time,
        standing,
        lambda chain, left: _wait(request, movements, chain, left).report.energy,
    )


def filled(
    request: ProgramRequest, movements: Movements, chain: Chain, timed: Timed, cycle_time: float
) -> tuple[PlannedMovement, ...]:
    """The steps of a program with the wait that fills its cycle [s]."""
    planned = steps_along(request, movements, chain, timed.movements)
    if timed.wait <= 0.0:
        return planned
    left = cycle_time - sum(movement.duration for movement in planned)
    return (*planned, _wait(request, movements, chain, left))


def _wait(request: ProgramRequest, movements: Movements, chain: Chain, seconds: float) -> PlannedMovement:
    """The wait at the end of a program, in the mode of least energy."""
    route = movements.route
    end = route.scenes.of(route.steps[-1].after)
    q = movements.layers[-1][chain.chosen[-1]].interaction
    pause = Pause(route.name(len(route) - 1), seconds, AUTO, q, end)
    return planned_pause(pause, request.settings.transitions)


def _improve(movements: Movements, chain: Chain, improvement: int) -> None:
    """Plan the regional movements of a chain again where the request has more work than the choice took."""
    work = movements.context.work
    across = [part for parts in parts_of(chain, movements) for part in parts if part.kind == ACROSS]
    more = min(work.improvement, (work.max_iterations - work.iterations) // max(len(across), 1))
    if across and more > improvement and not work.exhausted:
        with movements.context.journal.stage("improve"):
            movements.plan(across, improvement)
            movements.better(across, more)


def _movements_of(
    movements: Movements, chain: Chain, improvement: int, progress: Progress
) -> dict[Part, Movement]:
    """Movements of all parts along a chain. Raises StageError where one of them isn't found."""
    result: dict[Part, Movement] = {}
    with movements.context.journal.stage("movements") as notes:
        for hop, parts in enumerate(parts_of(chain, movements)):
            progress("movements", hop, len(movements.route), chain.cost)
            for part, found in zip(parts, movements.plan(parts, improvement), strict=True):
                if isinstance(found, Failure):
                    raise StageError(found.status)
                result[part] = found
        notes.append(f"{len(result)} movements")
    return result
