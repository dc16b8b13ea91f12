"""The environment that nodes run in: only this machine, discovered fast."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping

from ir_msgs_py.ros.network import network_variables

DEMONSTRATION_DOMAINS = range(1, 101)
"""ROS domain ids whose ports stay, for all participants, below the ephemeral ports of Linux."""


def ros_defaults() -> dict[str, str]:
    """Variables for nodes on this machine; raises ParameterError for an IR_NETWORK that is not
    known.
    """
    variables, _ = network_variables(os.environ)
    if "AMENT_PREFIX_PATH" not in os.environ:
        variables["AMENT_PREFIX_PATH"] = sys.prefix
    return variables


def apply(variables: Mapping[str, str]) -> None:
    """Put the variables into this process before rclpy reads them."""
    os.environ.update(variables)


def own_domain() -> dict[str, str]:
    """Return a ROS domain of this process's own, unless the user chose one."""
    if "ROS_DOMAIN_ID" in os.environ:
        return {}
    return {"ROS_DOMAIN_ID": str(DEMONSTRATION_DOMAINS[os.getpid() % len(DEMONSTRATION_DOMAINS)])}
