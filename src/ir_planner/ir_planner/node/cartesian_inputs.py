"""The path of a request as a value: its poses in the frame that it names."""

from dataclasses import replace
from typing import Any

import numpy as np

from ir_description import Cell, CellPath
from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import POSES_MAX, CartesianPath, CartesianSegment
from ir_msgs_py.errors import InvalidValueError, PoseError
from ir_msgs_py.names import BASE_FRAME
from ir_msgs_py.ros.conversions import pose_from_msg, stamped_pose_from_msg, stamped_pose_given
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError

_CODE = StatusCode.INVALID_GOAL_CONSTRAINTS
_FIELDS = (
    "tool_speed",
    "speed_tolerance",
    "blending_radius",
    "orientation",
    "free_angle",
    "approach",
    "retract",
)


def path_of(request: Any, cell: Cell) -> CartesianPath | CellPath:
    """The path of a request, by name or by its poses: settings of a named one are those of the cell
    file, but for those that the request changes from their defaults. Raises RequestError,
    PoseError.
    """
    given = stamped_pose_given(request.start_pose) or bool(request.segments)
    if bool(request.path) == given:
        which = "both are" if given else "neither is"
        raise RequestError(
            _CODE, f"exactly one of path and start_pose with segments must be given, {which}"
        )
    if request.path:
        own = cell.own_path(request.path)
        changed = {name: getattr(request, name) for name in _FIELDS if _changed(request, name)}
        return replace(own, path=replace(own.path, **changed))
    start = stamped_pose_from_msg(request.start_pose, {BASE_FRAME: cell.base_pose})
    frame = cell.base_pose if request.start_pose.header.frame_id == BASE_FRAME else np.eye(4)
    total = sum(len(segment.poses) for segment in request.segments)
    if total > POSES_MAX:
        raise RequestError(_CODE, f"segments have {total} poses: at most {POSES_MAX} are taken")
    segments = tuple(_segment(one, frame, k) for k, one in enumerate(request.segments))
    return CartesianPath(start, segments, **{name: getattr(request, name) for name in _FIELDS})


def _changed(request: Any, name: str) -> bool:
    return bool(getattr(request, name) != CartesianPath.__dataclass_fields__[name].default)


def _segment(msg: Any, frame: FloatArray, k: int) -> CartesianSegment:
    poses = []
    for i, pose in enumerate(msg.poses):
        try:
            poses.append(portable.matmul(frame, pose_from_msg(pose)))
        except PoseError as error:
            raise PoseError(f"segments[{k}].poses[{i}]: {error}", error.code) from error
    try:
        return CartesianSegment(msg.kind, tuple(poses), msg.tool_speed)
    except InvalidValueError as error:
        raise RequestError(_CODE, f"segments[{k}]: {error}") from error
