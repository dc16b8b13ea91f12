"""Where an answer holds: its cell and load, the parameters and intervals of its joules, doors.

A certified report names the cell and the load that it was proved with. Nothing is proved here.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from ir_msgs_py.report import PlannedMovement, PlanningInfo, PlanningStage, TrajectoryReport
from ir_msgs_py.status import Status
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.cartesian import CartesianPlan
from ir_planner.checks import Evaluation, interval, movement_spread
from ir_planner.program import (
    ProgramPlan,
    Spreads,
    doors_advice,
    doors_text,
    with_doors,
    with_intervals,
)
from ir_planner.regional import EscapePlan, MovementPlan
from ir_planner.request import noted
from ir_planner.scene import PlanningScene
from ir_planner.service import ServicePlan
from ir_planner.trajectories import OptimizationPlan

AnyMovement = TypeVar("AnyMovement", MovementPlan, CartesianPlan, EscapePlan)
Stamp = Callable[[TrajectoryReport, JointTrajectory | None], TrajectoryReport]


def stamped(report: TrajectoryReport, cell_hash: str, load: str) -> TrajectoryReport:
    """The report with cell and load where it is certified."""
    return replace(report, cell_hash=cell_hash, load=load) if report.certified else report


def in_scene(scene: PlanningScene) -> Stamp:
    """Stamps reports of a scene and gives their energies intervals."""

    def stamp(report: TrajectoryReport, trajectory: JointTrajectory | None) -> TrajectoryReport:
        if trajectory is None:
            return report
        within = interval(report.energy, movement_spread(trajectory, scene))
        return replace(
            report,
            energy_low=within.low,
            energy_high=within.high,
            power_parameters=scene.parameters.name,
            cell_hash=scene.cell_hash if report.certified else report.cell_hash,
            load=scene.load_text if report.certified else report.load,
        )

    return stamp


def movement_in(plan: AnyMovement, scene: PlanningScene, note: str) -> AnyMovement:
    """The plan with its report stamped, remarks on its options and on doors, and what a failure may
    want.
    """
    report = in_scene(scene)(plan.report, plan.trajectory)
    info = remarked(plan.info, scene, note)
    return replace(plan, report=report, info=info, status=_advised(plan.status, scene))


def service_in(plan: ServicePlan, scene: PlanningScene, note: str) -> ServicePlan:
    """The plan with the reports of its candidates stamped, and the same remarks."""
    stamp = in_scene(scene)
    info = remarked(plan.info, scene, note)
    candidates = tuple(
        replace(each, report=stamp(each.report, each.trajectory)) for each in plan.candidates
    )
    return replace(plan, candidates=candidates, info=info, status=_advised(plan.status, scene))


def optimization_in(
    plan: OptimizationPlan, original: JointTrajectory, scene: PlanningScene, note: str
) -> OptimizationPlan:
    """The plan with its reports stamped, and the same remarks."""
    stamp = in_scene(scene)
    info = remarked(plan.info, scene, note)
    before = stamp(plan.before, original)
    after = stamp(plan.after, plan.trajectory)
    return replace(plan, before=before, after=after, info=info, status=_advised(plan.status, scene))


def evaluation_in(
    found: Evaluation, trajectory: JointTrajectory, scene: PlanningScene
) -> Evaluation:
    """What is known of a trajectory with its report stamped, and what a violation may come from."""
    report = in_scene(scene)(found.report, trajectory)
    advice = doors_advice(scene.cell, "", scene.doors)
    return replace(found, report=report, advice=advice)


def remarked(info: PlanningInfo, scene: PlanningScene, note: str) -> PlanningInfo:
    """The record with a remark on the options, and with doors that are not as the cell has them."""
    return noted(noted(info, note), doors_text(scene.doors), "doors")


def _advised(status: Status, scene: PlanningScene) -> Status:
    return status if status.ok else with_doors(status, scene)


def program_in(plan: ProgramPlan, cell_hash: str, timers: str, spreads: Spreads) -> ProgramPlan:
    """The plan with each movement's report stamped with its own load, that of all with the cell
    alone; a stage says whose timers the pauses were planned with.
    """

    def step(movement: PlannedMovement) -> PlannedMovement:
        return replace(movement, report=stamped(movement.report, cell_hash, movement.load))

    plan = with_intervals(plan, spreads)
    compared = (
        plan.compared
        if plan.compared is None
        else program_in(plan.compared, cell_hash, timers, spreads)
    )
    whose = PlanningStage("pauses", 0.0, f"timers and transition times of the {timers}")
    return replace(
        plan,
        info=replace(plan.info, stages=(*plan.info.stages, whose)),
        movements=tuple(step(movement) for movement in plan.movements),
        report=stamped(plan.report, cell_hash, ""),
        compared=compared,
        front=tuple(program_in(point, cell_hash, timers, spreads) for point in plan.front),
    )
