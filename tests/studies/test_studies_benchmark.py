"""The parts of the benchmark of studies run alone."""

from __future__ import annotations

import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import _layout_study
import numpy as np
import pytest
import studies
from _results import at_most
from _statistics_study import recomputed
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_recorder.analysis.intervals import Mean
from ir_studies.layout.search import BATCH
from ir_studies.statistics.findings import findings_of
from ir_studies.statistics.runs import FinishedStatistics
from ir_studies.statistics.settings import StatisticsSettings

WRONG = Mean(1e6, 0.0, 0.0)


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


def test_every_grid_has_more_placements_than_are_planned_before_there_is_a_bound() -> None:
    small = _layout_study.SMALL
    for steps in (_layout_study.QUICK_STEPS, small.steps):
        assert steps ** len(small.variables) > BATCH


@given(
    st.lists(
        st.tuples(st.floats(-0.5, 0.5), st.floats(-0.1, 0.1)), min_size=3, max_size=12, unique=True
    )
)
@settings(max_examples=15, deadline=None)
def test_figures_of_the_statistics_are_those_of_the_benchmark(
    shares: list[tuple[float, float]],
) -> None:
    def movement(timing: str, k: int, joules: float, off: float) -> dict[str, object]:
        figures = dict.fromkeys(
            ("duration_s", "direct_j", "peak_w", "path_m", "torque_share"), joules
        )
        measured = {"predicted_j": joules * (1.0 + off), "indirect_j": joules * (1.0 - off)}
        return {
            "solved": True,
            "timing": timing,
            "trajectory_id": f"{timing}{k}",
            **figures,
            **measured,
        }

    rows = [
        {
            "key": str(k),
            "synchronous": movement("synchronous", k, 100.0, off),
            "asynchronous": movement("asynchronous", k, 100.0 * (1.0 + share), 0.5 * off),
        }
        for k, (share, off) in enumerate(shares)
    ]
    found = findings_of(rows)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "results.jsonl").write_text("".join(f"{json.dumps(row)}\n" for row in rows))
        finished = FinishedStatistics(StatisticsSettings("open"), tuple(rows), found, ())
        assert all(claim.holds for claim in recomputed(finished, folder))
        wrong = replace(
            found, comparisons=tuple(replace(one, mean=WRONG) for one in found.comparisons)
        )
        if np.ptp([share for share, _ in shares]) > 1e-3:
            assert not recomputed(replace(finished, findings=wrong), folder)[0].holds


def test_parts_that_nobody_has_are_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["studies.py", "--only", "everything"])
    with pytest.raises(SystemExit):
        studies.main()
    said = capsys.readouterr().err
    assert all(name in said for name in studies.PARTS)
