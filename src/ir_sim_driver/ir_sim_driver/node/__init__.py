"""The ROS side: the node around a driver, its parameters, and what turns values into messages."""

from ir_sim_driver.node.node import SimDriver, main

__all__ = ["SimDriver", "main"]
