"""Projects are read from regular files alone, whatever stands in their folder."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from ir_cli.main import main
from ir_krl.project import read_project
from ir_values.errors import FileRefusedError


def test_a_fifo_in_the_folder_of_a_project_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "main.src").write_text("DEF main()\nEND\n")
    os.mkfifo(tmp_path / "other.src")
    os.mkfifo(tmp_path / "main.dat")
    assert [str(file.path) for file in read_project(tmp_path).files] == ["main.src"]


def test_a_fifo_is_no_archive(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "robot.zip")
    with pytest.raises(FileRefusedError, match="not a regular file"):
        read_project(tmp_path / "robot.zip")


WAYS = {
    "a program": ("krl", "import", "PIPE.src", "--cell", "open"),
    "its data": ("krl", "import", "main.src", "PIPE.dat", "--cell", "open"),
    "settings": ("krl", "import", "main.src", "--cell", "open", "--set", "PIPE"),
    "a program of a UR": ("krl", "import", "PIPE.script", "--cell", "open"),
    "today's program": ("compare", "demo", "PIPE.src"),
    "numbers of an export": (
        "krl",
        "export",
        "demo",
        "-o",
        "new.src",
        "--numbers-from",
        "PIPE.dat",
    ),
}


@pytest.mark.parametrize("way", WAYS)
def test_no_command_waits_for_who_writes_into_a_fifo(
    way: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("main.src").write_text("DEF main()\nEND\n")
    for word in WAYS[way]:
        if word.startswith("PIPE"):
            os.mkfifo(word)
    with pytest.raises(SystemExit) as ended:
        sys.exit(main(WAYS[way]))
    assert ended.value.code == 2
    assert "is not a regular file" in capsys.readouterr().err
