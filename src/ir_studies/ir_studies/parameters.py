"""ROS parameters of the node of studies."""

from __future__ import annotations

from rclpy.node import Node

from ir_msgs_py.ros.parameters import Parameters
from ir_studies.settings import StudiesSettings


def declared_settings(node: Node) -> StudiesSettings:
    """Declares a parameter per setting, fixed at the start, and returns their values;
    ParameterError for a bad one.
    """
    return Parameters(node, StudiesSettings).value
