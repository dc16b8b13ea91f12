"""Programs: configurations at the stations, movements, pauses and power modes."""

import hashlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ir_msgs_py.modes import modes_of
from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.report import MovementKind, PlannedMovement, PlanningInfo
from ir_msgs_py.savings import ProgramSavings
from ir_msgs_py.search_log import CorrectionLog, SearchLog, WithdrawalLog
from ir_msgs_py.status import Status, StatusCode
from ir_planner.checks import total_report
from ir_planner.errors import RequestError
from ir_planner.program.blending import blended
from ir_planner.program.choice import Choice, Steps
from ir_planner.program.cycle_time import front_of
from ir_planner.program.more_work import best_answer
from ir_planner.program.movements import Movements
from ir_planner.program.part_costs import CostEdges
from ir_planner.program.pauses import AUTO
from ir_planner.program.request import (
    ProgramPlan,
    ProgramRequest,
    Progress,
    StageError,
    check_searches,
    nobody,
)
from ir_planner.program.rests import MOTORS
from ir_planner.program.savings import held_against_common, named
from ir_planner.program.spreads import Spreads
from ir_planner.program.station_chain import TOLERANCE, layers_of
from ir_planner.program.station_graph import HopPart, Settled, StationGraph
from ir_planner.program.steps import Route, Scenes, doors_advice, doors_text, placed_steps, steps_of
from ir_planner.program.stop_nodes import StopNode, leaves_zone
from ir_planner.request import Context, Journal, Work, noted
from ir_planner.scene import PlanningScene, scene_with
from ir_planner.service import ExitPath, exit_searches, lines_free, service_lines
from ir_planner.timing import at_the_mains
from ir_values.arrays import FloatArray

# What the searches that a cell asks for at its stations and steps did for the chain that was
# chosen.

_DROPPED = 300  # configurations that came too near something, kept for a picture
_BETWEEN = 12  # positions of the tool along a step of a path
_DRIVEN = 120  # along a movement
_EDGES = 1_000_000  # certified edges to look at one straight line: they are no work of the request
_SAME = 1e-6  # rad


def logs_of(choice: Choice, steps: Sequence[PlannedMovement]) -> Iterator[SearchLog]:
    """Of the withdrawals and genetic corrections along a chain, each once; steps: of its
    program.
    """
    movements = choice.movements
    exits = set[int]()
    for place, row in enumerate(choice.chain.chosen):
        node: StopNode = movements.layers[place][row]
        exit_ = node.line.exit
        if exit_ is not None and id(exit_) not in exits:
            exits.add(id(exit_))
            yield _withdrawal_log(place - 1, node, exit_, movements)
    for part in choice.parts:
        for log in movements.logs(part):
            if isinstance(log, CorrectionLog) and id(log) not in exits:
                exits.add(id(log))
                names = movements.route.name(part.hop - 1), movements.route.name(part.hop)
                driven = _tool_positions(part, movements, steps)
                yield replace(log, start=names[0], goal=names[1], driven=driven)


def _tool_positions(
    part: HopPart, movements: Movements, steps: Sequence[PlannedMovement]
) -> FloatArray:
    """Positions (M, 3) of the tool along the step that a part became; none where no step has its
    ends.
    """
    ends = np.stack(movements.ends(part))
    scene = movements.route.arriving(part.hop)
    for step in steps:
        motion = step.trajectory
        if step.kind != MovementKind.REGIONAL or motion is None:
            continue
        if np.abs(motion.positions[[0, -1]] - ends).max() < _SAME:
            times = np.linspace(motion.times[0], motion.times[-1], _DRIVEN)
            return _tool(motion.sample(times).q, scene)
    return np.zeros((0, 3))


def _tool(q: FloatArray, scene: PlanningScene) -> FloatArray:
    return scene.chain.tcp_poses(np.ascontiguousarray(q))[:, :3, 3] if len(q) else np.zeros((0, 3))


