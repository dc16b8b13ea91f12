"""The launch package names what exists: executables, topics, parameters."""

from __future__ import annotations

import json
import os
import re
import runpy
import shlex
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree as Xml

import pytest
import yaml

from ir_msgs_py import names
from ir_planner.settings import PlannerSettings
from ir_program_runner.settings import LinkSettings, ProgramSettings
from ir_recorder.recording.settings import RecorderSettings
from ir_sim_driver.controller.settings import ControllerSettings
from ir_sim_driver.motion.goal import ExecutionSettings
from ir_sim_driver.node.parameters import NodeSettings
from ir_sim_driver.plc import LINKS
from ir_values.settings import describe

ROOT = Path(__file__).resolve().parents[2]
BRINGUP = ROOT / "ros_ws" / "src" / "ir_bringup"
NODES = ("ir_planner", "ir_sim_driver", "ir_program_runner", "ir_recorder")
TOPICS = {value for key, value in vars(names).items() if key.isupper() and isinstance(value, str)}


def test_the_launch_file_starts_executables_that_the_packages_declare() -> None:
    started = [node for node in launched() if node["package"] in NODES]
    assert [node["executable"] for node in started] == list(NODES)
    for node in NODES:
        setup = (ROOT / "src" / node / "setup.py").read_text(encoding="utf-8")
        assert re.search(rf'"{node} = {node}(\.\w+)+:main"', setup), (
            f"{node}/setup.py declares no script {node}"
        )


class Stand:
    """Stands for whatever the launch file makes: it keeps the arguments."""

    def __init__(self, *values: Any, **named: Any) -> None:
        self.values = values
        self.named = named


def launched(**given: str) -> list[dict[str, Any]]:
    """Arguments of the nodes that the launch file starts, with stand-ins for launch and
    launch_ros.
    """
    modules = {name: ModuleType(name) for name in ("launch", "launch_ros")}
    for name in (
        "launch.actions",
        "launch.substitutions",
        "launch_ros.actions",
        "launch_ros.substitutions",
    ):
        modules[name] = ModuleType(name)
    for module in modules.values():
        module.__getattr__ = lambda name: Stand  # type: ignore[method-assign]
    with pytest.MonkeyPatch.context() as patch:
        for name, module in modules.items():
            patch.setitem(sys.modules, name, module)
        script = runpy.run_path(str(BRINGUP / "launch" / "cell.launch.py"))
        *arguments, everything = script["generate_launch_description"]().values[0]
        values = {each.values[0]: each.named["default_value"] for each in arguments}
        assert set(given) <= set(values)
        context = SimpleNamespace(launch_configurations=values | given)
        return [node.named for node in everything.named["function"](context)]


def parameters_of(nodes: list[dict[str, Any]], name: str) -> dict[str, object]:
    [found] = [node["parameters"][-1] for node in nodes if node["executable"] == name]
    return dict(found)


def test_launch_arguments_reach_the_nodes_that_they_concern() -> None:
    nodes = launched(cell="open", namespace="cell_2", wake_port="9010", modbus_port="5021")
    assert {node["namespace"] for node in nodes} == {"cell_2"}
    assert parameters_of(nodes, "ir_sim_driver") == {
        "cell": "open",
        "wake_port": 9010,
        "modbus": True,
        "modbus_port": 5021,
    }
    assert parameters_of(nodes, "ir_program_runner") == {"cell": "open", "wake_port": 9010}
    assert parameters_of(nodes, "ir_planner") == {"cell": "open"}
    for name in NODES:
        known = {
            f"{prefix}{each.name}"
            for prefix, classes in SETTINGS[name].items()
            for settings in classes
            for each in describe(settings)
        }
        assert set(parameters_of(nodes, name)) <= known


def test_robot_state_publisher_gets_the_text_and_leaves_the_topic_to_the_driver() -> None:
    nodes = launched(robot_state_publisher="true", rviz="true")
    [publisher, view] = [node for node in nodes if node["package"] not in NODES]
    text = publisher["parameters"][0]["robot_description"]
    assert Xml.fromstring(text).find("link[@name='cell']") is not None
    assert ("robot_description", "~/robot_description") in publisher["remappings"]
    for node in (publisher, view):
        assert {("/tf", "tf"), ("/tf_static", "tf_static")} <= set(node["remappings"])
    assert parameters_of(nodes, "ir_sim_driver")["publish_tf"] is False
    assert len(launched()) == len(NODES)


