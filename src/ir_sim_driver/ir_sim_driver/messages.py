"""Values of the driver as messages, and goals from messages. Knows message types, not rclpy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from ir_msgs.msg import ControllerState
from ir_msgs_py.errors import JointNamesError, TrajectoryError
from ir_msgs_py.names import WORLD_FRAME
from ir_msgs_py.ros.conversions import (
    duration_to_msg,
    float_array,
    time_from_msg,
    time_to_msg,
    trajectory_from_msg,
)
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA
from trajectory_msgs.msg import JointTrajectoryPoint
from visualization_msgs.msg import Marker, MarkerArray

from ir_sim_driver.arrays import Array
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.executor import Following
from ir_sim_driver.goal import ErrorCode, JointTolerance, TrajectoryGoal

_NS = 1e-9
_ROBOT = ColorRGBA(r=1.0, g=0.45, b=0.1, a=1.0)
_LOAD = ColorRGBA(r=0.35, g=0.4, b=0.45, a=1.0)


def goal_from_trajectory(msg: Any, max_points: int) -> TrajectoryGoal:
    """Goal of a trajectory_msgs/JointTrajectory. Raises TrajectoryRefusedError."""
    try:
        trajectory = trajectory_from_msg(msg, max_points=max_points)
    except JointNamesError as error:
        raise TrajectoryRefusedError(ErrorCode.INVALID_JOINTS, str(error)) from error
    except TrajectoryError as error:
        raise TrajectoryRefusedError(ErrorCode.INVALID_GOAL, str(error)) from error
    return TrajectoryGoal(trajectory, time_from_msg(msg.header.stamp))


def goal_from_action(goal: Any, max_points: int) -> TrajectoryGoal:
    """Goal of ExecuteTrajectory or FollowJointTrajectory. Raises TrajectoryRefusedError."""
    multi_dof = goal.multi_dof_trajectory
    if multi_dof.points or multi_dof.joint_names:
        raise TrajectoryRefusedError(
            ErrorCode.INVALID_GOAL,
            f"multi_dof_trajectory has {len(multi_dof.points)} points: it must be empty, the robot "
            "has joints only",
        )
    plain = goal_from_trajectory(goal.trajectory, max_points)
    wait = goal.goal_time_tolerance
    return TrajectoryGoal(
        plain.trajectory,
        plain.stamp_ns,
        _tolerances(goal.path_tolerance),
        _tolerances(goal.goal_tolerance),
        wait.sec + wait.nanosec * _NS,
        label=str(getattr(goal, "trajectory_id", "")),
    )


def fill_joint_state(msg: JointState, stamp_ns: int, q: Array, qd: Array, torque: Array) -> None:
    """Write a state into a message that is used again and again."""
    msg.header.stamp.sec, msg.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
    msg.position = float_array(q)
    msg.velocity = float_array(qd)
    msg.effort = float_array(torque)


def controller_state(names: Sequence[str], stamp_ns: int, following: Following) -> ControllerState:
    """Command, robot and their difference."""
    reference, feedback, error = points_of(following)
    msg = ControllerState(
        joint_names=list(names),
        reference=reference,
        feedback=feedback,
        error=error,
        trajectory_id=following.label,
        path_time=following.path_time,
        speed_scaling=following.path_speed,
        tool_deviation=following.deviation,
    )
    msg.header.stamp = time_to_msg(stamp_ns)
    return msg


def points_of(following: Following) -> tuple[Any, Any, Any]:
    """Desired, actual and error as trajectory points."""
    command = following.command
    at = duration_to_msg(max(0, round(following.path_time / _NS)))
    desired = JointTrajectoryPoint(
        positions=float_array(command.q),
        velocities=float_array(command.qd),
        accelerations=float_array(command.qdd),
        time_from_start=at,
    )
    actual = JointTrajectoryPoint(
        positions=float_array(following.q), velocities=float_array(following.qd), time_from_start=at
    )
    error = JointTrajectoryPoint(
        positions=float_array(command.q - following.q),
        velocities=float_array(command.qd - following.qd),
        time_from_start=at,
    )
    return desired, actual, error


def status(name: str, level: int, sentence: str, values: dict[str, object]) -> DiagnosticStatus:
    """One entry of /diagnostics."""
    return DiagnosticStatus(
        name=name,
        level=bytes([level]),
        message=sentence,
        hardware_id="KR210 R2700 extra, simulated",
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )


def robot_markers(
    capsules: Sequence[Any], is_load: Sequence[bool], poses: Array, stamp_ns: int
) -> MarkerArray:
    """Capsules of robot and load as cylinders with round ends; poses (n+1, 4, 4) of the links in the
    world.
    """
    stamp = time_to_msg(stamp_ns)
    markers = []
    for k, (capsule, load) in enumerate(zip(capsules, is_load, strict=True)):
        T = poses[capsule.link]
        ends = [T[:3, :3] @ p + T[:3, 3] for p in (capsule.p0, capsule.p1)]
        d = 2.0 * float(capsule.radius)
        colour = _LOAD if load else _ROBOT
        length = float(np.linalg.norm(ends[1] - ends[0]))
        body = Marker(type=Marker.CYLINDER, scale=Vector3(x=d, y=d, z=max(length, 1e-6)))
        body.pose = Pose(
            position=_point(0.5 * (ends[0] + ends[1])), orientation=_turn_z_to(ends[1] - ends[0])
        )
        balls = Marker(
            type=Marker.SPHERE_LIST, scale=Vector3(x=d, y=d, z=d), points=[_point(p) for p in ends]
        )
        for number, (space, marker) in enumerate((("bodies", body), ("ends", balls))):
            marker.header.frame_id = WORLD_FRAME
            marker.header.stamp = stamp
            marker.ns, marker.id = f"robot_{space}", 2 * k + number
            marker.action, marker.color = Marker.ADD, colour
            markers.append(marker)
    return MarkerArray(markers=markers)


def _tolerances(given: Sequence[Any]) -> tuple[JointTolerance, ...]:
    return tuple(JointTolerance(str(t.name), t.position, t.velocity, t.acceleration) for t in given)


def _point(p: Array) -> Point:
    return Point(x=float(p[0]), y=float(p[1]), z=float(p[2]))


def _turn_z_to(direction: Array) -> Quaternion:
    """Shortest turn of +z into a direction (3,)."""
    length = float(np.linalg.norm(direction))
    if length < 1e-9:
        return Quaternion(w=1.0)
    x, y, z = (direction / length).tolist()
    if z < -1.0 + 1e-9:
        return Quaternion(x=1.0, w=0.0)
    w = 1.0 + z
    norm = float(np.sqrt(w * w + x * x + y * y))
    return Quaternion(x=-y / norm, y=x / norm, z=0.0, w=w / norm)
