"""set_cell reads files below its roots only, and an answer never shows what a refused file
holds.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ir_description import cell_to_yaml, load_cell
from ir_msgs.msg import Status
from ir_msgs.srv import GetCell, SetCell

SECRET = "root:$6$secret"


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "cells"
    folder.mkdir()
    monkeypatch.setenv("IR_FILE_ROOTS", str(folder))
    (tmp_path / "secret.yaml").write_text(SECRET, encoding="utf-8")
    (folder / "mine.yaml").write_text(cell_to_yaml(load_cell("open")), encoding="utf-8")
    (folder / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    os.mkfifo(folder / "fifo.yaml")
    return folder


def test_a_file_below_the_roots_is_read(root: Path, call: Callable[..., Any]) -> None:
    answer = call(SetCell, "set_cell", cell_file=str(root / "mine.yaml"))
    assert answer.status.code == Status.SUCCESS, answer.status.message
    assert answer.cell_name == "open"


REFUSED = (
    "../secret.yaml",
    "link.yaml",
    "fifo.yaml",
    "../../../../../../etc/shadow",
    ".",
    "none.yaml",
)


def test_other_files_are_refused_without_their_content(
    root: Path, call: Callable[..., Any]
) -> None:
    for path in REFUSED:
        answer = call(SetCell, "set_cell", cell_file=str(root / path))
        assert answer.status.code != Status.SUCCESS, path
        assert SECRET[:6] not in answer.status.message.replace(str(root), ""), path
        assert answer.status.message.isprintable(), path
        assert call(GetCell, "get_cell").status.code == Status.SUCCESS, "the cell of before stays"
