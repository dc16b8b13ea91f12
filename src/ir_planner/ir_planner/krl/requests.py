"""What users ask: what a KRL program costs in the planner's cell, and a planned one as KRL."""

from collections.abc import Sequence
from dataclasses import replace

from ir_krl import Followed, KrlError
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_msgs_py.status import StatusCode
from ir_planner.certificates import in_scene
from ir_planner.errors import RequestError
from ir_planner.krl.evaluated import EvaluatedProgram, EvaluatedStep, evaluate_program
from ir_planner.krl.export import KrlExport, export
from ir_planner.krl.judged import judge_of
from ir_planner.planner import Planner
from ir_planner.program import Charge
from ir_planner.request import safety_distance

ASYNCHRONOUS = "asynchronous"


def evaluate_krl(
    planner: Planner, program: Followed, margin: float = 0.02, load: str = ""
) -> EvaluatedProgram:
    """A program as a KR C4 drives it from machine home, S_m `margin` [m], with `load` attached all
    along.

    Raises RequestError, KrlMotionError.
    """
    safety_distance(margin)
    scene = planner.scene(load)
    found = evaluate_program(program, scene, planner.cell.machine_home, margin)
    certify = in_scene(scene)

    def named(step: EvaluatedStep) -> EvaluatedStep:
        report = certify(step.found.report, step.step.trajectory)
        return replace(step, found=replace(step.found, report=report))

    return replace(found, steps=tuple(named(step) for step in found.steps))


def export_krl(
    planner: Planner,
    movements: Sequence[PlannedMovement],
    name: str,
    options: PlanOptions | None = None,
) -> KrlExport:
    """Planned movements as a KRL program, read back, driven by the controller's model and certified
    again.

    options: those that were planned with. Raises RequestError where that can't be.
    """
    chosen = options or PlanOptions()
    if chosen.timing == ASYNCHRONOUS:
        raise RequestError(
            StatusCode.INVALID_MOTION_PLAN,
            "timing is asynchronous: a controller's motions end all axes together, plan with "
            "synchronous",
        )
    scene = planner.scene("")
    judge = judge_of(
        movements, planner.cell, scene.power, planner.settings.drives, chosen.safety_distance
    )
    try:
        return export(movements, name, scene, judge, Charge(planner.settings.transitions))
    except KrlError as error:
        raise RequestError(StatusCode.INVALID_MOTION_PLAN, str(error)) from error


def one_movement(planner: Planner, trajectory_id: str) -> tuple[PlannedMovement, ...]:
    """A stored trajectory as a program of one movement. Raises RequestError for an unknown id."""
    trajectory = planner.trajectories.get(trajectory_id)
    report = planner.evaluate(trajectory, 0.0, "", "").report
    movement = PlannedMovement(
        kind=MovementKind.REGIONAL,
        trajectory_id=trajectory_id,
        trajectory=trajectory,
        report=report,
        duration=trajectory.duration,
    )
    return (movement,)
