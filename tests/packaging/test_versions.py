"""The supported versions stand in requirements/supported.toml; what must repeat them says the
same.
"""

from __future__ import annotations

import ast
import importlib.util
import re
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
TABLE: dict[str, Any] = tomllib.loads(
    (ROOT / "requirements" / "supported.toml").read_text(encoding="utf-8")
)
SETUPS = sorted((ROOT / "src").glob("*/setup.py"))


@pytest.fixture(scope="module")
def oldest() -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "oldest_versions", ROOT / "tools" / "oldest_versions.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def keyword(setup: Path, name: str) -> Any:
    """What a setup.py gives to setup() under a name; None where it gives nothing."""
    for node in ast.walk(ast.parse(setup.read_text(encoding="utf-8"))):
        if isinstance(node, ast.keyword) and node.arg == name:
            return ast.literal_eval(node.value)
    return None


@pytest.mark.parametrize("setup", SETUPS, ids=lambda setup: setup.parent.name)
def test_packages_ask_for_no_newer_python_than_the_first_supported(setup: Path) -> None:
    asked = keyword(setup, "python_requires") or ">=0"
    wanted = tuple(int(part) for part in asked.removeprefix(">=").split("."))
    assert wanted <= min(
        tuple(int(part) for part in version.split(".")) for version in TABLE["python"]
    )


@pytest.mark.parametrize("setup", SETUPS, ids=lambda setup: setup.parent.name)
def test_packages_ask_for_nothing_newer_than_the_oldest(setup: Path) -> None:
    for requirement in keyword(setup, "install_requires") or ():
        name, _, version = requirement.partition(">=")
        if version and name in TABLE["oldest"]:
            assert version.split(".") <= TABLE["oldest"][name].split(".")


def test_the_readme_and_the_interfaces_name_the_supported_versions() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for version in TABLE["python"]:
        assert version in readme
    interfaces = tomllib.loads(
        (ROOT / "ros_ws/src/ir_msgs/pyproject.toml").read_text(encoding="utf-8")
    )
    assert interfaces["project"]["requires-python"] == f">={TABLE['python'][0]}"
    assert f"FROM ros:{TABLE['ros']}" in (ROOT / "docker" / "Dockerfile").read_text(
        encoding="utf-8"
    )


def test_docker_installs_what_the_constraints_pin() -> None:
    pins = (ROOT / "requirements" / "constraints.txt").read_text(encoding="utf-8").splitlines()
    docker = (ROOT / "docker" / "requirements.txt").read_text(encoding="utf-8").splitlines()
    assert [line for line in docker if not line.startswith("#") and line not in pins] == []


def test_the_oldest_versions_replace_those_of_the_constraints(oldest: ModuleType) -> None:
    versions = {name: version for name, version in TABLE["oldest"].items() if name != "python"}
    changed = oldest.requirements(versions, set(oldest.LEFT_OUT))
    lines = changed["requirements/constraints.txt"].splitlines()
    for name, version in versions.items():
        pins = [line for line in lines if re.match(rf"{re.escape(name)}==", line, re.IGNORECASE)]
        assert pins == [f"{name}=={version}"]
    assert "pybullet" in changed["requirements/run.txt"]
    assert "ompl" not in changed["requirements/dev.txt"]
    assert "numpy" in changed["requirements/run.txt"]


def test_the_oldest_versions_are_tested_with_the_core_the_planner_and_its_node(
    oldest: ModuleType,
) -> None:
    files = oldest.tests(ROOT, oldest.PEERS)
    for name in (
        "kernels/test_certify",
        "planner/test_program",
        "driver/test_driver",
        "nodes/test_planner_node",
    ):
        assert f"tests/{name}.py" in files
    for test in oldest.OTHERWISE:
        path, _, name = test.partition("::")
        assert f"def {name}(" in (ROOT / path).read_text(encoding="utf-8")
        assert path in files


def test_other_versions_are_tested_by_one_command_and_by_test_long() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    rules = dict(re.findall(r"^([a-z-]+):.*\n((?:\t.*\n)+)", makefile, re.M))
    assert "test-versions" in rules["test-long"]
    asked = re.findall(r"--python (\S+)", rules["test-versions"])
    assert asked == [each for each in TABLE["python"] if each != TABLE["python"][0]]