def _withdrawal_log(
    place: int, node: StopNode, found: ExitPath, movements: Movements
) -> WithdrawalLog:
    """The withdrawal at a stop, along its points `found` but for whole turns.

    Only the stochastic search walks in generations: of other methods the log has the path alone.
    """
    scene = movements.route.arriving(place)
    station = scene.station(movements.route.name(place))
    share = np.linspace(0.0, 1.0, _BETWEEN)[:, None, None]
    steps = found.points[:-1] + share * np.diff(found.points, axis=0)
    along = steps.transpose(1, 0, 2).reshape(-1, found.points.shape[1])
    rejected = sorted(found.search.rejected.items(), key=lambda item: (-item[1], item[0]))
    arriving = movements.context.inside(scene).at(station.name)
    leaving = arriving.inside(movements.route.leaving(place))
    start = found.points[:1]
    log = WithdrawalLog(
        station=station.name,
        load=scene.load_text,
        method=found.method,
        generations=0,
        candidates=0,
        rejected=tuple(rejected),
        distance=(0.0, 0.0),
        kept=_tool(start, scene),
        parents=np.zeros(1, dtype=np.int64),
        dropped=_tool(start[:0], scene),
        path=_tool(along, scene),
        asked=station.search.withdrawal != "",
        blocked=_blocked(node.interaction, (arriving, leaving)),
    )
    walk = found.search.walk
    if walk is None:
        return log
    every = max(-(-len(walk.dropped) // _DROPPED), 1)
    return log._replace(
        generations=walk.generations,
        candidates=walk.candidates,
        distance=walk.distance,
        kept=_tool(walk.kept, scene),
        parents=walk.parents,
        dropped=_tool(walk.dropped[::every], scene),
    )


def _blocked(q: FloatArray, both: tuple[Context, Context]) -> str:
    """Why the straight line back along the tool from q (n,) leads nowhere, on arriving or on
    leaving; "": it is free and leaves the zone.
    """
    uncounted = Journal(Work(_EDGES, np.inf, both[0].work.clock), both[0].journal.seed)
    contexts = [replace(context, journal=uncounted) for context in both]
    rejected: Counter[str] = Counter()
    lines = service_lines(q[None], contexts[0], rejected)
    free = bool(lines) and all(all(lines_free(lines, context, rejected)) for context in contexts)
    if free and all(leaves_zone(lines, contexts[0])):
        return ""
    return next(iter(rejected), f"line out of {both[0].station}: it ends within the zone")


# A whole program: configurations at the stations, all movements and pauses between them, loads and
# power modes.
#
# The chain of configurations that costs least by the objective, with the movements that it consists
# of, each with what is held at that moment.

_SENTENCES = 4  # of a failure
_SAME_PAUSE = 1e-6  # s
_ENDED = "{}; {} ended before all was tried: more of it may help"
_SLOW = (
    "objective energy counts the drives alone, which take least when they are slow: the "
    "movements take {:.1f} s; for the least energy at the mains give a cycle_time, or a price of "
    "time by time_and_energy"
)


def plan_program(
    request: ProgramRequest, work: Work, progress: Progress = nobody, spreads: Spreads | None = None
) -> ProgramPlan:
    """Plan a program; spreads: those of the request, which keep what they are asked.

    Raises RequestError for a request that makes no sense, CancelledError when stopped.
    """
    journal = Journal(work, request.options.seed)
    route, context = prepared(request, journal)
    try:
        answer = _answered(request, route, context, progress, spreads or Spreads(request))
    except StageError as failed:
        status = _with_reason(_advised(failed.status, route), work)
        return ProgramPlan(status, _info(request, context))
    # the record of the whole request, savings and front included
    return replace(answer, info=_info(request, context))


def _answered(
    request: ProgramRequest, route: Route, context: Context, progress: Progress, spreads: Spreads
) -> ProgramPlan:
    """The program, what it saves, and its front, as they were asked for. Raises StageError where a
    stage finds nothing.
    """
    answer = best_answer(request, route, context, progress)
    choice = answer.choice
    steps = answer.steps
    standing = answer.standing
    cycle = request.cycle_time
    if not choice.parts and (cycle > 0.0 or request.front_points):
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"the program has no movement: cycle_time (is {cycle:g} s) and front_points "
            f"(is {request.front_points}) must be 0",
        )
    plan = replace(program_of(steps), gap=answer.gap)
    for log in logs_of(choice, steps):
        context.journal.keep(log)
    remarks = [*_other_rests(steps, route, request), *_beyond_rests(steps, request)]
    if choice.parts and request.options.objective == "energy" and cycle <= 0.0:
        remarks = [_SLOW.format(plan.report.duration - standing), *remarks]
    if remarks:
        plan = replace(plan, status=Status.success("; ".join(remarks[:_SENTENCES])))
    if request.savings:
        comparison = held_against_common(choice, steps, cycle, standing, spreads, progress)
        if isinstance(comparison, str):
            plan = replace(plan, savings=ProgramSavings(sentence=comparison))
        else:
            compared = program_of(comparison.steps)
            savings = named(comparison.savings, compared.program_id, comparison.compared)
            plan = replace(
                plan, savings=savings, compared=compared, common=program_of(comparison.common)
            )
    if request.front_points:
        with context.journal.stage("pareto front"):
            front = front_of(choice, request.front_points, standing, progress)
        plan = replace(plan, front=tuple(program_of(blended(point).steps) for point in front))
    return plan


def _other_rests(steps: Steps, route: Route, request: ProgramRequest) -> list[str]:
    """Of each pause that can't be spent in the mode that it asks for: where it is planned."""
    times = request.settings.transitions
    pauses = [placed.step for placed in route.steps if placed.step.kind == "PAUSE"]
    pausing = iter(step for step in steps if step.is_pause)
    remarks = []
    for pause in pauses:
        fits = (step for step in pausing if abs(step.duration - pause.dwell) <= _SAME_PAUSE)
        given = next(fits, None)
        mode = pause.power_mode
        if given is None or mode in (AUTO, given.power_mode):
            continue
        reason = "longer than the controller stands on motors"
        if mode != MOTORS:
            needed = times.rest(mode).shortest
            reason = f"too short for {mode}, which takes {needed:g} s to enter, stay in and leave"
        remarks.append(
            f"a pause of {pause.dwell:g} s is {reason}: it is planned in {given.power_mode}"
        )
    return list(dict.fromkeys(remarks))


def _beyond_rests(steps: Steps, request: ProgramRequest) -> list[str]:
    """Of each place where the program rests beyond the controller's table of measured rests: what
    counts there.
    """
    table = request.power.rest_table
    q = request.start
    remarks: dict[str, str] = {}
    for step in steps if table is not None else ():
        if step.trajectory is not None:
            q = step.trajectory.positions[-1]
        elif table is not None and any(
            mode.name in table.modes for mode in modes_of(step.power_mode)
        ):
            load = scene_with(request.cell, step.load, request.power).load_mass
            if table.outside(q.tolist(), load):
                where = step.from_station or "start"
                remarks.setdefault(
                    where, f"at {where} {request.power.rest_remark(q.tolist(), load)}"
                )
    return list(remarks.values())


def _with_reason(status: Status, work: Work) -> Status:
    """The status of a refusal, with what it was that ended first."""
    if status.code != StatusCode.PLANNING_FAILED or not work.exhausted:
        return status
    ended = "planning_time" if work.truncated else "max_iterations"
    return replace(status, message=_ENDED.format(status.message, ended))


def _advised(status: Status, route: Route) -> Status:
    """A failure with what is known of doors that were not as the cell has them."""
    stops = (route.steps[k] for k in route.stops)
    said = (doors_advice(route.scenes.cell, stop.step.target, stop.doors_before) for stop in stops)
    sentences = [status.message, *filter(None, said)]
    return replace(status, message="; ".join(sentences[:_SENTENCES]))


def program_of(steps: Steps) -> ProgramPlan:
    """The answer of these steps, with the report of all of them."""
    elapsed = np.concatenate([[0.0], np.cumsum([step.duration for step in steps])[:-1]])
    report = total_report(tuple(step.report for step in steps), tuple(elapsed.tolist()))
    return ProgramPlan(Status.success(), PlanningInfo(), program_hash(steps), steps, report)


def _info(request: ProgramRequest, context: Context) -> PlanningInfo:
    context.journal.planner_id = "station graph"
    info = context.journal.info(request.start, context.joint_names)
    return noted(info, doors_text(request.doors), "doors")


def prepared(request: ProgramRequest, journal: Journal) -> tuple[Route, Context]:
    """The route of a request and what its stages need to know. Raises RequestError for one without
    sense.
    """
    request.check()
    cell = request.cell
    steps = placed_steps(
        cell, steps_of(cell, request.stations), cell.parts_at_start(), request.doors
    )
    check_searches(cell, [placed.step for placed in steps], request.settings.searches)
    settings = request.settings
    bare = request.options.load == NO_LOAD
    scenes = Scenes(cell, request.power, settings.drives(cell.robot), bare)
    context = Context(scenes.of(cell.parts_at_start()), request.options, journal)
    if request.cycle_time > 0.0 and request.options.objective == "energy":
        context = at_the_mains(context)
    route = Route.over(steps, scenes)
    for place in range(len(route)):
        context.leaning_by(route.tilt(place))  # one that can't be kept is refused here
    for k, placed in enumerate(steps):
        if placed.step.via is not None and k not in route.stops:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"step {k + 1} passes {', '.join(placed.step.via.places)} and goes nowhere: the "
                f"step before it ends at {placed.step.target} already",
            )
    return route, context


