"""`ir-report` as a command."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from ir_recorder.report_main import main


def test_ir_report_writes_page_and_picture(demo_file: Path, tmp_path: Path) -> None:
    target = tmp_path / "out" / "report.html"
    picture = tmp_path / "demo.png"
    roots = ["--root", str(tmp_path), "--root", str(demo_file.parent)]
    assert main([str(demo_file), "-o", str(target), "--picture", str(picture), *roots]) == 0
    assert target.read_text().startswith("<!doctype html>")
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_ir_report_says_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "none.mcap"), "--root", str(tmp_path)]) == 1
    assert "No such file" in capsys.readouterr().err


def test_ir_report_acts_as_its_user_and_with_roots_only_below_them(
    demo_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    assert (
        main([str(demo_file), "-o", str(tmp_path / "a.html"), "--root", str(tmp_path / "x")]) == 1
    )
    assert "lies outside of the folders" in capsys.readouterr().err
    assert not (tmp_path / "a.html").exists()
    assert main([str(demo_file), "-o", str(tmp_path / "a.html")]) == 0


def test_a_report_replaces_a_report_and_nothing_else(demo_file: Path, tmp_path: Path) -> None:
    target = tmp_path / "report.html"
    roots = ["--root", str(tmp_path), "--root", str(demo_file.parent)]
    target.write_text("my thesis")
    assert main([str(demo_file), "-o", str(target), *roots]) == 1
    assert target.read_text() == "my thesis"
    target.write_text("<!doctype html>old")
    assert main([str(demo_file), "-o", str(target), *roots]) == 0
    assert "old" not in target.read_text()[:30]


@pytest.mark.parametrize("special", ["/dev/zero", "fifo"])
def test_devices_and_pipes_are_no_recordings(
    special: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = Path(special)
    if special == "fifo":
        path = tmp_path / "fifo"
        os.mkfifo(path)
    assert main([str(path), "--root", "/"]) == 1
    assert "is not a regular file" in capsys.readouterr().err
