"""All configurations at a pose, as an answer: in closed form, or by the paper's search."""

from dataclasses import dataclass

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import IkSolution, PlanningInfo
from ir_msgs_py.status import Status, StatusCode
from ir_planner.configurations.interaction_point import searched_configurations
from ir_planner.configurations.inverse_kinematics import (
    free_configurations,
    no_configuration,
    ranked_solutions,
)
from ir_planner.configurations.settings import InteractionSettings
from ir_planner.errors import RequestError
from ir_planner.presentation import status_text
from ir_planner.request import Context, Goal

IK_METHODS = ("analytic", "ccd")


@dataclass(frozen=True, eq=False)
class IkAnswer:
    """Ranked solutions; empty with a status that says why."""

    status: Status
    solutions: tuple[IkSolution, ...]
    info: PlanningInfo

    def __repr__(self) -> str:
        if not self.solutions:
            return f"IkAnswer({status_text(self.status)})"
        best = self.solutions[0]
        first = f"W {best.movement_cost:.0f}, clearance {1e3 * best.clearance:.0f} mm"
        return f"IkAnswer({len(self.solutions)} solutions, the first: {first})"


def configurations_at(
    goal: Goal, near: FloatArray, context: Context, starts: int, settings: InteractionSettings
) -> IkAnswer:
    """Free configurations that reach the goal's pose, ranked by W from `near` (n,), by the method
    that the
    journal names: all of them (analytic), or those found from random starts (ccd).

    Raises RequestError for a goal without a pose.
    """
    if goal.pose is None:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            "goal is a configuration: compute_ik takes a pose or a station",
        )
    scene = context.scene
    journal = context.journal
    threshold = context.at(goal.station).thresholds()
    with journal.stage("closed form" if journal.planner_id == "analytic" else "ccd") as notes:
        if journal.planner_id == "analytic":
            found = free_configurations(goal.pose, scene, threshold, near)
        else:
            found = searched_configurations(
                goal.pose, scene, threshold, near, starts, journal.seed, settings, context.work
            )
        notes.append(f"{found.reached} reach the pose")
    journal.rejected.update(found.rejected)
    info = journal.info(near, context.joint_names)
    if len(found.q) == 0:
        return IkAnswer(no_configuration(goal.pose, scene, found, goal.text or "goal"), (), info)
    return IkAnswer(
        Status.success(), ranked_solutions(found, goal.pose, scene, threshold, near), info
    )
