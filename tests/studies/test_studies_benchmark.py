"""The parts of the benchmark of studies run alone."""

from __future__ import annotations

import sys
from pathlib import Path

import _layout_study
import pytest
import studies
from _results import at_most


def test_only_what_is_named_is_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[tuple[str, Path]] = []

    def noted(name: str) -> object:
        def part(*given: object) -> list[object]:
            ran.append((name, next(one for one in given if isinstance(one, Path))))
            return [at_most(name, 0.0, "", 1.0)]

        return part

    for name in ("demonstration", "speed"):
        monkeypatch.setattr(_layout_study, name, noted(name))
    monkeypatch.setattr(_layout_study, "bounded_against_exhaustive", noted("grid"))
    words = ["studies.py", "--only", "speed", "--only", "grid", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", words)
    studies.main()
    assert ran == [("grid", tmp_path), ("speed", tmp_path)]


def test_parts_that_nobody_has_are_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["studies.py", "--only", "everything"])
    with pytest.raises(SystemExit):
        studies.main()
    said = capsys.readouterr().err
    assert all(name in said for name in studies.PARTS)
