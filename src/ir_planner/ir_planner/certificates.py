"""Where an answer holds: every report names the cell and the load that it was proved with, and the power
parameters that its joules follow from, with the interval that their uncertainty leaves.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from ir_msgs_py.report import PlannedMovement, PlanningStage, TrajectoryReport
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.cartesian import CartesianPlan
from ir_planner.checks import interval, movement_spread
from ir_planner.program import ProgramPlan, Spreads, with_intervals
from ir_planner.regional import MovementPlan
from ir_planner.scene import PlanningScene
from ir_planner.service import ServicePlan
from ir_planner.trajectories import OptimizationPlan

AnyMovement = TypeVar("AnyMovement", MovementPlan, CartesianPlan)
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
        report = replace(
            report,
            energy_low=within.low,
            energy_high=within.high,
            power_parameters=scene.parameters.name,
        )
        return stamped(report, scene.cell_hash, scene.load_text)

    return stamp


def movement_in(plan: AnyMovement, stamp: Stamp) -> AnyMovement:
    """The plan with its report stamped."""
    return replace(plan, report=stamp(plan.report, plan.trajectory))


def service_in(plan: ServicePlan, stamp: Stamp) -> ServicePlan:
    """The plan with the reports of its candidates stamped."""
    candidates = tuple(replace(each, report=stamp(each.report, each.trajectory)) for each in plan.candidates)
    return replace(plan, candidates=candidates)


def optimization_in(plan: OptimizationPlan, original: JointTrajectory, stamp: Stamp) -> OptimizationPlan:
    """The plan with its reports stamped."""
    after = stamp(plan.after, plan.trajectory)
    return replace(plan, before=stamp(plan.before, original), after=after)


def program_in(plan: ProgramPlan, cell_hash: str, timers: str, spreads: Spreads) -> ProgramPlan:
    """The plan with each movement's report stamped with its own load, that of all with the cell alone;
    a stage says whose timers the pauses were planned with.
    """

    def step(movement: PlannedMovement) -> PlannedMovement:
        return replace(movement, report=stamped(movement.report, cell_hash, movement.load))

    plan = with_intervals(plan, spreads)
    compared = (
        plan.compared if plan.compared is None else program_in(plan.compared, cell_hash, timers, spreads)
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
