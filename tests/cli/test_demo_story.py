"""What `ir demo` changes of a cell, and what it leaves as it is."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from ir_cli.errors import DemonstrationError
from ir_cli.output import Progress
from ir_cli.ros.demo import LONGEST_PAUSE, Demonstration
from ir_description import load_cell
from ir_values.errors import RequestRefusedError

STORY = {
    "_plan": RequestRefusedError("no path", -1),
    "_tour": DemonstrationError("waited 30 s"),
    "_drive": RequestRefusedError("the robot is not ready", -6),
}


def pauses(demonstration: Demonstration) -> list[float]:
    return [step.dwell for step in demonstration._cell.program if step.kind == "PAUSE"]


def test_pauses_are_shortened_with_a_fact_that_says_so_and_real_ones_are_the_programs(
    tmp_path: Path,
) -> None:
    full = [step.dwell for step in load_cell("demo").program if step.kind == "PAUSE"]
    assert max(full) > LONGEST_PAUSE
    short = Demonstration("demo", tmp_path, 0, "nominal", Progress())
    assert max(pauses(short)) == LONGEST_PAUSE
    assert any(fact.startswith("shortened=") for fact in short._facts())
    real = Demonstration("demo", tmp_path, 0, "nominal", Progress(), real_pauses=True)
    assert pauses(real) == full
    facts = [fact.partition("=")[0] for fact in real._facts()]
    assert facts == ["seed", "plant", "safety_distance"]


@pytest.mark.parametrize("stage", ["_plan", "_tour", "_drive"])
def test_a_demonstration_that_ends_early_says_why_and_is_reported(
    stage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    demonstration = Demonstration("demo", tmp_path, 0, "nominal", Progress())
    reached = []
    plan = SimpleNamespace(program_id="0")

    def done(name: str) -> SimpleNamespace:
        reached.append(name)
        if name == stage:
            raise STORY[stage]
        return plan

    for name in STORY:
        monkeypatch.setattr(demonstration, name, lambda *_, name=name: done(name))
    assert demonstration._story(None) == str(STORY[stage])
    assert reached[-1] == stage
    monkeypatch.setattr(demonstration, stage, lambda *_: plan)
    assert demonstration._story(None) == ""
