"""Services, topics and actions of the ROS graph, in the syntax of ros2cli.

A name is looked up as soon as discovery shows it; an unknown one is answered with the nearest.
"""

from __future__ import annotations

import argparse
import math
import os
import re
import sys
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from action_msgs.srv import CancelGoal

from ir_cli.errors import CommandError, nearest, unknown_name
from ir_cli.output import SHOWN_ELEMENTS
from ir_cli.ros.domain import claimed
from ir_msgs_py import names
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.messages import interface_type, message_from_yaml, message_to_yaml
from ir_msgs_py.ros.network import DOMAIN

DISCOVERY_SECONDS = 10.0
"""Longest wait for a graph to grow; discovery takes tenths of a second, on a busy machine
seconds.
"""
START_SECONDS = 60.0
"""The same for offers of this project's nodes, while `ir ros up` starts or runs them here."""
SETTLED_SECONDS = 1.0
"""A graph that has not grown for this long, nor for as long as it took so far, is complete: a name
that is near a known one is a typo then, unless a node of this project has it as soon as it runs.
"""
POLL_SECONDS = 0.02
SEEN_SECONDS = 0.2
"""What counts of the time between two looks: more is a process that was held up, and saw
nothing.
"""
_OF_NODES = tuple(
    f"/{name}"
    for name in vars(names).values()
    if isinstance(name, str) and re.fullmatch(r"\w+/\w+", name)
)
"""Ends of what this project's nodes offer in any namespace."""


class _Watch:
    """A graph that is looked at again and again; watched, grown [s]: how long, and when it changed
    last. Time counts in which this process could see that.
    """

    def __init__(self, look: Callable[[], Mapping[str, str]]) -> None:
        self._look = look
        self._looked = time.monotonic()
        self.known = dict(look())
        self.watched = 0.0
        self.grown = 0.0

    def again(self) -> None:
        """Look after a moment."""
        time.sleep(POLL_SECONDS)
        now = time.monotonic()
        self.watched += min(now - self._looked, SEEN_SECONDS)
        self._looked = now
        found = dict(self._look())
        if found != self.known:
            self.known = found
            self.grown = self.watched

    @property
    def still(self) -> float:
        """How long it has not changed [s]."""
        return self.watched - self.grown

    @property
    def complete(self) -> bool:
        """Whether it will show no more."""
        return self.still > max(SETTLED_SECONDS, self.grown)


def absolute(name: str) -> str:
    """Return the name with the leading slash that people leave out."""
    return name if name.startswith("/") else "/" + name


def type_of(
    look: Callable[[], Mapping[str, str]], name: str, kind: str, seconds: float | None = None
) -> str:
    """Type of a name as soon as the graph shows it; `kind`: "service", "topic" or "action".
    seconds: longest wait for a graph that does not grow; None: as long as nodes may take.
    """
    own = name.endswith(_OF_NODES)
    graph = _Watch(look)
    while name not in graph.known:
        typo = not own and graph.complete and bool(nearest(name, graph.known))
        if typo or graph.still > (DISCOVERY_SECONDS if seconds is None else seconds):
            starting = (
                not typo and seconds is None and graph.still <= START_SECONDS and _is_starting(name)
            )
            if not starting:
                raise CommandError(_missing(name, kind, graph.known))
        graph.again()
    return graph.known[name]


def settled(look: Callable[[], Mapping[str, str]]) -> dict[str, str]:
    """Names with their types once the graph has not grown for a moment, or changes without end."""
    graph = _Watch(look)
    while not graph.complete and graph.watched < DISCOVERY_SECONDS:
        graph.again()
    return graph.known


def _is_starting(name: str) -> bool:
    """Whether a process of this host has started, and watches, the nodes that have this name."""
    namespace = next((name.removesuffix(end) for end in _OF_NODES if name.endswith(end)), None)
    return namespace is not None and claimed(os.environ.get(DOMAIN, ""), namespace)


def checked_type(typed: str, found: str, name: str, kind: str) -> str:
    """The type that was typed, where it is that of the name; CommandError at once where it is
    another.
    """
    short = "/".join(part for k, part in enumerate(found.split("/")) if k != 1)
    if typed and typed not in (found, short):
        raise CommandError(f"{kind} {name} has the type {found}, not {typed[:80]}")
    return found


