"""Every benchmark has the same options and writes the same JSON."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted((ROOT / "benchmarks").glob("[!_]*.py"))
OPTIONS = {"--cell", "--seeds", "--quick", "--json"}
OTHERS = {
    "compare": {"--before", "--after", "--quick", "--json"},  # its requests name cells and seeds
    "soak": {"--minutes", "--quick", "--json"},  # one cell for an hour
    "recording": {"--seconds", "--minutes", "--quick", "--json"},
    "paper": {"--only", "--again", "--seeds", "--quick", "--json"},  # each claim names its cells
    # one cell: it asks for the driver
    "hostile": {"--only", "--seeds", "--drivers", "--quick", "--json"},
    "strangers": {"--seeds", "--quick", "--json"},  # files, no cells
    "requests": {"--only", "--cases", "--quick", "--json"},  # each kind draws cells of its own
}


def ran(script: str, *words: str) -> str:
    """What a benchmark prints."""
    command = [sys.executable, str(ROOT / "benchmarks" / f"{script}.py"), *words]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, env=os.environ, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


HELP_OF_ALL = """
import contextlib, io, json, runpy, sys
sys.path.insert(0, sys.argv[1])  # as it is for a script
found = {}
for script in sys.argv[2:]:
    sys.argv, shown = [script, "--help"], io.StringIO()
    try:
        with contextlib.redirect_stdout(shown):
            runpy.run_path(f"{sys.path[0]}/{script}.py", run_name="__main__")
        ended = "it went on"
    except SystemExit as code:
        ended = code.code or 0
    except Exception as error:
        ended = repr(error)
    found[script] = [ended, shown.getvalue()]
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def help_of() -> dict[str, list[Any]]:
    """How each script ended that was asked for help, 0 = well, and what it printed: imports once
    for all.
    """
    names = [path.stem for path in SCRIPTS]
    command = [sys.executable, "-c", HELP_OF_ALL, str(ROOT / "benchmarks"), *names]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, env=os.environ, check=False
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, list[Any]] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("script", [path.stem for path in SCRIPTS])
def test_every_benchmark_has_the_options(script: str, help_of: dict[str, list[Any]]) -> None:
    ended, shown = help_of[script]
    assert ended == 0
    assert {option for option in OTHERS.get(script, OPTIONS) if option not in shown} == set()


@pytest.mark.long
def test_a_quick_run_prints_its_claims_and_writes_them(tmp_path: Path) -> None:
    file = tmp_path / "new" / "driver.json"
    asked = ("--quick", "--seconds", "0", "--cell", "open", "--seeds", "1", "--json", str(file))
    printed = ran("driver", *asked)
    result = json.loads(file.read_text())
    assert set(result) == {"machine", "commit", "rows", "claims"}
    assert {row["cell"] for row in result["rows"]} == {"open"}
    keys = {"name", "value", "unit", "bound", "holds"}
    assert all(set(claim) == keys for claim in result["claims"])
    lines = printed.splitlines()[-len(result["claims"]) :]
    for line, claim in zip(lines, result["claims"], strict=True):
        assert line.startswith(claim["name"])
        assert line.endswith("holds" if claim["holds"] else "falls short")


def test_make_bench_runs_all_of_them() -> None:
    shown = subprocess.run(["make", "-n", "bench"], cwd=ROOT, capture_output=True, text=True).stdout
    listed = {path.stem for path in SCRIPTS if f"benchmarks/{path.name}" in shown}
    assert listed == {path.stem for path in SCRIPTS} - {"compare"}
    assert "--quick" in shown
