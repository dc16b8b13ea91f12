"""`ir ros up`: the four nodes of a cell without a launch file, until Ctrl-C."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import yaml
from rclpy.exceptions import InvalidNamespaceException
from rclpy.validate_namespace import validate_namespace

from ir_cli.errors import CommandError, unknown_name
from ir_cli.ports import TCP, UDP, PortClaims, free_port
from ir_cli.ros.domain import alone, apply
from ir_cli.ros.processes import NodeProcesses, cell_nodes
from ir_description import Cell, load_cell
from ir_msgs_py.modes import PREFIX, TransitionTimes
from ir_msgs_py.names import NODES
from ir_msgs_py.ros.network import DOMAIN, MOST_DOMAIN
from ir_msgs_py.ros.parameters import IntrospectionSettings
from ir_planner import PlannerSettings
from ir_planner.node.moveit_requests import MoveItSettings
from ir_program_runner import ProgramSettings
from ir_program_runner.settings import LinkSettings
from ir_recorder.recording.settings import RecorderSettings
from ir_sim_driver import ExecutionSettings
from ir_sim_driver.controller import ControllerSettings, SupervisionSettings
from ir_sim_driver.load_check import LoadCheckSettings
from ir_sim_driver.node.parameters import NodeSettings
from ir_sim_driver.plant import ControlSettings
from ir_sim_driver.plc import PlcSettings, usable_links
from ir_sim_driver.power import IdleTimes
from ir_studies.settings import StudiesSettings
from ir_values.errors import InvalidValueError
from ir_values.settings import Setting, tree

# Parameters of the nodes: their settings classes, and values that a person typed.
#
# `-p name:=value` or `-p node:name:=value`. A node would ignore an unknown name, and end because
# of 5 where it wants 5.0; here both are refused.

FIXED = "fixed: "  # the node takes these at its start only
NODE_SETTINGS: dict[str, tuple[tuple[str, Callable[[], Any]], ...]] = {
    "ir_planner": (("", PlannerSettings),),
    "ir_sim_driver": (
        ("", NodeSettings),
        ("", ControllerSettings),
        *(("", link) for link in usable_links()),
        ("control.", ControlSettings),
        ("execution.", ExecutionSettings),
        ("supervision.", SupervisionSettings),
        (f"{FIXED}{PREFIX}", TransitionTimes),
        (PREFIX, IdleTimes),
        ("plc.", PlcSettings),
        ("load_check.", LoadCheckSettings),
    ),
    "ir_program_runner": (("", ProgramSettings), (PREFIX, TransitionTimes), ("", LinkSettings)),
    "ir_recorder": (("", RecorderSettings),),
    "ir_studies": (("", StudiesSettings),),
    "ir_moveit": (("", MoveItSettings),),
}
for _node in NODE_SETTINGS:
    NODE_SETTINGS[_node] += (("", IntrospectionSettings),)


def parameters_of(node: str) -> dict[str, Setting]:
    """Every parameter of a node by its full name."""
    return {
        f"{prefix.removeprefix(FIXED)}{name}": each
        for prefix, make in NODE_SETTINGS[node]
        for name, each in tree(make()).items()
    }


_KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}


def given_parameters(texts: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Values by node and name; a name without a node goes to every node that has it.
    CommandError.
    """
    known = {node: parameters_of(node) for node in NODES}
    values: dict[str, dict[str, Any]] = {node: {} for node in NODES}
    for text in texts:
        left, separator, right = text.partition(":=")
        if not separator:
            raise CommandError(f"-p {text[:200]!r}: write name:=value, or node:name:=value")
        node, _, name = left.rpartition(":")
        if node and node not in known:
            raise CommandError(unknown_name("node", node[:200], known, "ir ros list"))
        takers = [each for each in ([node] if node else known) if name in known[each]]
        if not takers:
            names = {each for taker in ([node] if node else known) for each in known[taker]}
            raise CommandError(unknown_name("parameter", name[:200], names, "docs/parameters.md"))
        for taker in takers:
            values[taker][name] = _value(known[taker][name], right)
    return values


def _value(setting: Setting, text: str) -> Any:
    """The value of a YAML text, of the setting's type and within its range."""
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise CommandError(f"{setting.name}: {text[:200]!r} is no YAML") from error
    if setting.type is float:
        value = _number(text, value)
    if setting.type is str and not isinstance(value, str):
        value = text
    if setting.type in _KINDS and type(value) is not setting.type:
        raise CommandError(f"{setting.name} is {text[:200]!r}: it must be {_KINDS[setting.type]}")
    if setting.type not in _KINDS:
        value = _elements(setting, text, value)
    try:
        setting.check(tuple(value) if isinstance(value, list) else value)
    except InvalidValueError as error:
        raise CommandError(str(error)) from error
    return value


def _number(text: str, value: Any) -> Any:
    """A float where the text is one: YAML takes 5 for an integer and 1e-8 for a text."""
    try:
        return value if isinstance(value, bool) else float(text)
    except ValueError:
        return value


def _elements(setting: Setting, text: str, value: Any) -> list[Any]:
    """The value of a setting that is a list of numbers or of texts."""
    numbers = setting.type == tuple[float, ...]
    kinds = (int, float) if numbers else (str,)
    if not isinstance(value, list) or any(type(element) not in kinds for element in value):
        what = "numbers" if numbers else "texts"
        raise CommandError(f"{setting.name} is {text[:200]!r}: it must be a list of {what}, [a, b]")
    return [float(element) for element in value] if numbers else value


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
    wanted = []
    if driver.get("wake_on_lan", True):
        wanted.append(("wake_port", UDP, "Wake-on-LAN on UDP", [driver, runner]))
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
