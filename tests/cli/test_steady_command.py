"""`ir plan CELL --parts-per-hour`: what doesn't go together is said before anything is planned."""

from __future__ import annotations

import pytest

from ir_cli.main import main
from ir_planner import Planner

SURPRISES = (["--outage", "lathe=600"], ["--vary"])


@pytest.mark.parametrize("asked", SURPRISES)
@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ([], "give --cycles as well"),
        (["--cycles", "3", "--json"], "leave out --json or --csv"),
        (["--cycles", "3", "--csv"], "leave out --json or --csv"),
    ],
)
def test_no_surprise_that_is_asked_for_is_left_out(
    asked: list[str], more: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", "flexible", "--parts-per-hour", "30", *asked, *more]) == 2
    assert sentence in capsys.readouterr().err


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        (["--outage", "press=600"], "'press' is unknown; known are lathe, washer, gauge"),
        (["--outage", "infeed=600"], "'infeed' is unknown; known are lathe, washer, gauge"),
        (["--outage", "lathe"], "must be MACHINE=S"),
        (["--outage", "lathe=nan"], "must be MACHINE=S"),
        (["--vary"], "a machine whose process has between or samples"),
    ],
)
def test_a_surprise_that_the_cell_cannot_have_is_refused_before_anything_is_planned(
    asked: list[str],
    sentence: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Planner, "plan_steady_cycle", None)
    assert main(["plan", "flexible", "--parts-per-hour", "30", "--cycles", "3", *asked]) == 2
    assert sentence in capsys.readouterr().err
