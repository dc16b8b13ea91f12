"""Conversions of stamps, points, poses, joint values and trajectories to and from messages.

Each pair x_to_msg, x_from_msg is a round trip. What a message can't mean is named by field, point
and joint: a quaternion that is no rotation, an unknown frame, times that don't increase.
"""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Mapping, Sequence

import numpy as np
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg
from trajectory_msgs.msg import JointTrajectoryPoint

from ir_msgs.msg import Status as StatusMsg
from ir_msgs_py.names import WORLD_FRAME
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_values.arrays import FloatArray, IntArray, read_only
from ir_values.errors import (
    InvalidValueError,
    JointNamesError,
    PoseError,
    TrajectoryError,
    one_line,
)
from ir_values.rotations import quaternions_from_rotations, rotations_from_quaternions

NS_PER_S = 1_000_000_000


def float_array(values: FloatArray) -> array[float]:
    """Values (n,) as a float64[] field takes them without looking at each element."""
    return array("d", values.tobytes())


def time_to_msg(stamp_ns: int) -> Time:
    """Node clock [ns] as a stamp."""
    seconds, nanoseconds = divmod(int(stamp_ns), NS_PER_S)
    return Time(sec=seconds, nanosec=nanoseconds)


def time_from_msg(msg: Time) -> int:
    """Stamp as node clock [ns]."""
    return int(msg.sec) * NS_PER_S + int(msg.nanosec)


def recovery_to_msg(number: int, recovered_ns: int) -> Header:
    """When the stop of this number was recovered, by the system's clock [ns]; 0: none came yet."""
    return Header(stamp=time_to_msg(recovered_ns), frame_id=str(number))


def recovery_from_msg(msg: Header) -> tuple[int, int]:
    """Number of a stop, -1 for none, and when it was recovered [ns]."""
    text = msg.frame_id
    number = int(text) if re.fullmatch(r"\d{1,20}", text, re.ASCII) else -1
    return number, time_from_msg(msg.stamp)


def point_to_msg(point: FloatArray) -> Point:
    """Point (3,) [m]."""
    x, y, z = (float(value) for value in point)
    return Point(x=x, y=y, z=z)


def point_from_msg(msg: Point) -> FloatArray:
    """Point (3,) [m], finite."""
    return read_only([msg.x, msg.y, msg.z], "point", (3,))


def status_to_msg(status: Status) -> StatusMsg:
    """Outcome of a request; its sentence bounded and without control characters."""
    return StatusMsg(code=int(status.code), message=one_line(status.message), source=status.source)


def status_from_msg(msg: StatusMsg) -> Status:
    """Outcome of a request."""
    return Status(int(msg.code), msg.message, msg.source)


def configuration_to_msg(joint_names: Sequence[str], q: FloatArray) -> JointState:
    """Joint values q (n,) [rad] with their names."""
    return JointState(name=list(joint_names), position=float_array(q))


def configuration_given(msg: JointState) -> bool:
    """Whether a request names a configuration at all: an empty one means the node's default."""
    return bool(msg.name or msg.position)


def configuration_from_msg(msg: JointState, joint_names: Sequence[str]) -> FloatArray:
    """Joint values (n,) [rad] in the order of joint_names; names may be missing (then that order is
    meant).

    Raises JointNamesError for foreign, missing or double names, InvalidValueError for the values.
    """
    names = _checked_names(msg, joint_names)
    if len(msg.position) != len(names):
        raise InvalidValueError(
            f"position has {len(msg.position)} values: {len(names)} joints need as many"
        )
    return _in_order(msg.position, "position", names, joint_names)


def velocity_from_msg(msg: JointState, joint_names: Sequence[str]) -> FloatArray | None:
    """Joint velocities (n,) [rad/s] in the order of joint_names, None where the message has none.

    Raises as configuration_from_msg.
    """
    names = _checked_names(msg, joint_names)
    if not msg.velocity:
        return None
    if len(msg.velocity) != len(names):
        raise InvalidValueError(
            f"velocity has {len(msg.velocity)} values: it must have none or as many as "
            f"{len(names)} joints"
        )
    return _in_order(msg.velocity, "velocity", names, joint_names)


def _checked_names(msg: JointState, joint_names: Sequence[str]) -> list[str]:
    """The joints of a message, each expected one once; those of joint_names where it names none."""
    expected = list(joint_names)
    names = list(msg.name) or expected
    known = ", ".join(expected)
    if len(names) != len(set(names)):
        raise JointNamesError(f"a joint is named more than once: expected are {known}")
    for name in names:
        if name not in expected:
            raise JointNamesError(f"unknown joint {name[:80]!r}: expected are {known}")
    for name in expected:
        if name not in names:
            raise JointNamesError(f"joint {name!r} is missing: expected are {known}")
    return names


