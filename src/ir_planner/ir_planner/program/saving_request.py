"""A program and what it saves: planned for the time that the common program takes."""

from dataclasses import dataclass, replace

from ir_planner.program.chain import layers_of
from ir_planner.program.common_program import common_program
from ir_planner.program.movements import Movements
from ir_planner.program.program import plan_program, prepared
from ir_planner.program.request import ProgramPlan, ProgramRequest, Progress, StageError, nobody
from ir_planner.program.savings import Savings, savings_of
from ir_planner.request import Journal, Work
from ir_planner.service import exit_searches


@dataclass(frozen=True, eq=False)
class SavingPlan:
    """The program at the common program's total time, and what it saves; None where either isn't found."""

    plan: ProgramPlan
    savings: Savings | None


def plan_savings(request: ProgramRequest, work: Work, progress: Progress = nobody) -> SavingPlan:
    """Plan a program at the common program's time. The request's own cycle time is not used.

    Raises RequestError for a request that makes no sense, CancelledError when stopped.
    """
    journal = Journal(work, request.options.seed)
    route, context = prepared(request, journal)
    fastest = context.asking("time")
    try:
        searches = exit_searches(request.settings.withdrawal)
        layers = layers_of(route, request.start, fastest, searches, progress)
        common = common_program(request, Movements(route, layers, fastest, request.settings.searches))
    except StageError as failed:
        info = journal.info(request.start, context.joint_names)
        return SavingPlan(ProgramPlan(failed.status, info), None)
    seconds = sum(step.duration for step in common.movements)
    plan = plan_program(replace(request, cycle_time=seconds), work, progress)
    if not plan.status.ok:
        return SavingPlan(plan, None)
    return SavingPlan(plan, savings_of(common.movements, plan.movements, common.across, common.around))
