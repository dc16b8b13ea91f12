"""A path of the tool as a certified movement: the chain of configurations of least J that keeps the speed."""

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import TANGENT, CartesianPath
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_planner.cartesian.answer import CartesianPlan
from ir_planner.cartesian.best import DrivenPath, best_along
from ir_planner.cartesian.drawn import drawn
from ir_planner.cartesian.refusal import PathRefusedError
from ir_planner.cartesian.tool_path import HeadingError
from ir_planner.errors import RequestError
from ir_planner.request import Context, checked_options, chosen

PLANNER_ID = "cartesian"


def plan_path(path: CartesianPath, start: FloatArray | None, t1: bool, context: Context) -> CartesianPlan:
    """Plan a path from the configuration `start` (n,), None: the one of least J. t1: at most 250 mm/s.

    Raises RequestError for a request that makes no sense, CancelledError when asked to stop.
    """
    context.journal.planner_id, context.journal.timing = PLANNER_ID, "synchronous"
    try:
        return _planned(path, start, t1, context)
    except PathRefusedError as error:
        return _answer(error.status, context)
    except HeadingError as error:
        return _answer(heading_status(error), context)


def _planned(path: CartesianPath, start: FloatArray | None, t1: bool, context: Context) -> CartesianPlan:
    whole = drawn(path, start, t1, context)
    found = best_along(whole.asked, whole.layers)
    with context.journal.stage("tool error"):
        kept = whole.kept(found)
    if found.longer:
        context.journal.note("speed", _kept_between(found))
    trajectory = found.movement.trajectory
    info = context.journal.info(trajectory.positions[0], context.joint_names)
    return CartesianPlan(
        Status.success(),
        info,
        found.movement.report,
        trajectory,
        kept.tool_error,
        kept.rotation_error,
        kept.speed_deviation,
        whole.lengths,
        len(whole.layers.q),
    )


def _kept_between(found: DrivenPath) -> str:
    """Where the tool keeps its speed, whose ramps are long."""
    stretches = [
        (stroke.curve.begin + begin, stroke.curve.begin + end)
        for stroke in found.sent.strokes
        for begin, end, even in zip(
            stroke.law.places[:-1], stroke.law.places[1:], stroke.law.even, strict=True
        )
        if even
    ]
    where = ", ".join(f"from {begin:.3f} to {end:.3f} m" for begin, end in stretches) or "nowhere"
    return f"the axes need long ramps: the tool keeps its speed {where}"


def heading_status(error: HeadingError) -> Status:
    """The answer where the tool can't turn with the path."""
    return Status(StatusCode.INVALID_MOTION_PLAN, f"orientation is {TANGENT}: {error}")


def _answer(status: Status, context: Context) -> CartesianPlan:
    return CartesianPlan(status, context.journal.info(None, context.joint_names), TrajectoryReport())


def checked_path_options(options: PlanOptions) -> tuple[PlanOptions, str]:
    """The options within the planner's bounds, and a note ("" mostly). Raises RequestError for those that a
    path at a given speed can't meet.
    """
    chosen(options.planner_id, ("", PLANNER_ID), "planner_id")
    if options.duration > 0.0:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"duration is {options.duration:g} s: it follows from tool_speed here, it must be 0 s",
        )
    if options.timing != "synchronous":
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"timing is {options.timing}: along a path all axes move together, it must be synchronous",
        )
    return checked_options(options)
