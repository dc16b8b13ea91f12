"""What the README asks people to type works, in the order in which it stands there."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
IR = [sys.executable, "-m", "ir_cli.main"]
START = ".venv/bin/ir ros up &"
READY = "Ctrl-C ends them"
PATIENCE = 400.0  # s; each command starts an interpreter, on a busy machine


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def commands() -> list[str]:
    """Lines of the shell blocks without comments."""
    lines = [line.split(" #")[0].strip() for block in blocks("bash") for line in block.splitlines()]
    return [line for line in lines if line]


@pytest.fixture(scope="module")
def nodes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """`ir ros up`, as the README starts it."""
    logs = tmp_path_factory.mktemp("log")
    command = [*IR, "ros", "up", "--logs", str(logs)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert any(
            READY in line for line in process.stdout
        )  # another one may name a port that is taken
        yield
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 130
    finally:
        process.kill()


def shell(line: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    assert line.startswith(".venv/bin/ir ")
    command = subprocess.list2cmdline(IR) + line.removeprefix(".venv/bin/ir")
    return subprocess.run(
        command,
        shell=True,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        env=dict(os.environ),
        check=False,
        cwd=folder,
    )


def test_the_readme_names_the_two_commands_and_starts_the_nodes_first() -> None:
    assert "make demo" in README
    assert "make test" in README
    _, service_calls, _ = blocks("bash")
    assert service_calls.startswith(START)
    assert len(commands()) >= 14


@pytest.mark.long
def test_what_needs_no_ros_runs_before_anything_is_started(tmp_path: Path) -> None:
    for line in commands()[: len(blocks("bash")[0].splitlines())]:
        done = shell(line, tmp_path)
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
        assert done.stdout


@pytest.mark.usefixtures("nodes")
def test_every_line_of_the_readme_runs() -> None:
    offline, service_calls, plc = blocks("bash")
    first = len(offline.splitlines())
    for line in commands()[first + 1 : first + len(service_calls.splitlines())]:
        done = shell(line)
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
    for script in [blocks("python")[0], (ROOT / "examples" / "plan_and_drive.py").read_text()]:
        ran = subprocess.run(
            [sys.executable, "-c", script],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
        assert ran.returncode == 0, ran.stdout + ran.stderr
        assert "certified" in ran.stdout
    for line in plc.splitlines():
        done = shell(line)
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"


def test_links_lead_somewhere() -> None:
    targets = re.findall(r"\]\((?!http)([^)#]+)", README)
    assert len(targets) > 10
    missing = [target for target in targets if not (ROOT / target).exists()]
    assert not missing
