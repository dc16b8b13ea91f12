"""`ir call`, `ir echo` and `ir list`: the syntax of ros2cli where there is no ros2cli."""

from __future__ import annotations

import argparse
import sys
import threading
import time

from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.types import interface_type
from ir_msgs_py.ros.yaml_messages import message_from_yaml, message_to_yaml

from .errors import CommandError

DISCOVERY_SECONDS = 5.0
"""Longest wait for a name to appear in the graph; discovery on one machine takes tenths of a second."""
LISTING_SECONDS = 1.0
"""Wait before a list is printed, so that discovery is complete."""
SHOWN_ELEMENTS = 128
"""Longer arrays end in "..." unless --full asks for all, as in ros2cli."""


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add call, echo and list."""
    call = commands.add_parser("call", help="call a service: call /ir_planner/get_cell '{}'")
    call.add_argument("service")
    call.add_argument("values", nargs="*", help="[type] and request as YAML, as for `ros2 service call`")
    call.add_argument("--timeout", type=float, default=60.0, help="s to wait for the answer (60)")
    call.add_argument("--full", action="store_true", help="print long arrays whole")
    call.set_defaults(run=run_call)

    echo = commands.add_parser("echo", help="print a topic's messages: echo /ir_sim_driver/power_state")
    echo.add_argument("topic")
    echo.add_argument("--once", action="store_true", help="one message, then end")
    echo.add_argument("--timeout", type=float, default=10.0, help="s to wait for the topic (10)")
    echo.add_argument("--full", action="store_true", help="print long arrays whole")
    echo.set_defaults(run=run_echo)

    listing = commands.add_parser("list", help="list services, topics or actions with their types")
    listing.add_argument("kind", nargs="?", default="services", choices=("services", "topics", "actions"))
    listing.set_defaults(run=run_list)


def run_call(arguments: argparse.Namespace) -> int:
    """Call a service and print its response; exit code 1 when its status is not a success."""
    with Client(node_name="ir_call") as client:
        name = absolute(arguments.service)
        typed, request_text = _type_and_text(arguments.values)
        service_type = interface_type(typed or _wait_for(client.graph.services, name, "service"), "srv")
        request = message_from_yaml(service_type.Request, request_text)
        response = client.call(name, request, arguments.timeout)
    sys.stdout.write(message_to_yaml(response, None if arguments.full else SHOWN_ELEMENTS))
    status = getattr(response, "status", None)
    return 0 if status is None or status.code == status.SUCCESS else 1


def run_echo(arguments: argparse.Namespace) -> int:
    """Print messages until interrupted."""
    limit = None if arguments.full else SHOWN_ELEMENTS
    with Client(node_name="ir_echo", timeout=arguments.timeout) as client:
        name = absolute(arguments.topic)
        message_type = interface_type(_wait_for(client.graph.topics, name, "topic", arguments.timeout), "msg")
        if arguments.once:
            sys.stdout.write(message_to_yaml(client.next_message(name, message_type), limit) + "---\n")
            return 0
        client.subscribe(
            name, message_type, lambda message: sys.stdout.write(message_to_yaml(message, limit) + "---\n")
        )
        threading.Event().wait()
    return 0


def run_list(arguments: argparse.Namespace) -> int:
    """Print names and types of what is there after a moment of discovery."""
    with Client(node_name="ir_list") as client:
        time.sleep(LISTING_SECONDS)
        found = getattr(client.graph, arguments.kind)()
    for name, kind in sorted(found.items()):
        sys.stdout.write(f"{name} [{kind}]\n")
    return 0


def absolute(name: str) -> str:
    """Return the name with the leading slash that people leave out."""
    return name if name.startswith("/") else "/" + name


def _type_and_text(values: list[str]) -> tuple[str, str]:
    """`[type] [yaml]`: the type may be left out, which ros2cli does not allow."""
    if len(values) > 2:
        raise CommandError(f"{len(values)} arguments after the service: at most a type and one YAML text")
    typed = values[0] if values and "/" in values[0].split("{")[0].split(":")[0] else ""
    text = values[-1] if len(values) > bool(typed) else ""
    return typed, text


def _wait_for(look: object, name: str, kind: str, seconds: float = DISCOVERY_SECONDS) -> str:
    """Type of a name as soon as the graph shows it."""
    assert callable(look)
    deadline = time.monotonic() + seconds
    while name not in (known := look()):
        if time.monotonic() > deadline:
            shown = ", ".join(sorted(known)) or "none: do the nodes run in this ROS_DOMAIN_ID?"
            raise CommandError(f"no {kind} {name} (waited {seconds:g} s); there is: {shown}")
        time.sleep(0.02)
    found: str = known[name]
    return found
