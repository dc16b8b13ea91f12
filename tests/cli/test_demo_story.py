"""What `ir demo` changes of a cell, and what it leaves as it is."""

from __future__ import annotations

from pathlib import Path

from ir_cli.demo.story import LONGEST_PAUSE, Demonstration
from ir_cli.terminal import Progress
from ir_description import load_cell


def pauses(demonstration: Demonstration) -> list[float]:
    return [step.dwell for step in demonstration._cell.program if step.kind == "PAUSE"]


def test_pauses_are_shortened_with_a_fact_that_says_so_and_real_ones_are_the_programs(tmp_path: Path) -> None:
    full = [step.dwell for step in load_cell("demo").program if step.kind == "PAUSE"]
    assert max(full) > LONGEST_PAUSE
    short = Demonstration("demo", tmp_path, 0, "nominal", Progress())
    assert max(pauses(short)) == LONGEST_PAUSE
    assert any(fact.startswith("shortened=") for fact in short._facts())
    real = Demonstration("demo", tmp_path, 0, "nominal", Progress(), real_pauses=True)
    assert pauses(real) == full
    facts = [fact.partition("=")[0] for fact in real._facts()]
    assert facts == ["seed", "plant", "safety_distance"]
