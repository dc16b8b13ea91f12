"""What clients of ROS' joint trajectory controller ask beside its action, where control_msgs is
installed: the state at a time, the controller's state as a topic, the speed as a factor.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile

from ir_msgs_py import names
from ir_msgs_py.names import own
from ir_msgs_py.ros.conversions import float_array, time_from_msg, time_to_msg
from ir_msgs_py.ros.serving import BoundedService
from ir_msgs_py.status import Status
from ir_sim_driver.controller import Driver
from ir_sim_driver.motion import Following
from ir_sim_driver.node.messages import fill_points
from ir_sim_driver.node.services import known_status
from ir_values.errors import one_line

_PACKAGE = "control_msgs"


def control_type(kind: str, name: str) -> Any:
    """A type of control_msgs, such as `control_type("action", "FollowJointTrajectory")`; None where
    none is installed, or an older one without it.
    """
    try:
        return getattr(import_module(f"{_PACKAGE}.{kind}"), name, None)
    except ImportError:
        return None


class StateQueries:
    """`~/query_state`: the commanded state at a time, of `driver`."""

    def __init__(self, driver: Driver) -> None:
        self._driver = driver

    def offer(self, node: Node) -> None:
        """Serve it on a node, where its type is installed."""
        kind = control_type("srv", "QueryTrajectoryState")
        if kind is not None:
            BoundedService(node, kind, own(names.QUERY_STATE), self.answer, put=put_refusal)

    def answer(self, request: Any, response: Any) -> Any:
        """What the controller commands at the time of the request."""
        try:
            motion = self._driver.commanded_at(time_from_msg(request.time))
        except Exception as error:
            status = known_status(error)
            if status is None:
                raise
            put_refusal(response, status)
            return response
        response.success = True
        response.name = list(self._driver.joint_names)
        response.position = float_array(motion.q)
        response.velocity = float_array(motion.qd)
        response.acceleration = float_array(motion.qdd)
        return response


def put_refusal(response: Any, status: Status) -> None:
    """A status as control_msgs has it: no success, and a sentence."""
    response.success = False
    response.message = one_line(str(status))


class ControllerStates:
    """Publishes the controller's state as control_msgs has it, while somebody listens."""

    def __init__(self, node: Node, joint_names: Sequence[str], quality: QoSProfile) -> None:
        self._names = list(joint_names)
        self._type = control_type("msg", "JointTrajectoryControllerState")
        self._publisher = None
        if self._type is not None:
            self._publisher = node.create_publisher(
                self._type, own(names.TRAJECTORY_CONTROLLER_STATE), quality
            )

    def publish(self, stamp_ns: int, following: Following) -> None:
        """Publish command, robot and their difference."""
        if self._publisher is None or not self._publisher.get_subscription_count():
            return
        msg = self._type(joint_names=self._names)
        msg.header.stamp = time_to_msg(stamp_ns)
        fill_points(msg.reference, msg.feedback, msg.error, following)
        msg.speed_scaling_factor = following.path_speed
        self._publisher.publish(msg)


def hear_speed_factor(node: Node, driver: Driver) -> None:
    """Scale the speed by what comes on `~/speed_scaling_input`, where its type is installed."""
    kind = control_type("msg", "SpeedScalingFactor")
    if kind is not None:
        node.create_subscription(
            kind,
            own(names.SPEED_SCALING_INPUT),
            lambda msg: driver.set_speed_scaling(float(msg.factor)),
            10,
        )