def _in_order(
    values: Sequence[float], what: str, names: list[str], joint_names: Sequence[str]
) -> FloatArray:
    """Finite values of `names` in the order of joint_names."""
    finite = read_only(values, what, (len(names),))
    return read_only(finite[[names.index(name) for name in joint_names]], what, (len(names),))


NORM_TOLERANCE = 1e-3
"""A quaternion whose norm is off by as much is a rounding of the sender and is normalised; beyond
that it is a mistake and refused.
"""


def pose_to_msg(T: FloatArray) -> Pose:
    """Pose (4, 4) [m]; the quaternion has w >= 0."""
    pose = read_only(T, "pose", (4, 4))
    x, y, z, w = quaternions_from_rotations(pose[:3, :3]).tolist()
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
    norm = math.hypot(*quaternion)  # of any numbers, without an overflow
    if not abs(norm - 1.0) <= NORM_TOLERANCE:
        raise PoseError(
            f"orientation is {_text(quaternion)} (x, y, z, w), its norm {norm:g}: "
            f"it must be 1 within {NORM_TOLERANCE}",
            StatusCode.INVALID_GOAL_CONSTRAINTS,
        )
    T = np.eye(4)
    T[:3, :3] = rotations_from_quaternions(quaternion)
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


MAX_POINTS = 100_000


def trajectory_to_msg(trajectory: JointTrajectory) -> JointTrajectoryMsg:
    """All points; its stamp 0 means: start at once."""
    msg = JointTrajectoryMsg(joint_names=list(trajectory.joint_names))
    msg.points = [
        JointTrajectoryPoint(
            positions=float_array(trajectory.positions[k]),
            velocities=[]
            if trajectory.velocities is None
            else float_array(trajectory.velocities[k]),
            accelerations=[]
            if trajectory.accelerations is None
            else float_array(trajectory.accelerations[k]),
            time_from_start=duration_to_msg(int(trajectory.times_ns[k])),
        )
        for k in range(len(trajectory.times_ns))
    ]
    return msg


def trajectory_given(msg: JointTrajectoryMsg) -> bool:
    """Whether a request or answer carries points at all."""
    return bool(msg.joint_names or msg.points)


def trajectory_from_msg(
    msg: JointTrajectoryMsg, joint_names: Sequence[str] | None = None, max_points: int = MAX_POINTS
) -> JointTrajectory:
    """Read a trajectory; with joint_names also put it into this joint order.

    Raises TrajectoryError: no names or points, more than max_points, a wrong count at point k, a
    value that is not finite, times that don't increase, efforts (not used here: torque follows from
    the motion).
    JointNamesError: a joint that is unknown, missing or double.
    """
    names = tuple(msg.joint_names)
    if not names:
        raise TrajectoryError("the trajectory has no joint names")
    if not msg.points:
        raise TrajectoryError("the trajectory has no points")
    if len(msg.points) > max_points:
        raise TrajectoryError(
            f"the trajectory has {len(msg.points)} points: at most {max_points} are taken"
        )
    for k, point in enumerate(msg.points):
        if len(point.effort):
            sentence = f"point {k} has effort: torque follows from the motion, leave it empty"
            raise TrajectoryError(sentence, point=k)
    times = [_time_ns(point.time_from_start, k) for k, point in enumerate(msg.points)]
    trajectory = _build(msg, names, np.array(times, dtype=np.int64))
    return trajectory if joint_names is None else trajectory.reordered(joint_names)


def duration_to_msg(duration_ns: int) -> Duration:
    """Duration [ns]."""
    seconds, nanoseconds = divmod(duration_ns, NS_PER_S)
    return Duration(sec=seconds, nanosec=nanoseconds)


def _build(msg: JointTrajectoryMsg, names: tuple[str, ...], times_ns: IntArray) -> JointTrajectory:
    positions = _column(msg, "positions", len(names))
    if positions is None:
        raise TrajectoryError(f"point 0 has 0 positions for {len(names)} joints", point=0)
    velocities = _column(msg, "velocities", len(names))
    accelerations = _column(msg, "accelerations", len(names))
    return JointTrajectory(names, times_ns, positions, velocities, accelerations)


def _time_ns(duration: Duration, k: int) -> int:
    if duration.nanosec >= NS_PER_S:
        raise TrajectoryError(
            f"point {k}: nanosec of time_from_start is {duration.nanosec}: it must be below "
            f"{NS_PER_S} ns",
            point=k,
        )
    return int(duration.sec) * NS_PER_S + int(duration.nanosec)


def _column(msg: JointTrajectoryMsg, field: str, n: int) -> FloatArray | None:
    rows = [getattr(point, field) for point in msg.points]
    if not any(len(row) for row in rows):
        return None
    for k, row in enumerate(rows):
        if len(row) != n:
            raise TrajectoryError(f"point {k} has {len(row)} {field} for {n} joints", point=k)
    return np.array(rows, dtype=np.float64)
