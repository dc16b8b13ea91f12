"""Markers of robot and load, and the frames on tf."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Transform, TransformStamped, Vector3
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from ir_description.robot import FramePose
from ir_description.shapes import Capsule
from ir_msgs_py import names
from ir_msgs_py.ros.conversions import pose_to_msg, time_to_msg
from ir_sim_driver.controller import Driver
from ir_values.arrays import FloatArray
from ir_values.rotations import quaternions_from_rotations, rotations_from_quaternions

# Robot and load as markers: each capsule a cylinder and two balls, in the world.

_SHORTEST = 1e-6  # m; a cylinder of no length is no marker
_COLOURS = {"robot": (1.0, 0.45, 0.1), "load": (0.35, 0.4, 0.45)}  # KUKA orange, steel


class RobotMarkers:
    """Markers of the capsules of robot and load, made once: 20 times a second they only move.

    loads: capsules of the largest load that was shown; those that are no longer there are deleted
    in every message, as a view that missed one would keep them.
    """

    def __init__(self, robot: Sequence[Capsule], load: Sequence[Capsule], loads: int = 0) -> None:
        capsules = (*robot, *load)
        axes = np.array([capsule.p1 - capsule.p0 for capsule in capsules]).reshape(-1, 3)
        lengths = np.linalg.norm(axes, axis=1)
        turns = [turn_z_to(*axis) for axis in zip(axes, lengths.tolist(), strict=True)]
        ends = [(capsule.p0, capsule.p1) for capsule in capsules]
        self._links = [capsule.link for capsule in capsules]
        self._ends = np.array(ends).reshape(-1, 2, 3)
        self._turns = rotations_from_quaternions(np.array(turns)) if turns else None
        self._pairs = [_pair("robot", k, capsule) for k, capsule in enumerate(robot)]
        self._pairs += [_pair("load", k, capsule) for k, capsule in enumerate(load)]
        # markers of an earlier load with more capsules would stay
        self.loads = max(len(load), loads)
        gone = range(2 * len(load), 2 * self.loads)
        deleted = [Marker(ns="load", id=k, action=Marker.DELETE) for k in gone]
        shown = [each for pair in self._pairs for each in pair]
        self._message = MarkerArray(markers=[*shown, *deleted])

    def at(self, link_poses: FloatArray, stamp: Time) -> MarkerArray:
        """All markers where the links stand (n+1, 4, 4); the same message in every call."""
        if self._turns is None:
            return self._message
        poses = link_poses[self._links]
        ends = np.einsum("kij,kej->kei", poses[:, :3, :3], self._ends) + poses[:, None, :3, 3]
        turned = quaternions_from_rotations(poses[:, :3, :3] @ self._turns)
        places = zip(self._pairs, ends.mean(axis=1), turned, ends, strict=True)
        for (cylinder, balls), centre, quaternion, both in places:
            cylinder.header.stamp = stamp
            balls.header.stamp = stamp
            place = cylinder.pose.position
            place.x, place.y, place.z = centre.tolist()
            turn = cylinder.pose.orientation
            turn.x, turn.y, turn.z, turn.w = quaternion.tolist()
            for ball, end in zip(balls.points, both.tolist(), strict=True):
                ball.x, ball.y, ball.z = end
        return self._message


def turn_z_to(direction: FloatArray, length: float) -> FloatArray:
    """Quaternion xyzw (4,) of the shortest turn of +z into a direction (3,) of that length."""
    if length < _SHORTEST:
        return np.array((0.0, 0.0, 0.0, 1.0))
    x, y, z = (direction / length).tolist()
    if z < -1.0 + 1e-9:
        return np.array((1.0, 0.0, 0.0, 0.0))
    quaternion = np.array((-y, x, 0.0, 1.0 + z))
    unit: FloatArray = quaternion / np.linalg.norm(quaternion)
    return unit


def _pair(name: str, k: int, capsule: Capsule) -> tuple[Marker, Marker]:
    """A cylinder and its round ends, of size and colour."""
    cylinder = Marker(type=Marker.CYLINDER, id=2 * k)
    balls = Marker(type=Marker.SPHERE_LIST, id=2 * k + 1, points=[Point(), Point()])
    across = 2.0 * float(capsule.radius)
    length = max(float(np.linalg.norm(capsule.p1 - capsule.p0)), _SHORTEST)
    cylinder.scale = Vector3(x=across, y=across, z=length)
    balls.scale = Vector3(x=across, y=across, z=across)
    red, green, blue = _COLOURS[name]
    for marker in (cylinder, balls):
        marker.header.frame_id = names.WORLD_FRAME
        marker.ns = name
        marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
    return cylinder, balls


# The frames of cell, robot and load on tf and tf_static, where tf2_msgs is installed.
#
# The names are relative: in a namespace the transforms of a cell stay with it, because frames of
# two cells are called the same.

try:  # part of every ROS installation from apt; there is no wheel
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None


class Transforms:
    """Publishes the frames of `driver`; message_type: tf2_msgs/TFMessage."""

    def __init__(self, node: Node, driver: Driver, message_type: Any = TFMessage) -> None:
        self._driver = driver
        self._type = message_type
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._moving = node.create_publisher(message_type, names.TF, 100)
        self._fixed = node.create_publisher(message_type, names.TF_STATIC, latched)

    def publish_fixed(self, now: Time) -> None:
        """Publish what no joint moves, also after the load has changed."""
        self._fixed.publish(
            self._type(transforms=transforms_to_msg(self._driver.fixed_frames(), now))
        )

    def publish_moving(self, q: FloatArray, stamp_ns: int) -> None:
        """Publish where the joints hold the links at q (n,) [rad]."""
        frames = transforms_to_msg(self._driver.moving_frames(q), time_to_msg(stamp_ns))
        self._moving.publish(self._type(transforms=frames))


def open_transforms(node: Node, driver: Driver, wanted: bool) -> Transforms | None:
    """The publisher, where it is wanted and tf2_msgs is installed."""
    return Transforms(node, driver) if wanted and TFMessage is not None else None


def transforms_to_msg(frames: Iterable[FramePose], stamp: Time) -> list[TransformStamped]:
    """Transforms of frames in their parents."""
    return [_transform(frame, stamp) for frame in frames]


def _transform(frame: FramePose, stamp: Time) -> TransformStamped:
    pose = pose_to_msg(frame.pose)
    place = Vector3(x=pose.position.x, y=pose.position.y, z=pose.position.z)
    message = TransformStamped(
        child_frame_id=frame.name, transform=Transform(translation=place, rotation=pose.orientation)
    )
    message.header.frame_id = frame.parent
    message.header.stamp = stamp
    return message
