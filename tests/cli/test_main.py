"""The `ir` command answers with a sentence, never with a traceback."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from ir_cli.main import main
from ir_msgs_py.ros.testing import PATIENCE

IR = [sys.executable, "-m", "ir_cli.main"]


def ir(
    *words: str, stdout: int | None = subprocess.PIPE, **environment: str
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*IR, *words],
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        timeout=PATIENCE,
        check=False,
        env={**os.environ, **environment},
    )


def test_the_version_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("ir ")


def test_an_unknown_command_is_answered_with_the_one_that_was_meant(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["reprot", "a.mcap"]) == 2
    assert capsys.readouterr().err.startswith("ir: no command reprot: did you mean report")


@pytest.mark.parametrize("domain", ["abc", "233", "-1", "1.5"])
def test_a_domain_that_is_none_is_a_sentence(
    domain: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", domain)
    assert main(["ros", "list"]) == 1
    said = capsys.readouterr().err
    assert f"ROS_DOMAIN_ID is '{domain}': it must be a whole number 0 .. 232" in said


@pytest.mark.long
def test_a_process_of_such_a_domain_ends_without_a_traceback() -> None:
    ended = ir("ros", "list", ROS_DOMAIN_ID="233")
    assert ended.returncode == 1
    assert ended.stderr.startswith("ir: ROS_DOMAIN_ID is '233'")
    assert "Traceback" not in ended.stderr


def test_commands_without_ros_do_not_mind_the_domain() -> None:
    assert ir("cell", "list", ROS_DOMAIN_ID="abc").returncode == 0


def test_a_full_disk_is_a_sentence() -> None:
    with Path("/dev/full").open("w") as full:
        ended = ir("cell", "list", stdout=full.fileno())
    assert ended.returncode != 0
    assert "No space left on device" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_a_file_that_cannot_be_written_is_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    into = tmp_path / "file" / "cell.sdf"
    assert main(["cell", "export", "open", "-o", str(into)]) == 1
    assert capsys.readouterr().err == f"ir: {into} can't be used: Not a directory\n"