def leaves(block: dict[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    """Full names of the parameters, and what the file says."""
    for name, value in block.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


SETTINGS = {
    "ir_planner": {"": (PlannerSettings,)},
    "ir_sim_driver": {
        "": (NodeSettings, ControllerSettings, *LINKS.values()),
        "execution.": (ExecutionSettings,),
    },
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
    kinds = ("Topic", "Description Topic")
    shown = {display[kind]["Value"] for display in displays for kind in kinds if kind in display}
    assert names.ROBOT_DESCRIPTION in shown
    layout = json.loads((BRINGUP / "foxglove" / "cell.json").read_text(encoding="utf-8"))
    for panel in layout["configById"].values():
        shown |= {
            path["value"].partition(".")[0].removeprefix("/") for path in panel.get("paths", ())
        }
        shown |= {topic.removeprefix("/") for topic in panel.get("topics", ())}
    assert shown
    assert shown <= TOPICS


def test_docker_installs_the_pinned_versions() -> None:
    pins = set((ROOT / "requirements" / "constraints.txt").read_text().splitlines())
    wanted = [
        line
        for line in (ROOT / "docker" / "requirements.txt").read_text().splitlines()
        if "==" in line
    ]
    assert wanted
    assert set(wanted) <= pins


APT_NAMES = {"PyYAML": "python3-yaml"}


def test_docker_installs_all_that_is_needed_at_run_time() -> None:
    dockerfile = (ROOT / "docker" / "Dockerfile").read_text()
    by_pip = (ROOT / "docker" / "requirements.txt").read_text()
    needed = [
        line.strip()
        for line in (ROOT / "requirements" / "run.txt").read_text().splitlines()
        if line[:1].isalpha()
    ]
    assert needed
    missing = [
        name
        for name in needed
        if f"{name}==" not in by_pip
        and f"{APT_NAMES.get(name, f'python3-{name}')} " not in dockerfile
    ]
    assert missing == []


def test_commands_that_docker_s_files_show_begin_with_a_command_of_the_image() -> None:
    dockerfile = (ROOT / "docker" / "Dockerfile").read_text()
    compose = yaml.safe_load((ROOT / "docker" / "compose.yaml").read_text())
    shown = re.findall(r"docker run .*? ir (\w+)", dockerfile)
    shown += re.findall(r'^CMD \["(\w+)"', dockerfile, re.MULTILINE)
    shown += [service["command"][0] for service in compose["services"].values()]
    setups = "".join(path.read_text() for path in (ROOT / "src").glob("*/setup.py"))
    scripts = set(re.findall(r"[\"'](\w+) ?= ?[\w.]+:\w+", setups))
    assert len(shown) > 5
    assert set(shown) - {"bash"} <= scripts


@pytest.mark.parametrize(("core", "code"), [("baseline", 0), ("reference", 1)])
def test_an_image_without_a_compiled_core_fails_to_build(core: str, code: int) -> None:
    dockerfile = (ROOT / "docker" / "Dockerfile").read_text()
    (check,) = re.findall(r"^RUN .* python3 -c \\\n +'(.+)' \\$", dockerfile, re.MULTILINE)
    environment = os.environ | {"IR_KERNELS": core}
    assert subprocess.run([sys.executable, "-c", check], env=environment).returncode == code


def test_the_image_s_first_process_becomes_the_node_that_is_named(tmp_path: Path) -> None:
    text = (ROOT / "docker" / "entrypoint.sh").read_text()
    for place in ("/opt/ros/jazzy/", "/ws/ros_ws/install/"):
        assert place in text
        (tmp_path / place[1:]).mkdir(parents=True)
        text = text.replace(place, f"{tmp_path}{place}")
    (tmp_path / "opt/ros/jazzy/setup.bash").write_text("export ROS=$$\n")
    install = tmp_path / "ws/ros_ws/install"
    (install / "local_setup.bash").write_text("export WORKSPACE=$ROS\n")
    node = install / "lib" / "ir_planner" / "ir_planner"
    node.parent.mkdir(parents=True)
    node.write_text('#!/bin/bash\necho "$WORKSPACE $$ $*"\n')
    node.chmod(0o755)
    (tmp_path / "entrypoint.sh").write_text(text)
    command = ["bash", str(tmp_path / "entrypoint.sh"), "ir_planner", "--ros-args"]
    system = {"PATH": "/usr/bin:/bin"}  # a caller's own path may lead to another node of that name
    said = subprocess.run(command, capture_output=True, text=True, check=True, env=system).stdout
    sourced, own, words = said.split()
    assert sourced == own  # the shell was replaced: signals reach the node
    assert words == "--ros-args"


def test_every_command_in_a_comment_of_docker_s_files_names_what_there_is() -> None:
    compose = yaml.safe_load((ROOT / "docker" / "compose.yaml").read_text())
    dockerfile = (ROOT / "docker" / "Dockerfile").read_text()
    targets = set(re.findall(r"^FROM \S+ AS (\w+)", dockerfile, re.MULTILINE))
    shown = [
        re.split(r"\s{3,}", line.lstrip("# "))[0]
        for path in sorted((ROOT / "docker").iterdir())
        for line in path.read_text().splitlines()
        if re.match(r"#\s+docker ", line)
    ]
    assert len(shown) == 5
    for command in shown:
        subprocess.run(["bash", "-n", "-c", command], check=True)
        words = shlex.split(command)
        assert words[1] in {"build", "run", "compose"}, command
        files = [after for word, after in pairwise(words) if word in ("-f", "--file")]
        assert all((ROOT / file).is_file() for file in files), command
        if words[1] == "build":
            assert words[-1] == "."
            assert words[words.index("-t") + 1] == compose["x-node"]["image"]
        elif words[1] == "run":
            assert words[-3] == compose["x-node"]["image"], command
        elif "run" in words:
            assert words[-1] in compose["services"], command
        else:
            assert {"up", "--build"} <= set(words), command
    assert compose["x-node"]["build"]["target"] in targets
    listed = re.findall(r"^# Targets: .*", dockerfile, re.MULTILINE)
    assert set(re.findall(r"(\w+) \(", "".join(listed))) == targets - {"base"}
