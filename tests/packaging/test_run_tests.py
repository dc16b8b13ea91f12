"""tools/run_tests.py: both parts of the tests run, and one summary counts them."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("run_tests", ROOT / "tools" / "run_tests.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["run_tests"] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("words", "others", "system"),
    [
        (["-m", "not long"], "-m|not long", "-m|not long|tests/system"),
        (["-k", "docs"], "-k|docs", "-k|docs|tests/system"),
        (["tests/planner", "-n0"], "-n0|tests/planner", None),
        (["tests/system", "-n", "0", "-x"], None, "-x|tests/system"),
        (
            ["tests/nodes", "tests/system/test_demo.py"],
            "tests/nodes",
            "tests/system/test_demo.py",
        ),
    ],
)
def test_each_part_runs_what_is_asked_of_it(
    tool: ModuleType, words: list[str], others: str | None, system: str | None
) -> None:
    asked = {part.name: list(part.words) for part in tool.parts(words, 2)}
    shared = ["-n", "2", "--dist", "worksteal", "--ignore", "tests/system"]
    expected = {}
    if others is not None:
        expected["others"] = [*shared, *others.split("|")]
    if system is not None:
        expected["system"] = ["-n", "2", "--dist", "loadfile", *system.split("|")]
    assert asked == expected


def test_a_part_that_fails_hides_no_other_and_the_summary_counts_both(
    tool: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """They run at the same time: each waits for the other to begin."""
    for name, other, end in (("bad", "good", "assert False"), ("good", "bad", "assert True")):
        (tmp_path / f"test_{name}.py").write_text(
            f"""
import time
from pathlib import Path

FOLDER = Path(__file__).parent


def test_{name}():
    (FOLDER / "{name}").touch()
    until = time.monotonic() + 300.0
    while not (FOLDER / "{other}").exists():
        assert time.monotonic() < until
        time.sleep(0.01)
    {end}
"""
        )
    monkeypatch.setattr(tool, "OUTPUT", tmp_path)
    parts = [tool.Part(name, (str(tmp_path / f"test_{name}.py"),)) for name in ("bad", "good")]
    monkeypatch.setattr(tool, "parts", lambda words, cores: parts)
    monkeypatch.setattr(sys, "argv", ["run_tests.py"])
    assert tool.main() == 1
    said = capfd.readouterr().out
    assert re.search(r"FAILED \S*test_bad.py::test_bad", said)
    assert "1 failed, 1 passed in" in said.splitlines()[-1]
