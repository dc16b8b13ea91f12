"""`ir send_goal` and `ir cancel`: actions in the syntax of ros2cli where there is no ros2cli."""

from __future__ import annotations

import argparse
import math
import sys
from typing import Any

from action_msgs.srv import CancelGoal

from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.messages import interface_type, message_from_yaml, message_to_yaml

from .errors import CommandError
from .lookup import absolute, checked_type, type_of
from .terminal import SHOWN_ELEMENTS
from .words import type_and_text


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add send_goal and cancel."""
    send = commands.add_parser(
        "send_goal", help="send a goal: send_goal /ir_planner/plan '{}'; Ctrl-C cancels"
    )
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

    cancel = commands.add_parser(
        "cancel", help="cancel all goals of an action: cancel /ir_planner/plan"
    )
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
    return 0 if _succeeded(result) else 1


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


def _succeeded(result: Any) -> bool:
    """By the status or the error code of the result, where it has one."""
    status = getattr(result, "status", None)
    if status is not None:
        return bool(status.code == status.SUCCESS)
    return not getattr(result, "error_code", 0)
