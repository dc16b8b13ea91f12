"""Poses (4, 4) to and from geometry_msgs: a quaternion that is no rotation and an unknown frame are
named.

A quaternion off by up to 1e-3 is a rounding of the sender and is normalised; beyond that it is a
mistake.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped, Quaternion
from scipy.spatial.transform import Rotation

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.checks import read_only
from ir_msgs_py.errors import PoseError
from ir_msgs_py.names import WORLD_FRAME
from ir_msgs_py.ros.convert_basics import point_to_msg
from ir_msgs_py.status import StatusCode

NORM_TOLERANCE = 1e-3


def pose_to_msg(T: FloatArray) -> Pose:
    """Pose (4, 4) [m]; the quaternion has w >= 0."""
    pose = read_only(T, "pose", (4, 4))
    rotation = Rotation.from_matrix(
        pose[:3, :3].copy()
    )  # SciPy before 1.12 refuses read-only arrays
    x, y, z, w = (float(value) for value in rotation.as_quat(canonical=True))
    return Pose(position=point_to_msg(pose[:3, 3]), orientation=Quaternion(x=x, y=y, z=z, w=w))


def pose_from_msg(msg: Pose) -> FloatArray:
    """Pose (4, 4) [m]; PoseError with INVALID_GOAL_CONSTRAINTS for NaN or a quaternion that is no
    rotation.
    """
    position = np.array([msg.position.x, msg.position.y, msg.position.z])
    quaternion = np.array(
        [msg.orientation.x, msg.orientation.y, msg.orientation.z, msg.orientation.w]
    )
    if not np.isfinite(position).all():
        raise PoseError(
            f"position is {_text(position)} m: it must be finite",
            StatusCode.INVALID_GOAL_CONSTRAINTS,
        )
    norm = float(np.linalg.norm(quaternion))
    if not abs(norm - 1.0) <= NORM_TOLERANCE:
        raise PoseError(
            f"orientation is {_text(quaternion)} (x, y, z, w), its norm {norm:g}: "
            f"it must be 1 within {NORM_TOLERANCE}",
            StatusCode.INVALID_GOAL_CONSTRAINTS,
        )
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
    T[:3, 3] = position
    return read_only(T, "pose", (4, 4))


def stamped_pose_to_msg(T: FloatArray, frame_id: str = WORLD_FRAME) -> PoseStamped:
    """Pose (4, 4) [m] in a frame."""
    msg = PoseStamped(pose=pose_to_msg(T))
    msg.header.frame_id = frame_id
    return msg


def stamped_pose_given(msg: PoseStamped) -> bool:
    """Whether a request names a pose at all: an empty frame_id means not given."""
    return bool(msg.header.frame_id)


def stamped_pose_from_msg(
    msg: PoseStamped, frames: Mapping[str, FloatArray] | None = None
) -> FloatArray:
    """Pose (4, 4) [m] in the cell; frames: poses (4, 4) in the cell of the frames that are known
    besides it.

    Raises PoseError with FRAME_TRANSFORM_FAILURE for an unknown frame, which lists the known ones.
    """
    known = {WORLD_FRAME: np.eye(4), **(frames or {})}
    frame_id = msg.header.frame_id
    if frame_id not in known:
        raise PoseError(
            f'unknown frame "{frame_id[:80]}": known are {", ".join(known)}',
            StatusCode.FRAME_TRANSFORM_FAILURE,
        )
    return read_only(known[frame_id] @ pose_from_msg(msg.pose), "pose", (4, 4))


def _text(values: FloatArray) -> str:
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"
