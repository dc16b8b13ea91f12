"""`ir ros up`: the four nodes of a cell without a launch file, until Ctrl-C."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

from rclpy.exceptions import InvalidNamespaceException
from rclpy.validate_namespace import validate_namespace

from ir_cli.errors import CommandError
from ir_cli.ports import TCP, UDP, PortClaims, free_port
from ir_cli.ros.domain import alone, apply
from ir_cli.ros.node_parameters import given_parameters, parameters_of
from ir_cli.ros.processes import NodeProcesses, cell_nodes
from ir_description import Cell, load_cell
from ir_msgs_py.names import NODES
from ir_msgs_py.ros.network import DOMAIN, MOST_DOMAIN

Given = dict[str, dict[str, Any]]
"""Parameters of the nodes by node and name."""
LOOK_SECONDS = 0.5
"""Between two looks at the processes: a node that ended is reported within this."""


def add_up(up: argparse.ArgumentParser) -> None:
    """Arguments of `ir ros up`."""
    up.add_argument(
        "--cell", default="demo", help="a cell file, or the name of a bundled cell (demo)"
    )
    up.add_argument(
        "--namespace", default="", help="prefix of all names, one for each cell: cell_1 (none)"
    )
    up.add_argument("--domain", type=_domain, help="ROS domain id (ROS_DOMAIN_ID, else 0)")
    up.add_argument(
        "-p",
        action="append",
        default=[],
        dest="parameters",
        metavar="[NODE:]NAME:=VALUE",
        help="a parameter, of every node that has it or of one node; repeatable "
        "(docs/parameters.md)",
    )
    up.add_argument(
        "--logs", type=Path, default=Path("out/log"), help="folder of the nodes' output (out/log)"
    )
    up.set_defaults(run=run_up)


def run_up(arguments: argparse.Namespace) -> int:
    """Start the nodes and watch them; an end of one of them ends all."""
    namespace = absolute_namespace(arguments.namespace)
    parameters = given_parameters(arguments.parameters)
    cell = load_cell(arguments.cell)
    if arguments.domain is not None:
        apply({DOMAIN: str(arguments.domain)})
    with alone(namespace):
        return _run(arguments, namespace, cell, parameters)


def _run(arguments: argparse.Namespace, namespace: str, cell: Cell, parameters: Given) -> int:
    with PortClaims() as claims:
        for line in choose_ports(parameters, claims):
            sys.stdout.write(f"{line}\n")
        return _run_nodes(arguments, namespace, cell, parameters)


def _run_nodes(arguments: argparse.Namespace, namespace: str, cell: Cell, parameters: Given) -> int:
    planner, driver, runner, recorder = (parameters[name] for name in NODES)
    commands = cell_nodes(
        arguments.cell,
        namespace=namespace,
        planner=planner,
        driver=driver,
        runner=runner,
        recorder=recorder,
    )
    with NodeProcesses(arguments.logs / namespace.strip("/"), {}) as nodes:
        nodes.start(commands)
        where = f" in {namespace}" if namespace else ""
        sys.stdout.write(
            f"cell {cell.name}{where}: planner, driver, runner and recorder run; Ctrl-C ends them\n"
        )
        sys.stdout.flush()
        while True:
            nodes.check()
            time.sleep(LOOK_SECONDS)


def choose_ports(parameters: Given, claims: PortClaims) -> list[str]:
    """Put free ports where nobody gave one and the usual one is taken; lines that say so. All are
    claimed: the nodes listen only some seconds later.

    Raises CommandError for a given port that is taken.
    """
    driver = parameters["ir_sim_driver"]
    runner = parameters["ir_program_runner"]
    lines = []
    wanted = [("wake_port", UDP, "Wake-on-LAN on UDP", [driver, runner])]
    if driver.get("modbus"):
        wanted.append(("modbus_port", TCP, "Modbus on TCP", [driver]))
    for name, kind, what, takers in wanted:
        usual = parameters_of("ir_sim_driver")[name].default
        port = driver.get(name, usual)
        if not port or claims.take(port, kind):
            continue
        if name in driver:
            raise CommandError(f"{name} {port} is taken: another driver may run")
        found = free_port(kind)
        claims.take(found, kind)
        for taker in takers:
            taker[name] = found
        lines.append(f"{what} port {found}: {port} is taken")
    return lines


def absolute_namespace(namespace: str) -> str:
    """The namespace with one leading slash, "" for none. CommandError for one that ROS does not
    allow.
    """
    bare = namespace.strip("/")
    if not bare:
        return ""
    try:
        validate_namespace(f"/{bare}")
    except InvalidNamespaceException as error:
        raise CommandError(f"namespace {namespace[:100]!r}: {error}") from error
    return f"/{bare}"


def _domain(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) <= MOST_DOMAIN):
        raise argparse.ArgumentTypeError(f"{text[:60]!r} must be a whole number 0 .. {MOST_DOMAIN}")
    return int(text)
