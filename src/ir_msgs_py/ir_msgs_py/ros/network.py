"""Reach of the nodes in a network: this host alone, unless another choice was made.

IR_NETWORK chooses, whatever starts the node:

    loopback   (or unset) this host only: discovery and transport are bound to 127.0.0.1
    secure     as ROS's own variables say, with DDS security enforced (ROS_SECURITY_ENABLE=true and
               ROS_SECURITY_STRATEGY=Enforce); a build without security then refuses to start
    insecure   as ROS's own variables say: whoever reaches the network can command the robot

The variables are read by the middleware when a context starts, so `apply_network` comes before
`rclpy.init`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, MutableMapping
from importlib.resources import files

from ir_values.errors import InvalidValueError

VARIABLE = "IR_NETWORK"
CHOICES = ("loopback", "secure", "insecure")
DOMAIN = "ROS_DOMAIN_ID"
MOST_DOMAIN = 232  # higher ones have no UDP ports left
RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PEERS = "ROS_STATIC_PEERS"
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
BY_PROFILE = "RMW_FASTRTPS_USE_QOS_FROM_XML"
"""Lets the profile say how messages are kept: without it the middleware keeps, for every message
that ever waited, the memory of the largest.
"""
LEASE = 10.0
"""s of silence after which the profiles let a participant be forgotten."""
_SECURITY = {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce"}
OFF = "OFF"
BY_PROFILE_ALONE = "SYSTEM_DEFAULT"
"""The range that leaves discovery to the profile: every other one adds shared memory."""
LOCALHOST = "LOCALHOST"
MIDDLEWARE = "RMW_IMPLEMENTATION"
FAST_DDS = "rmw_fastrtps"


def profile(name: str) -> str:
    """Path of a Fast DDS profile that comes with the package."""
    return str(files("ir_msgs_py") / "ros" / f"{name}.xml")


def network_variables(environment: Mapping[str, str]) -> tuple[dict[str, str], tuple[str, ...]]:
    """Variables to set for the choice in `environment`, and those to remove.

    Raises InvalidValueError for an unknown choice, for `secure` where security isn't enforced, and
    for a domain that is none.
    """
    domain = environment.get(DOMAIN, "")
    if domain and not (domain.isascii() and domain.isdigit() and int(domain) <= MOST_DOMAIN):
        raise InvalidValueError(
            f"{DOMAIN} is {domain[:60]!a}: it must be a whole number 0 .. {MOST_DOMAIN}"
        )
    choice = environment.get(VARIABLE, "") or "loopback"
    if choice not in CHOICES:
        raise InvalidValueError(f"{VARIABLE} is {choice[:60]!a}: known are {', '.join(CHOICES)}")
    if choice == "loopback":
        fast_dds = (environment.get(MIDDLEWARE) or FAST_DDS).startswith(FAST_DDS)
        here = BY_PROFILE_ALONE if fast_dds else LOCALHOST
        return {
            RANGE: OFF if _range(environment) == OFF else here,
            PROFILES: profile("loopback"),
            BY_PROFILE: "1",
        }, (PEERS,)
    missing = [
        f"{name}={value}" for name, value in _SECURITY.items() if environment.get(name) != value
    ]
    if choice == "secure" and missing:
        raise InvalidValueError(
            f"{VARIABLE} is secure: {' and '.join(missing)} must be set as well"
        )
    if environment.get(PROFILES):
        return {}, ()
    return {PROFILES: profile("fast_discovery"), BY_PROFILE: "1"}, ()


def apply_network(environment: MutableMapping[str, str] = os.environ) -> None:
    """Set the variables in this process; a line on stderr says which of the user's own are not
    followed.
    """
    wanted, removed = network_variables(environment)
    ignored = [f"{PEERS}={environment[PEERS]}" for name in removed if environment.get(name)]
    if RANGE in wanted and _range(environment) not in ("", BY_PROFILE_ALONE, LOCALHOST, OFF):
        ignored.append(f"{RANGE}={environment[RANGE]}")
    if ignored:
        sys.stderr.write(
            f"{', '.join(ignored)[:200]!a} is not followed: nodes stay on this host. "
            f"{VARIABLE}=secure or {VARIABLE}=insecure opens them.\n"
        )
    environment.update(wanted)
    for name in removed:
        environment.pop(name, None)


def _range(environment: Mapping[str, str]) -> str:
    """The range of discovery that somebody chose; "" without a choice."""
    return environment.get(RANGE, "").upper()
