"""The notebook runs from top to bottom, without Jupyter."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).resolve().parents[2] / "examples" / "what_if.ipynb"


def code_cells() -> list[str]:
    cells = json.loads(NOTEBOOK.read_text("utf-8"))["cells"]
    assert all(cell["cell_type"] in ("code", "markdown") for cell in cells)
    assert all(not cell["outputs"] for cell in cells if cell["cell_type"] == "code"), (
        "kept without outputs"
    )
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


def test_its_code_is_python_and_asks_the_three_questions() -> None:
    text = "\n".join(code_cells())
    compile(text, str(NOTEBOOK), "exec")
    assert all(asked in text for asked in ("mass blank", "cycle_time", "x pallet"))


@pytest.mark.long
def test_it_runs_and_finds_what_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(NOTEBOOK.parent)
    names: dict[str, list[dict[str, float]]] = {}
    with contextlib.redirect_stdout(io.StringIO()) as out:
        for cell in code_cells():
            exec(cell, names)
    payload = names["payload"]
    cycle = names["cycle"]
    place = names["place"]
    assert [row["certified"] for row in payload] == [True, True, True, False]
    assert payload[0]["joules"] < payload[2]["joules"]
    assert "carries at most" in str(payload[3]["sentence"])
    assert cycle[2]["seconds"] == pytest.approx(90.0, abs=0.01)
    assert len(place) == 4
    assert "Wh a cycle" in out.getvalue()
