"""A path of the tool as a certified movement: the chain of configurations of least J that keeps the speed."""

from dataclasses import replace

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import TANGENT, CartesianPath
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_planner.cartesian.answer import CartesianPlan
from ir_planner.cartesian.best import T1_SPEED, Asked, best_along
from ir_planner.cartesian.corners import Joint, joined
from ir_planner.cartesian.layers import layers_of
from ir_planner.cartesian.parts import parts_of
from ir_planner.cartesian.refusal import PathRefusedError
from ir_planner.cartesian.tool_error import Kept, kept_of
from ir_planner.cartesian.tool_path import HeadingError, ToolPath
from ir_planner.checks import FreeSpace
from ir_planner.errors import RequestError
from ir_planner.request import Context, checked_options, chosen

PLANNER_ID = "cartesian"
TOOL_ERROR_MAX = 1e-4  # m


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
        return _answer(Status(StatusCode.INVALID_MOTION_PLAN, f"orientation is {TANGENT}: {error}"), context)


def _planned(path: CartesianPath, start: FloatArray | None, t1: bool, context: Context) -> CartesianPlan:
    if t1:
        path = _at_most(path, T1_SPEED)
    with context.journal.stage("path") as notes:
        whole, joints = joined(path, parts_of(path))
        _check_corners(path, whole, joints)
        notes.append(f"{whole.length:.3f} m in {len(whole.parts)} parts")
        if (reduced := _reduced(path, whole, joints)) < path.blending_radius:
            notes.append(f"blending radius down to {reduced:.4g} m: half of a part")
    space = FreeSpace.of(context.scene, context.safety_distance, context.work)
    with context.journal.stage("configurations") as notes:
        layers = layers_of(whole, path.free_angle, space, start)
        notes.append(f"{len(layers.q)} at {len(layers.s)} samples, {int(layers.free.sum())} free")
    found = best_along(Asked(path, whole, start is not None, t1, context), layers)
    with context.journal.stage("tool error"):
        kept = kept_of(found.sent, whole, found.angle, context.scene)
    leaves = max((joint.leaves for joint in joints), default=0.0)
    turns = max((joint.turns for joint in joints), default=0.0)
    kept = replace(kept, tool_error=kept.tool_error + leaves, rotation_error=kept.rotation_error + turns)
    if kept.tool_error > TOOL_ERROR_MAX:
        raise PathRefusedError(
            f"the tool can't be shown to keep within {TOOL_ERROR_MAX * 1e3:g} mm of the path: "
            f"{kept.tool_error * 1e3:.3g} mm"
        )
    trajectory = found.movement.trajectory
    status, info = Status.success(), context.journal.info(trajectory.positions[0], context.joint_names)
    lengths = whole.ends[1:][[part.kept for part in whole.parts]]
    return CartesianPlan(
        status, info, found.movement.report, trajectory, *_values(kept), lengths, len(layers.q)
    )


def _values(kept: Kept) -> tuple[float, float, float]:
    return kept.tool_error, kept.rotation_error, kept.speed_deviation


def _answer(status: Status, context: Context) -> CartesianPlan:
    return CartesianPlan(status, context.journal.info(None, context.joint_names), TrajectoryReport())


def _at_most(path: CartesianPath, speed: float) -> CartesianPath:
    segments = tuple(replace(one, tool_speed=min(one.tool_speed, speed)) for one in path.segments)
    return replace(path, tool_speed=min(path.tool_speed, speed), segments=segments)


def _reduced(path: CartesianPath, whole: ToolPath, joints: tuple[Joint, ...]) -> float:
    """The smallest radius [m] of a corner that is rounded as asked for."""
    rounded = [joint.radius for joint in joints if joint.rounded]
    return min(rounded, default=path.blending_radius)


def _check_corners(path: CartesianPath, whole: ToolPath, joints: tuple[Joint, ...]) -> None:
    """Raise PathRefusedError at a corner within the path where the tool would have to stop and may not."""
    for k, joint in enumerate(joints, start=1):
        before, after = whole.parts[k - 1], whole.parts[k]
        if joint.radius > 0.0 or not (before.kept and after.kept):
            continue
        corner = f"at {whole.ends[k]:.3f} m the path has a corner of {np.degrees(joint.angle):.1f} deg"
        if path.orientation == TANGENT:
            raise PathRefusedError(
                f"{corner}: a tool that turns with the path can't follow it; give a blending_radius",
                StatusCode.INVALID_MOTION_PLAN,
            )
        if path.speed_tolerance < 1.0:
            raise PathRefusedError(
                f"{corner}, where the tool can't keep {before.speed:g} m/s: give a blending_radius, or "
                f"speed_tolerance 1 to stop there (it is {path.speed_tolerance:g})",
                StatusCode.INVALID_MOTION_PLAN,
            )


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
