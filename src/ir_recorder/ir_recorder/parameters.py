"""ROS parameters of the recorder node."""

from __future__ import annotations

from rclpy.node import Node

from ir_msgs_py.ros.parameters import Parameters
from ir_recorder.settings import RecorderSettings


def declared_settings(node: Node) -> RecorderSettings:
    """Declares a parameter per setting, fixed at the start, and returns their values;
    ParameterError for a bad one.
    """
    return Parameters(node, RecorderSettings).value
