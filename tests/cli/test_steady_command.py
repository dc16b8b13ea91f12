"""`ir plan CELL --parts-per-hour`: what doesn't go together is said before anything is planned."""

from __future__ import annotations

import pytest

from ir_cli.main import main

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