def program_hash(movements: tuple[PlannedMovement, ...]) -> str:
    """Id of a program: hash of its steps and the ids of their trajectories."""
    digest = hashlib.sha256()
    for m in movements:
        texts = (
            m.kind,
            m.from_station,
            m.to_station,
            m.trajectory_id,
            repr(m.duration),
            m.power_mode,
        )
        handling = (m.attach, m.detach, m.load, *m.wait_for, "|", *m.set_signals)
        since = ("since", m.since) if m.since else ()
        said = "\0".join(str(value) for value in (*texts, *handling, *since))
        digest.update(said.encode() + b"\n")
    return digest.hexdigest()[:16]


# What to expect of a program before it is planned: whether its stops can be reached at all, and
# what coarse movements cost that meet nothing. That takes a small part of the work of planning it.


class Outlook(NamedTuple):
    """status: why a stop has no configuration that can be entered and left. cost: by the objective,
    without a cycle time, of the cheapest chain of coarse movements, less their margin; inf where
    the status says why.
    """

    status: Status
    cost: float


def outlook(request: ProgramRequest, work: Work) -> Outlook:
    """The outlook of a request; its cycle time doesn't count. Raises RequestError for one without
    sense.
    """
    route, context = prepared(replace(request, cycle_time=0.0), Journal(work, request.options.seed))
    settings = request.settings
    searches = exit_searches(settings.withdrawal)
    try:
        layers = layers_of(route, request.start, context, searches, nobody, settings.interaction)
    except StageError as failed:
        return Outlook(failed.status, np.inf)
    if not len(route):
        return Outlook(Status.success(), 0.0)
    edges = CostEdges(Movements(route, layers, context, settings.searches), 0)

    def coarse(parts: list[HopPart]) -> list[Settled]:
        return [replace(found, exact=True) for found in edges.settle(parts)]

    return Outlook(Status.success(), StationGraph(edges.hops(), coarse, TOLERANCE).solve().cost)
