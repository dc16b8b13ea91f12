"""Results of a study in a file: whatever is left of it, rows are kept or a damaged line is
named.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_studies.errors import StudyError
from ir_studies.work import Job, Results
from ir_studies.work.results import NAME

BUDGET = {"seconds": 1.0}
CELLS = {"open": "a"}


def opened(folder: Path, **cells: str) -> Results:
    return Results(folder, "layout", BUDGET, cells or CELLS)


def filled(folder: Path, rows: int = 3) -> bytes:
    with opened(folder) as results:
        for number in range(rows):
            results.add(Job(str(number)), {"outcome": "answered", "text": "\r\x85\u2028"})
    return (folder / NAME).read_bytes()


@given(share=st.floats(0.0, 1.0))
def test_a_file_that_ends_anywhere_goes_on_with_its_whole_lines(
    tmp_path_factory: pytest.TempPathFactory, share: float
) -> None:
    folder = tmp_path_factory.mktemp("cut")
    content = filled(folder)
    cut = content[: round(share * len(content))]
    (folder / NAME).write_bytes(cut)
    with opened(folder) as results:
        left = set(results.rows)
        for number in range(3):
            if str(number) not in left:
                results.add(Job(str(number)), {"outcome": "answered", "text": "\r\x85\u2028"})
    assert len(left) == max(cut.count(b"\n") - 3, 0)
    assert (folder / NAME).read_bytes() == content


def test_results_that_were_computed_with_others_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    filled(tmp_path)
    with opened(tmp_path) as results:
        assert results.remark == ""
        monkeypatch.setattr("ir_studies.work.results.computed_with", lambda kind: "an abacus")
        assert results.remark == ""
        results.add(Job("late"), {"outcome": "answered"})
        assert "an abacus" in results.remark
    with opened(tmp_path) as results:
        assert "an abacus" in results.remark
        assert len(results.rows) == 4


@pytest.mark.parametrize(
    "line",
    [b"\x00" * 40, b"garbage", b"[]", b"5", b"[" * 100_000, b'{"key": 5}', b'{"key": []}', b'{"cells": 5}',  # noqa: E501
     b"\xff\xfe", b'{"key": "0"}{"key": "1"}'],
)  # fmt: skip
def test_a_damaged_line_is_named_and_nothing_is_changed(tmp_path: Path, line: bytes) -> None:
    lines = filled(tmp_path).split(b"\n")
    content = b"\n".join([*lines[:3], line, *lines[3:]])
    (tmp_path / NAME).write_bytes(content)
    with pytest.raises(StudyError, match="line 4 is damaged"):
        opened(tmp_path)
    assert (tmp_path / NAME).read_bytes() == content


def test_of_two_lines_of_a_job_the_last_counts(tmp_path: Path) -> None:
    filled(tmp_path)
    with (tmp_path / NAME).open("ab") as file:
        file.write(json.dumps({"key": "1", "outcome": "again"}).encode() + b"\n")
    with opened(tmp_path) as results:
        assert results.rows["1"]["outcome"] == "again"
        assert len(results.rows) == 3


def test_a_file_system_without_locks_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: Any) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", refused)
    with pytest.raises(StudyError, match="can't be used: No locks available"):
        opened(tmp_path)


def test_a_full_disk_is_named_when_the_file_begins(tmp_path: Path) -> None:
    (tmp_path / NAME).symlink_to(
        "/dev/full"
    )  # a device: links are refused, as by an attacker's folder
    with pytest.raises(StudyError, match="can't be written"):
        opened(tmp_path)
    (tmp_path / NAME).unlink()
    results = opened(tmp_path)
    full = os.open("/dev/full", os.O_WRONLY)
    os.dup2(full, results._file.fileno())
    os.close(full)
    with pytest.raises(StudyError, match="can't be written: No space left"), results:
        results.add(Job("0"), {})
