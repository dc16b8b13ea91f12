"""Every numbered example runs without ROS and prints what it promises, with units."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]*.py"))

# A line that each example must print.
PRINTS = {
    "01_distance": r" -\d+\.\d mm  t_f1 and gauge_table \(environment\)",
    "02_inverse_kinematics": r"ccd: [1-9]\d* configurations",
    "03_one_movement": r"MovementPlan\(3\.00 s, \d+ J, clearance \d+ mm, certified, id \w+\)",
    "04_service_movement": r"modified_ga: \d\.\d\d s, \d+ J at the mains",
    "05_pareto_front": r"^ +\d\.\d\d +\d+ +\d\.\d$",
    "06_program": r"^program \w+: \d+\.\d s, \d+\.\d kJ",
    "07_standby": r"^ +3600  HIBERNATION +3480\.0 ",
    "08_read_a_recording": r"^BUS_POWER_OFF +\d+\.\d\d s +\d+ J",
}


def module_of(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short recording of a small cell, made by the recorder's own writer."""
    maker = module_of(ROOT / "tests" / "recorder" / "conftest.py")
    made: Path = maker.demo_run().record(tmp_path_factory.mktemp("recording") / "demo.mcap")
    return made


def test_the_examples_are_numbered_without_a_gap() -> None:
    assert [path.stem for path in EXAMPLES] == list(PRINTS)
    assert [path.stem[:2] for path in EXAMPLES] == [f"{number:02}" for number in range(1, 9)]


@pytest.mark.sampled
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_example_prints_what_it_promises(
    path: Path, recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    example = module_of(path)
    if path.stem.startswith("08"):
        example.main(str(recording))
    else:
        example.main()
    printed = capsys.readouterr().out
    assert re.search(PRINTS[path.stem], printed, re.MULTILINE), printed


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_example_uses_public_faces_only(path: Path) -> None:
    imported = re.findall(
        r"^from (ir_[\w.]+) import|^import (ir_[\w.]+)", path.read_text("utf-8"), re.MULTILINE
    )
    assert imported
    assert [name for pair in imported for name in pair if "." in name] == []


def test_the_examples_need_no_ros() -> None:
    imports = "; ".join(f"import {name}" for name in ("ir_planner", "ir_recorder"))
    code = (
        f"import sys; {imports}; print([name for name in sys.modules if name.startswith('rclpy')])"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"
