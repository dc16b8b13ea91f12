"""The Python of docs/recording.md runs."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from ir_recorder import Tolerances
from ir_values.settings import settings_table

PAGE = (Path(__file__).parents[2] / "docs" / "recording.md").read_text(encoding="utf-8")
SNIPPETS = re.findall(r"```python\n(.*?)```", PAGE, re.S)


@pytest.mark.parametrize("code", SNIPPETS, ids=["with the package", "without it"])
def test_snippets_run(code: str, demo_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(code.replace("out/demo.mcap", str(demo_file)), "recording.md", "exec"), {})
    assert capsys.readouterr().out


def test_the_table_of_bounds_is_that_of_the_settings() -> None:
    assert settings_table(Tolerances()).replace("Parameter", "Bound") in PAGE
