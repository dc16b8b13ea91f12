"""The claims of the paper: verdicts follow from intervals and seeds, the page from what is
stored.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import _paper_result as statistics
import _paper_rivals
import numpy as np
import paper
import pytest
from _paper_result import (
    CALIBRATED,
    FAILS,
    HOLDS,
    MEASURED,
    OPEN,
    Experiment,
    Row,
    Statement,
    judged,
)
from paper import Chapter, bound, number, page

ROOT = Path(__file__).parents[2]
CHEAP = ("spline", "modes", "withdrawal")  # two seconds of processor time


def statement(value: float, low: float, high: float, **more: object) -> Statement:
    return Statement(
        "it helps", "how much", value, low, high, 10, "tasks", **{"bound": 1.0, **more}
    )  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("low", "high", "at_least", "verdict"),
    [
        (1.0, 2.0, True, HOLDS),
        (0.5, 0.9, True, FAILS),
        (0.9, 1.1, True, OPEN),
        (0.5, 1.0, False, HOLDS),
        (1.1, 2.0, False, FAILS),
        (math.nan, math.nan, True, OPEN),
    ],
)
def test_a_verdict_follows_from_the_whole_interval(
    low: float, high: float, at_least: bool, verdict: str
) -> None:
    assert statement(1.0, low, high, at_least=at_least).alone == verdict


def test_what_has_no_bound_is_measured_and_what_was_fitted_is_no_evidence() -> None:
    assert statement(1.0, 0.5, 2.0, bound=math.nan).alone == MEASURED
    assert statement(1.0, 0.5, 2.0, verdict=CALIBRATED).alone == CALIBRATED


def experiment(judge: object) -> Experiment:
    return Experiment(
        "one",
        "One claim",
        "It helps.",
        "It is tried.",
        lambda seed, quick: [],
        judge,
        lambda found: "So.",
    )  # type: ignore[arg-type]


def means(rows: Sequence[Row]) -> list[Statement]:
    return [statement(*statistics.interval(statistics.mean, [row["x"] for row in rows]))]


def test_a_seed_that_says_otherwise_leaves_it_open() -> None:
    rng = np.random.default_rng(1)
    high = [{"seed": 0, "x": float(x)} for x in rng.normal(5.0, 0.1, 50)]
    low = [{"seed": 1, "x": float(x)} for x in rng.normal(0.5, 0.1, 20)]
    assert judged(experiment(means), high)[0].verdict == HOLDS
    (found,) = judged(experiment(means), high + low)
    assert found.verdict == OPEN
    assert "seed by seed: holds, does not hold" in found.note


def test_what_is_open_says_how_much_larger_a_sample_would_decide_it() -> None:
    rng = np.random.default_rng(3)
    x = rng.normal(1.05, 1.0, 400)
    (wide,) = judged(experiment(means), [{"seed": 0, "x": float(one)} for one in x])
    assert wide.verdict == OPEN
    times = wide.short_by(1)
    assert f"about {math.ceil(times)} times the sample would" == wide.note
    many = [{"seed": 0, "x": float(one)} for one in np.tile(x, math.ceil(1.3 * times))]
    assert judged(experiment(means), many)[0].verdict == HOLDS
    assert statement(1.0, 0.5, 1.5).short_by(2) == math.inf  # the figure is the bound
    assert statement(1.1, 0.9, 1.3).short_by(2) == pytest.approx(8.0)
    assert math.isnan(statement(1.1, math.nan, math.nan).short_by(2))


def test_cells_are_drawn_not_the_searches_in_them() -> None:
    rng = np.random.default_rng(4)
    rows: list[Row] = []
    for place in range(6):
        helped = rng.normal(0.0, 0.5)  # what a cell does to all searches in it
        for task in range(3):
            for draw in range(8):
                asked = {
                    "seed": 2,
                    "kind": "OPEN",
                    "place": place,
                    "zones": 100,
                    "task": task,
                    "draw": draw,
                }
                rows.append(asked | {"grid": "no cells", "edges": 100.0})
                rows.append(asked | {"grid": "cells", "edges": 100.0 * math.exp(helped)})
    ratio, cells = _paper_rivals._ratios(rows, {"grid": "cells"}, {"grid": "no cells"})
    assert len(ratio) == 6 * 3 * 8
    assert sorted(set(cells)) == [f"(2, 'OPEN', {place})" for place in range(6)]
    many = _paper_rivals.judge_kpiece(rows)[1]
    assert many.high / many.low > 1.3  # six cells say little, however often each is searched


def test_an_interval_of_95_percent_holds_the_mean_about_so_often() -> None:
    rng = np.random.default_rng(12)
    inside = 0
    count = 30
    for _ in range(count):
        _, low, high = statistics.interval(statistics.mean, rng.normal(3.0, 1.0, 20))
        inside += low <= 3.0 <= high
    assert inside >= 0.8 * count  # a bootstrap of few rows is somewhat narrow


def test_rows_of_one_group_are_no_independent_sample() -> None:
    rng = np.random.default_rng(2)
    x = np.repeat(rng.normal(0.0, 1.0, 10), 20)
    groups = np.repeat(np.arange(10), 20).tolist()
    alone = statistics.interval(statistics.mean, x)
    grouped = statistics.interval(statistics.mean, x, groups=groups)
    assert grouped[2] - grouped[1] > 2.0 * (alone[2] - alone[1])


def test_shares_that_never_vary_still_have_an_interval() -> None:
    value, low, high = statistics.share([1.0] * 20)
    assert value == 1.0
    assert 0.8 < low < 0.95
    assert high == pytest.approx(1.0)
    assert statistics.share([1.0] * 20, [0, 1] * 10)[1] < low  # of two groups little follows


def test_ranks_are_those_of_spearman() -> None:
    x = np.array([1.0, 2.0, 3.0, 4.0])
    assert statistics.rank_correlation(x, x**3) == pytest.approx(1.0)
    assert statistics.rank_correlation(x, -x) == pytest.approx(-1.0)
    assert math.isnan(statistics.rank_correlation(x, np.ones(4)))


def test_the_page_shows_verdict_interval_bound_and_what_is_missing() -> None:
    one = experiment(means)
    rows = [{"seed": 0, "x": 2.0}, {"seed": 0, "x": 2.5}]
    text = page(
        [Chapter(one, judged(one, rows), rows, "", 60.0, "another machine")],
        ["other"],
        [2, 3],
        "a machine",
        quick=False,
    )
    assert "done with seeds 2 and 3 that share nothing" in text
    assert "|  | 60 s |" in text
    assert "| it helps | how much | 2.25 [2, 2.5], 10 tasks | ≥ 1 | **holds** |" in text
    assert "[One claim](#one-claim)" in text
    assert "times on a machine where a chapter names no other machine." in text
    assert "Processor times are those of another machine." in text
    assert "Not run: `other`" in text
    assert number(math.nan) == "none"
    assert bound(statement(1.0, 1.0, 1.0, at_least=False, unit="%")) == "≤ 1 %"


def test_the_page_in_the_documentation_has_every_claim_and_its_picture() -> None:
    text = (ROOT / "docs" / "reproduction.md").read_text()
    for name, one in paper.EXPERIMENTS.items():
        assert f"## {one.title}\n" in text
        assert f"(`{name}`)" in text
        assert (one.draw is not None) == (f"images/paper_{name}.png" in text)
    assert "Not run" not in text
    assert "Short version" not in text
    for file in (ROOT / "docs" / "images").glob("paper_*.png"):
        assert file.stat().st_size < 200_000


def run(monkeypatch: pytest.MonkeyPatch, folder: Path, *words: str) -> None:
    """A short run."""
    monkeypatch.setattr(sys, "argv", ["paper.py", "--quick", "--out", str(folder), *words])
    paper.main()


@pytest.mark.long
def test_a_claim_is_measured_stored_and_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = [word for name in CHEAP for word in ("--only", name)]
    run(monkeypatch, tmp_path, *asked, "--json", str(tmp_path / "all.json"))
    assert "spline: measured" in capsys.readouterr().out
    folder = tmp_path / "quick"
    text = (folder / "reproduction.md").read_text()
    for part in ("Short version", "## The spline", "Not run: "):
        assert part in text
    before = (folder / "spline.json").read_text()
    assert json.loads(before)["rows"]
    assert (folder / "spline.csv").read_text().startswith("seed,")
    result = json.loads((tmp_path / "all.json").read_text())
    assert {row["claim"] for row in result["rows"]} == set(CHEAP)
    run(monkeypatch, tmp_path, "--only", "modes")
    assert "spline: as it is stored" in capsys.readouterr().out
    assert (folder / "spline.json").read_text() == before


@pytest.mark.long
def test_every_claim_has_a_short_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(monkeypatch, tmp_path, "--workers", "2")
    text = (tmp_path / "quick" / "reproduction.md").read_text()
    assert "Not run" not in text
    for one in paper.EXPERIMENTS.values():
        assert f"## {one.title}\n" in text
