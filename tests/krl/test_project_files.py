"""Projects are read from regular files alone, whatever stands in their folder."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

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
