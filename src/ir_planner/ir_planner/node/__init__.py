"""The ROS side: the node, its parameters, requests in and answers out."""

from ir_planner.node.node import main

__all__ = ["main"]
