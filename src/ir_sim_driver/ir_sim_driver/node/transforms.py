"""The frames of cell, robot and load on tf and tf_static, where tf2_msgs is installed.

The names are relative: in a namespace the transforms of a cell stay with it, because frames of two
cells are called the same.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Transform, TransformStamped, Vector3
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from ir_description import FramePose
from ir_msgs_py import names
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.ros.conversions import pose_to_msg, time_to_msg
from ir_sim_driver.controller import Driver

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
