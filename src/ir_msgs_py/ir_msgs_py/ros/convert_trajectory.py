"""JointTrajectory to and from trajectory_msgs: every fault of the message is named by point and
joint.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from builtin_interfaces.msg import Duration
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg
from trajectory_msgs.msg import JointTrajectoryPoint

from ir_msgs_py.arrays import FloatArray, IntArray
from ir_msgs_py.errors import TrajectoryError
from ir_msgs_py.ros.convert_basics import NS_PER_S, float_array, time_to_msg
from ir_msgs_py.trajectory import JointTrajectory

MAX_POINTS = 100_000


def trajectory_to_msg(
    trajectory: JointTrajectory, stamp_ns: int = 0, frame_id: str = ""
) -> JointTrajectoryMsg:
    """All points; stamp 0 means: start at once."""
    msg = JointTrajectoryMsg(joint_names=list(trajectory.joint_names))
    msg.header.stamp = time_to_msg(stamp_ns)
    msg.header.frame_id = frame_id
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
