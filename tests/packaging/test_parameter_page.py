"""docs/parameters.md lists what the nodes declare: no parameter is missing, none is made up."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from rclpy.node import Node

from ir_msgs_py.ros.parameters import Parameters, introspect_services
from ir_planner import PlannerSettings
from ir_planner.checks import FreeSpace
from ir_planner.search import SEARCHES, Ends, Found
from ir_program_runner.node import declare_parameters
from ir_recorder.node.recorder import declared_settings
from ir_sim_driver.node.parameters import DriverParameters
from ir_values.settings import setting

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "parameters.md"
TOOL = ROOT / "tools" / "parameter_reference.py"
DECLARE: dict[str, Callable[[Node], object]] = {
    "ir_planner": lambda node: Parameters(node, PlannerSettings),
    "ir_sim_driver": lambda node: DriverParameters(node, lambda: "", lambda settings: None),
    "ir_program_runner": lambda node: declare_parameters(node, lambda: False),
    "ir_recorder": declared_settings,
}


@pytest.mark.parametrize("name", DECLARE)
def test_the_page_lists_what_the_node_declares(name: str, ros_node: Node) -> None:
    before = set(ros_node._parameters)
    DECLARE[name](ros_node)
    introspect_services(ros_node)
    declared = {
        each: ros_node.describe_parameter(each) for each in set(ros_node._parameters) - before
    }
    text = PAGE.read_text("utf-8")
    section = "".join(re.findall(rf"^##+ {name}\n(.*?)(?=^##|\Z)", text, re.MULTILINE | re.DOTALL))
    rows = dict(re.findall(r"^\| `([\w.]+)` \|(.*)$", section, re.MULTILINE))
    assert set(rows) == set(declared)
    fixed = {each for each, row in rows.items() if row.endswith("Fixed at start. |")}
    assert fixed == {each for each, described in declared.items() if described.read_only}


@dataclass(frozen=True)
class Guess:
    """Answers with nothing."""

    tries: int = setting(3, "How often it guesses.", minimum=1, maximum=9)

    def find(self, ends: Ends, space: FreeSpace, seed: int) -> Found:
        return Found([])


def test_a_registered_search_is_in_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SEARCHES, "guess", Guess())
    spec = importlib.util.spec_from_file_location("parameter_reference", TOOL)
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    page = tool.page()
    assert "| `guess` | Answers with nothing. |" in page
    assert "| `guess.tries` | 3 |  | 1 .. 9 | How often it guesses. |" in page
