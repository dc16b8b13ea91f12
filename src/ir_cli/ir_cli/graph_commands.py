"""`ir call`, `ir echo` and `ir list`: the syntax of ros2cli where there is no ros2cli."""

from __future__ import annotations

import argparse
import sys
import threading

from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.messages import interface_type, message_from_yaml, message_to_yaml

from .lookup import DISCOVERY_SECONDS, absolute, checked_type, settled, type_of
from .terminal import SHOWN_ELEMENTS
from .words import type_and_text


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add call, echo and list."""
    call = commands.add_parser("call", help="call a service: call /ir_planner/get_cell '{}'")
    call.add_argument("service")
    call.add_argument(
        "values", nargs="*", help="[type] and request as YAML, as for `ros2 service call`"
    )
    call.add_argument("--timeout", type=float, default=60.0, help="s to wait for the answer (60)")
    call.add_argument("--full", action="store_true", help="print long arrays whole")
    call.set_defaults(run=run_call)

    echo = commands.add_parser(
        "echo", help="print a topic's messages: echo /ir_sim_driver/power_state"
    )
    echo.add_argument("topic")
    echo.add_argument("--once", action="store_true", help="one message, then end")
    words = "s to wait for the topic (10, longer while `ir up` starts its node)"
    echo.add_argument("--timeout", type=float, help=words)
    echo.add_argument("--full", action="store_true", help="print long arrays whole")
    echo.set_defaults(run=run_echo)

    listing = commands.add_parser("list", help="list services, topics or actions with their types")
    listing.add_argument(
        "kind", nargs="?", default="services", choices=("services", "topics", "actions")
    )
    listing.set_defaults(run=run_list)


def run_call(arguments: argparse.Namespace) -> int:
    """Call a service and print its response; exit code 1 when its status is not a success."""
    with Client(node_name="ir_call") as client:
        name = absolute(arguments.service)
        typed, request_text = type_and_text(arguments.values, "service")
        found = type_of(client.graph.services, name, "service")
        service_type = interface_type(checked_type(typed, found, name, "service"), "srv")
        request = message_from_yaml(service_type.Request, request_text)
        response = client.call(name, request, arguments.timeout)
    sys.stdout.write(message_to_yaml(response, None if arguments.full else SHOWN_ELEMENTS))
    status = getattr(response, "status", None)
    return 0 if status is None or status.code == status.SUCCESS else 1


def run_echo(arguments: argparse.Namespace) -> int:
    """Print messages until interrupted."""
    limit = None if arguments.full else SHOWN_ELEMENTS
    patience = DISCOVERY_SECONDS if arguments.timeout is None else arguments.timeout
    with Client(node_name="ir_echo", timeout=patience) as client:
        name = absolute(arguments.topic)
        message_type = interface_type(
            type_of(client.graph.topics, name, "topic", arguments.timeout), "msg"
        )
        if arguments.once:
            sys.stdout.write(
                message_to_yaml(client.next_message(name, message_type), limit) + "---\n"
            )
            return 0
        client.subscribe(
            name,
            message_type,
            lambda message: sys.stdout.write(message_to_yaml(message, limit) + "---\n"),
        )
        threading.Event().wait()
    return 0


def run_list(arguments: argparse.Namespace) -> int:
    """Print names and types of what is there when discovery shows no more."""
    with Client(node_name="ir_list") as client:
        found = settled(getattr(client.graph, arguments.kind))
    for name, kind in sorted(found.items()):
        sys.stdout.write(f"{name} [{kind}]\n")
    return 0
