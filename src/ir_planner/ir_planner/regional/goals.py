"""A regional movement to a goal: a pose is reached in the configuration that serves best."""

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import TrajectoryReport
from ir_planner.configurations import free_configurations, no_configuration
from ir_planner.regional.answer import MovementPlan
from ir_planner.regional.exploration import Searches
from ir_planner.regional.regional import plan_regional
from ir_planner.request import Context, Goal


def plan_to_goal(
    start: FloatArray, goal: Goal, context: Context, searches: Searches
) -> MovementPlan:
    """Movement from start (n,) to a configuration, or to any free one at a pose. Raises
    RequestError.
    """
    if goal.configuration is not None:
        return plan_regional(start, goal.configuration[None], context, searches)
    assert goal.pose is not None  # a Goal has one of both
    found = free_configurations(goal.pose, context.scene, context.thresholds(), start)
    if len(found.q) == 0:
        status = no_configuration(goal.pose, context.scene, found, goal.text or "goal")
        return MovementPlan(
            status, context.journal.info(start, context.joint_names), TrajectoryReport()
        )
    return plan_regional(start, found.q, context, searches)
