"""Robot and load as markers: each capsule a cylinder and two balls, in messages that the node
makes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ir_description import Capsule
from ir_msgs_py import names
from ir_msgs_py.ros.conversions import point_to_msg, time_to_msg
from ir_sim_driver.controller import Bodies
from ir_sim_driver.node.shapes import Shape, shapes_of

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