def _missing(name: str, kind: str, known: Mapping[str, str]) -> str:
    if known:
        return unknown_name(kind, name, known, f"ir ros list {kind}s")
    domain = os.environ.get("ROS_DOMAIN_ID", "")
    where = f"ROS_DOMAIN_ID is {domain}" if domain else "ROS_DOMAIN_ID is not set, which means 0"
    return f"no {kind} {name}, and no other either: do the nodes run, and in this domain? {where}"


def type_and_text(values: list[str], kind: str) -> tuple[str, str]:
    """`[type] [yaml]`: the type may be left out, which ros2cli does not allow."""
    if len(values) > 2:
        raise CommandError(
            f"{len(values)} arguments after the {kind}: at most a type and one YAML text"
        )
    typed = values[0] if values and "/" in values[0].split("{")[0].split(":")[0] else ""
    text = values[-1] if len(values) > bool(typed) else ""
    return typed, text


def add_call(call: argparse.ArgumentParser) -> None:
    """Arguments of `ir ros call`."""
    call.add_argument("service")
    call.add_argument(
        "values", nargs="*", help="[type] and request as YAML, as for `ros2 service call`"
    )
    call.add_argument("--timeout", type=float, default=600.0, help="s to wait for the answer (600)")
    call.add_argument("--full", action="store_true", help="print long arrays whole")
    call.set_defaults(run=run_call)


def add_echo(echo: argparse.ArgumentParser) -> None:
    """Arguments of `ir ros echo`."""
    echo.add_argument("topic")
    echo.add_argument("--once", action="store_true", help="one message, then end")
    words = "s to wait for the topic (10, longer while `ir ros up` starts its node)"
    echo.add_argument("--timeout", type=float, help=words)
    echo.add_argument("--full", action="store_true", help="print long arrays whole")
    echo.set_defaults(run=run_echo)


def add_list(listing: argparse.ArgumentParser) -> None:
    """Arguments of `ir ros list`."""
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


def add_send_goal(send: argparse.ArgumentParser) -> None:
    """Arguments of `ir ros send_goal`."""
    send.add_argument("action")
    send.add_argument(
        "values", nargs="*", help="[type] and goal as YAML, as for `ros2 action send_goal`"
    )
    send.add_argument("--feedback", action="store_true", help="print the feedback")
    send.add_argument(
        "--timeout", type=float, default=math.inf, help="s to wait for the result (no end)"
    )
    send.add_argument("--full", action="store_true", help="print long arrays whole")
    send.set_defaults(run=run_send_goal)


def add_cancel(cancel: argparse.ArgumentParser) -> None:
    """Arguments of `ir ros cancel`."""
    cancel.add_argument("action")
    cancel.set_defaults(run=run_cancel)


def run_send_goal(arguments: argparse.Namespace) -> int:
    """Send a goal, wait, print its result; exit code 1 when it was no success."""
    limit = None if arguments.full else SHOWN_ELEMENTS
    with Client(node_name="ir_send_goal") as client:
        name = absolute(arguments.action)
        typed, text = type_and_text(arguments.values, "action")
        found = type_of(client.graph.actions, name, "action")
        action_type = interface_type(checked_type(typed, found, name, "action"), "action")
        goal = message_from_yaml(action_type.Goal, text)

        def show(message: Any) -> None:
            sys.stdout.write(message_to_yaml(message, limit) + "---\n")
            sys.stdout.flush()

        result = client.send_goal(
            name, goal, show if arguments.feedback else None, arguments.timeout
        )
    sys.stdout.write(message_to_yaml(result, limit))
    return 0 if _has_succeeded(result) else 1


def run_cancel(arguments: argparse.Namespace) -> int:
    """Cancel every goal of an action; exit code 1 when there was none."""
    with Client(node_name="ir_cancel") as client:
        name = absolute(arguments.action)
        type_of(client.graph.actions, name, "action")
        answer = client.call(f"{name}/_action/cancel_goal", CancelGoal.Request())
    count = len(answer.goals_canceling)
    if not count:
        raise CommandError(f"{name} has no goal to cancel")
    sys.stdout.write(f"{count} {'goal' if count == 1 else 'goals'} of {name} will end\n")
    return 0


def _has_succeeded(result: Any) -> bool:
    """By the status or the error code of the result, where it has one."""
    status = getattr(result, "status", None)
    if status is not None:
        return bool(status.code == status.SUCCESS)
    return not getattr(result, "error_code", 0)
