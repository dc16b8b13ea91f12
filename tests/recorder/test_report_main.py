"""`ir-report` as a command."""

from __future__ import annotations

from pathlib import Path

import pytest

from ir_recorder.report_main import main


def test_ir_report_writes_page_and_picture(demo_file: Path, tmp_path: Path) -> None:
    target = tmp_path / "out" / "report.html"
    picture = tmp_path / "demo.png"
    assert main([str(demo_file), "-o", str(target), "--picture", str(picture)]) == 0
    assert target.read_text().startswith("<!doctype html>")
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_ir_report_says_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "none.mcap")]) == 1
    assert "No such file" in capsys.readouterr().err
