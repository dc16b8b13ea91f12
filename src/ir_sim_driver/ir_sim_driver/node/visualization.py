"""Markers of robot and load, and the frames on tf."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Transform, TransformStamped, Vector3
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from ir_description import Capsule, FramePose
from ir_msgs_py import names
from ir_msgs_py.ros.conversions import point_to_msg, pose_to_msg, time_to_msg
from ir_sim_driver.controller import Bodies, Driver
from ir_values.arrays import FloatArray

# The robot's capsules as bodies to draw: a cylinder and two balls each, in the world.

_SHORTEST = 1e-6  # m; a cylinder of no length is no marker


class Shape(NamedTuple):
    """A capsule in the world: ends (2, 3) [m], radius and length [m], centre (3,), quaternion xyzw
    (4,) of its axis z.
    """

    ends: FloatArray
    radius: float
    length: float
    centre: FloatArray
    quaternion: FloatArray


def shapes_of(capsules: Sequence[Capsule], link_poses: FloatArray) -> list[Shape]:
    """Shapes of capsules on links that stand at link_poses (n+1, 4, 4)."""
    shapes = []
    for capsule in capsules:
        T = link_poses[capsule.link]
        ends = np.array([T[:3, :3] @ p + T[:3, 3] for p in (capsule.p0, capsule.p1)])
        axis = ends[1] - ends[0]
        length = float(np.linalg.norm(axis))
        shapes.append(
            Shape(
                ends,
                float(capsule.radius),
                max(length, _SHORTEST),
                ends.mean(axis=0),
                turn_z_to(axis, length),
            )
        )
    return shapes


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


# Robot and load as markers: each capsule a cylinder and two balls, in messages that the node
# makes.

_COLOURS = {"robot": (1.0, 0.45, 0.1), "load": (0.35, 0.4, 0.45)}  # KUKA orange, steel


def robot_markers(bodies: Bodies, stamp_ns: int, make: Callable[[], Any]) -> list[Any]:
    """Markers of robot and load; make: a new visualization_msgs/Marker."""
    parts: tuple[tuple[str, Sequence[Capsule]], ...] = (
        ("robot", bodies.robot),
        ("load", bodies.load),
    )
    return [
        marker
        for name, capsules in parts
        for k, shape in enumerate(shapes_of(capsules, bodies.link_poses))
        for marker in _markers_of(shape, name, k, stamp_ns, make)
    ]


def _markers_of(
    shape: Shape, name: str, k: int, stamp_ns: int, make: Callable[[], Any]
) -> tuple[Any, Any]:
    """A cylinder with round ends."""
    body = make()
    balls = make()
    body.type = body.CYLINDER
    body.id = 2 * k
    body.pose.position = point_to_msg(shape.centre)
    turned = body.pose.orientation
    turned.x, turned.y, turned.z, turned.w = shape.quaternion.tolist()
    _scale(body, shape.radius, shape.length)
    balls.type = balls.SPHERE_LIST
    balls.id = 2 * k + 1
    balls.points = [point_to_msg(end) for end in shape.ends]
    _scale(balls, shape.radius, 2.0 * shape.radius)
    for marker in (body, balls):
        marker.header.frame_id = names.WORLD_FRAME
        marker.header.stamp = time_to_msg(stamp_ns)
        marker.ns = name
        marker.action = marker.ADD
        marker.color.r, marker.color.g, marker.color.b = _COLOURS[name]
        marker.color.a = 1.0
    return body, balls


def _scale(marker: Any, radius: float, height: float) -> None:
    marker.scale.x = marker.scale.y = 2.0 * radius
    marker.scale.z = height


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
