"""Parameters of the nodes: their settings classes, and values that a person typed.

`-p name:=value` or `-p node:name:=value`. A node would ignore an unknown name, and end because of 5
where it wants 5.0; here both are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import yaml

from ir_cli.errors import CommandError, unknown_name
from ir_msgs_py.modes import PREFIX, TransitionTimes
from ir_msgs_py.names import NODES
from ir_msgs_py.ros.parameters import IntrospectionSettings
from ir_planner import PlannerSettings
from ir_planner.node.moveit_requests import MoveItSettings
from ir_program_runner import LinkSettings, ProgramSettings
from ir_recorder.recording.settings import RecorderSettings
from ir_sim_driver import (
    ControllerSettings,
    ControlSettings,
    ExecutionSettings,
    IdleTimes,
    LoadCheckSettings,
    PlcSettings,
    usable_links,
)
from ir_sim_driver.controller import SupervisionSettings
from ir_sim_driver.node.parameters import NodeSettings
from ir_studies.settings import StudiesSettings
from ir_values.errors import ParameterError
from ir_values.settings import Setting, tree

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
    except ParameterError as error:
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
