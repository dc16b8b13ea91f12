"""A path of the tool as a certified movement: the chain of configurations of least J that keeps the
speed.
"""

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import TANGENT, CartesianPath
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_planner.cartesian.answer import CartesianPlan
from ir_planner.cartesian.best import best_along
from ir_planner.cartesian.drawn import drawn
from ir_planner.cartesian.refusal import PathRefusedError
from ir_planner.cartesian.remarks import remarks
from ir_planner.cartesian.tool_path import HeadingError
from ir_planner.errors import RequestError
from ir_planner.request import Context, checked_options, chosen

PLANNER_ID = "cartesian"


def plan_path(
    path: CartesianPath, start: FloatArray | None, t1: bool, context: Context
) -> CartesianPlan:
    """Plan a path from the configuration `start` (n,), None: the one of least J. t1: at most 250
    mm/s.

    Raises RequestError for a request that makes no sense, CancelledError when asked to stop.
    """
    context.journal.planner_id = PLANNER_ID
    context.journal.timing = "synchronous"
    try:
        return _planned(path, start, t1, context)
    except PathRefusedError as error:
        return _answer(error.status, context)
    except HeadingError as error:
        return _answer(heading_status(error), context)


def _planned(
    path: CartesianPath, start: FloatArray | None, t1: bool, context: Context
) -> CartesianPlan:
    if start is not None:
        start = _checked_start(start, context)
    whole = drawn(path, start, t1, context)
    found = best_along(whole.asked, whole.layers)
    with context.journal.stage("tool error"):
        kept = whole.kept(found)
    for name, text in remarks(whole.asked.path, found):
        context.journal.note(name, text)
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


def _checked_start(start: FloatArray, context: Context) -> FloatArray:
    """The configuration (n,) that is given, within the axis limits. Raises RequestError."""
    robot = context.scene.cell.robot
    q = np.asarray(start, dtype=float)
    if q.shape != (robot.n,) or not np.isfinite(q).all():
        raise RequestError(
            StatusCode.START_STATE_INVALID,
            f"start has shape {q.shape}: it must be {robot.n} finite angles in rad",
        )
    over = np.maximum(q - robot.position_max, robot.position_min - q)
    if over.max() > _ROUNDED:
        j = int(np.argmax(over))
        low, high = np.degrees([robot.position_min[j], robot.position_max[j]])
        raise RequestError(
            StatusCode.START_STATE_INVALID,
            f"{robot.joint_names[j]} of start is {np.degrees(q[j]):.2f} deg: "
            f"it must be in [{low:g}, {high:g}] deg",
        )
    return q


_ROUNDED = 1e-9  # rad


def heading_status(error: HeadingError) -> Status:
    """The answer where the tool can't turn with the path."""
    return Status(StatusCode.INVALID_MOTION_PLAN, f"orientation is {TANGENT}: {error}")


def _answer(status: Status, context: Context) -> CartesianPlan:
    return CartesianPlan(
        status, context.journal.info(None, context.joint_names), TrajectoryReport()
    )


def checked_path_options(options: PlanOptions) -> tuple[PlanOptions, str]:
    """The options within the planner's bounds, and a note ("" mostly). Raises RequestError for
    those that a path at a given speed can't meet.
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
            f"timing is {options.timing}: along a path all axes move together, it must be "
            "synchronous",
        )
    return checked_options(options)
