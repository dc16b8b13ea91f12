"""A whole program: configurations at the stations, all movements and pauses between them, loads and
power modes.

The chain of configurations that costs least by the objective, with the movements that it consists
of, each with what is held at that moment.
"""

import hashlib
from dataclasses import replace

import numpy as np

from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.report import PlannedMovement, PlanningInfo
from ir_msgs_py.savings import ProgramSavings
from ir_msgs_py.status import Status, StatusCode
from ir_planner.checks import total_report
from ir_planner.errors import RequestError
from ir_planner.program.asked_searches import check_searches
from ir_planner.program.choice import Steps
from ir_planner.program.comparison import held_against_common
from ir_planner.program.doors import doors_advice, doors_text
from ir_planner.program.front import front_of
from ir_planner.program.logs import logs_of
from ir_planner.program.more_work import best_answer
from ir_planner.program.request import ProgramPlan, ProgramRequest, Progress, StageError, nobody
from ir_planner.program.route import Route
from ir_planner.program.savings import named
from ir_planner.program.spreads import Spreads
from ir_planner.program.steps import Scenes, placed_steps, steps_of
from ir_planner.request import Context, Journal, Work, noted
from ir_planner.timing import at_the_mains

_SENTENCES = 4  # of a failure
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
    plan = replace(_planned(steps), gap=answer.gap)
    for log in logs_of(choice, steps):
        context.journal.keep(log)
    if choice.parts and request.options.objective == "energy" and cycle <= 0.0:
        moving = plan.report.duration - standing
        plan = replace(plan, status=Status.success(_SLOW.format(moving)))
    if request.savings:
        comparison = held_against_common(choice, steps, cycle, standing, spreads, progress)
        if isinstance(comparison, str):
            plan = replace(plan, savings=ProgramSavings(sentence=comparison))
        else:
            compared = _planned(comparison.steps)
            savings = named(comparison.savings, compared.program_id, comparison.compared)
            plan = replace(
                plan, savings=savings, compared=compared, common=_planned(comparison.common)
            )
    if request.front_points:
        with context.journal.stage("pareto front"):
            front = front_of(choice, request.front_points, standing, progress)
        plan = replace(plan, front=tuple(_planned(point.steps) for point in front))
    return plan


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


def _planned(steps: Steps) -> ProgramPlan:
    """A program with the report of all its movements."""
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
    scenes = Scenes(cell, request.power, settings.drives, bare)
    context = Context(scenes.of(cell.parts_at_start()), request.options, journal)
    if request.cycle_time > 0.0 and request.options.objective == "energy":
        context = at_the_mains(context)
    return Route.over(steps, scenes), context


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
        digest.update("\0".join(str(value) for value in (*texts, *handling)).encode() + b"\n")
    return digest.hexdigest()[:16]
