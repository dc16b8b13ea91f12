"""A setting that several nodes share has one name, with one default and one range."""

from __future__ import annotations

from rclpy.node import Node

from ir_msgs_py.modes import PREFIX, TransitionTimes
from ir_program_runner.node import declare_parameters
from ir_values.settings import describe


def test_the_runner_has_them_as_parameters_under_these_names(ros_node: Node) -> None:
    parameters = declare_parameters(ros_node, lambda: False)
    names = [PREFIX + each.name for each in describe(TransitionTimes)]
    assert all(ros_node.has_parameter(name) for name in names)
    assert parameters.transitions.value == TransitionTimes()
    assert ros_node.get_parameter("transitions.bus_power_off_minimum_stay").value == 2.0
