"""The launch package names what exists: executables, topics, parameters."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import yaml

from ir_msgs_py import names
from ir_msgs_py.settings import describe
from ir_planner.settings import PlannerSettings
from ir_program_runner.settings import LinkSettings, ProgramSettings
from ir_recorder.settings import RecorderSettings
from ir_sim_driver.controller.settings import ControllerSettings
from ir_sim_driver.motion.execution_settings import ExecutionSettings
from ir_sim_driver.node.parameters import NodeSettings
from ir_sim_driver.plc import LINKS

ROOT = Path(__file__).resolve().parents[2]
BRINGUP = ROOT / "ros_ws" / "src" / "ir_bringup"
NODES = ("ir_planner", "ir_sim_driver", "ir_program_runner", "ir_recorder")
TOPICS = {value for key, value in vars(names).items() if key.isupper() and isinstance(value, str)}


def test_the_launch_file_starts_executables_that_the_packages_declare() -> None:
    tree = ast.parse((BRINGUP / "launch" / "cell.launch.py").read_text(encoding="utf-8"))
    [launched] = [ast.literal_eval(n.value) for n in tree.body if isinstance(n, ast.Assign)]
    assert launched == NODES
    for node in launched:
        setup = (ROOT / "src" / node / "setup.py").read_text(encoding="utf-8")
        assert re.search(rf'"{node} = {node}(\.\w+)+:main"', setup), (
            f"{node}/setup.py declares no script {node}"
        )


def leaves(block: dict[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    """Full names of the parameters, and what the file says."""
    for name, value in block.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


SETTINGS = {
    "ir_planner": {"": (PlannerSettings,)},
    "ir_sim_driver": {"": (NodeSettings, ControllerSettings, *LINKS), "execution.": (ExecutionSettings,)},
    "ir_program_runner": {"": (ProgramSettings, LinkSettings)},
    "ir_recorder": {"": (RecorderSettings,)},
}


def test_the_parameter_file_shows_settings_of_the_nodes_with_their_defaults() -> None:
    parameters = yaml.safe_load((BRINGUP / "config" / "cell.yaml").read_text(encoding="utf-8"))
    assert set(parameters) == {f"/**/{node}" for node in NODES}
    for node, by_prefix in SETTINGS.items():
        block = parameters[f"/**/{node}"]
        defaults = {
            f"{prefix}{each.name}": each.default
            for prefix, classes in by_prefix.items()
            for settings in classes
            for each in describe(settings)
        }
        assert set(block) == {"ros__parameters"}
        shown = dict(leaves(block["ros__parameters"]))
        assert shown == {name: defaults.get(name, "no such setting") for name in shown}, node


def test_views_show_topics_of_the_cell() -> None:
    rviz = yaml.safe_load((BRINGUP / "rviz" / "cell.rviz").read_text(encoding="utf-8"))
    displays = rviz["Visualization Manager"]["Displays"]
    shown = {display["Topic"]["Value"] for display in displays if "Topic" in display}
    layout = json.loads((BRINGUP / "foxglove" / "cell.json").read_text(encoding="utf-8"))
    for panel in layout["configById"].values():
        shown |= {path["value"].partition(".")[0].removeprefix("/") for path in panel.get("paths", ())}
        shown |= {topic.removeprefix("/") for topic in panel.get("topics", ())}
    assert shown
    assert shown <= TOPICS


def test_docker_installs_the_pinned_versions() -> None:
    pins = set((ROOT / "requirements" / "constraints.txt").read_text().splitlines())
    wanted = [
        line for line in (ROOT / "docker" / "requirements.txt").read_text().splitlines() if "==" in line
    ]
    assert wanted
    assert set(wanted) <= pins
