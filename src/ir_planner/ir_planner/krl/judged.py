"""Steps of a planned program, each judged as it was planned: with its load, its parts where they lie, and
what its station allows.
"""

from collections.abc import Sequence

from ir_description import Cell, PowerData, ProgramStep
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import Evaluation, evaluate_trajectory
from ir_planner.krl.export import Judge
from ir_planner.scene import Drives, PlanningScene, with_parts


def judge_of(
    steps: Sequence[PlannedMovement], cell: Cell, power: PowerData, drives: Drives, margin: float
) -> Judge:
    """A judge of these steps, S_m `margin` m."""
    scenes: dict[int, PlanningScene] = {}
    places = cell.parts_at_start()
    for step in steps:
        standing = with_parts(cell, places)
        for text in step.states:  # of machines: those that the step was planned with
            machine, _, state = text.partition("=")
            standing = standing.with_equipment(machine, state=state)
        scenes[id(step)] = PlanningScene(standing, cell.loads(places.held), power, drives)
        if step.attach or step.detach:
            places = places.after(
                ProgramStep("STATION", step.to_station, attach=step.attach, detach=step.detach)
            )

    def judge(trajectory: JointTrajectory, step: PlannedMovement) -> Evaluation:
        at = {
            MovementKind.SERVICE_EXIT: step.from_station,
            MovementKind.SERVICE_ENTRY: step.to_station,
        }.get(MovementKind(step.kind), "")
        return evaluate_trajectory(trajectory, scenes[id(step)], margin, at)

    return judge
