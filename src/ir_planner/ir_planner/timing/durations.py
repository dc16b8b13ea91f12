"""The duration of a movement whose path is settled: as requested, or the best for the objective."""

from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.errors import RequestError
from ir_planner.request import DURATION_MAX, Context
from ir_planner.timing.blending import stretched
from ir_planner.timing.objective import best_stretch

DURATION_SLACK = 1e-6  # relative: what rounding to nanoseconds may add to a duration


def check_duration(duration: float, options: PlanOptions) -> None:
    """Raise RequestError where a movement would last longer than any may."""
    if duration > DURATION_MAX:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"velocity_scaling {options.velocity_scaling:g} and acceleration_scaling "
            f"{options.acceleration_scaling:g} make a movement of {duration:.4g} s: "
            f"it must be at most {DURATION_MAX:g} s",
        )


def check_requested(shortest: float, options: PlanOptions) -> None:
    """Raise RequestError where a duration is requested that is shorter than the shortest [s] there
    is.
    """
    if options.duration > 0.0 and shortest * (1.0 - DURATION_SLACK) > options.duration:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"duration is {options.duration:g} s: the shortest within the limits is "
            f"{shortest:.4g} s",
        )


def at_best_duration(quickest: JointTrajectory, context: Context) -> JointTrajectory:
    """The fastest trajectory at the requested duration, or at the one that the objective likes
    best.

    Raises RequestError when the requested duration is shorter than the fastest, or that longer than
    any may be.
    """
    options = context.options
    check_duration(quickest.duration, options)
    check_requested(quickest.duration, options)
    if options.duration > 0.0:
        return stretched(quickest, max(options.duration / quickest.duration, 1.0))
    return stretched(quickest, best_stretch(quickest, context))
