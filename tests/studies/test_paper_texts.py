"""What the page concludes follows from the verdicts above it, whatever they are."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from pathlib import Path

import _paper_cost
import _paper_line
import _paper_result
import _paper_savings
import numpy as np
import paper
import pytest
from _paper_result import FAILS, HOLDS, JUDGED, OPEN, Row, Statement, judged

PAGE = (Path(__file__).parents[2] / "docs" / "reproduction.md").read_text()
CLAIMS = [
    name for name in paper.EXPERIMENTS if name not in ("modes", "figures", "figures_1_2", "eq_8")
]


@pytest.fixture(autouse=True)
def _few_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Intervals of figures that were made up need no thousand of them."""
    monkeypatch.setattr(_paper_result, "RESAMPLES", 100)


# A phrase, which statement of the experiment it is about, and the verdicts that it may stand
# beside.
PHRASES: dict[str, tuple[tuple[str, int, tuple[str, ...]], ...]] = {
    "kpiece_cells": (
        ("The paper is right", 0, (HOLDS,)),
        ("Even with few zones the cells save", 0, (FAILS,)),
        ("doesn't decide it", 0, (OPEN,)),
        ("nor do they among more", 1, (HOLDS,)),
        ("among more they save more", 1, (FAILS,)),
    ),
    "rrt_zones": (
        ("RRT does slow down", 3, (HOLDS,)),
        ("RRT hardly slows down", 3, (FAILS,)),
        ("it is faster", 7, (HOLDS,)),
        ("it is not faster", 7, (FAILS,)),
    ),
    "prm_time": (("as much as it lasts;", 0, (HOLDS, OPEN)), ("less than it lasts", 0, (FAILS,))),
    "ccd": (
        ("The search works", 0, (HOLDS,)),
        ("The search is not sure", 0, (FAILS,)),
        ("it pays for its time", 7, (HOLDS,)),
        ("it does not pay", 7, (FAILS,)),
    ),
    "ccd_blocked": (
        ("set-back lets more starts end free (", 0, (HOLDS,)),
        ("is not worth", 0, (FAILS,)),
        ("and it pays for its time", 3, (HOLDS,)),
        ("it does not pay", 3, (FAILS,)),
    ),
    "withdrawal": (
        ("cost less than those of trees", 12, (HOLDS,)),
        ("cost no less than trees'", 12, (FAILS,)),
        ("and it is sooner out", 11, (HOLDS,)),
        ("it is not sooner out", 11, (FAILS,)),
    ),
    "w_and_joules": (
        ("all movements 0.9 (the ranks agree)", 0, (HOLDS,)),
        ("all movements 0.7 (they do not agree enough)", 0, (FAILS,)),
    ),
    "line": (("(more than PLCs", 1, (HOLDS,)), ("(not more than PLCs", 1, (FAILS,))),
    "savings": (
        ("the range of section V holds,", 0, (HOLDS,)),
        ("the range of section V does not hold", 0, (FAILS,)),
        ("neither of its ends occurs", 1, (FAILS,)),
        ("neither of its ends occurs", 2, (FAILS,)),
        ("both of its ends occur", 1, (HOLDS,)),
    ),
}


def statements_of(name: str) -> list[Statement]:
    """The statements of an experiment as the page has them; of `savings` from rows made up."""
    experiment = paper.EXPERIMENTS[name]
    if name == "savings":
        rng = np.random.default_rng(1)
        rows: list[Row] = []
        for k in range(80):
            row: Row = {
                "seed": k % 2,
                "load": "none",
                "direction": ("up", "down")[k % 2],
                "common_J": 2000.0,
            }
            arms = (*_paper_savings.ARMS, _paper_savings.SLOWED)
            rows.append(row | {f"{arm} J": rng.uniform(100.0, 2500.0) for arm in arms})
        return judged(experiment, rows)
    chapter = PAGE.split(f"## {experiment.title}\n")[1].split("\n## ")[0]
    found = []
    for line in chapter.split("| --- | --- | --- | --- | --- |\n")[1].split("\n\n")[0].splitlines():
        says, figure, ours, bound, _ = (part.strip() for part in line.strip("|").split(" | "))
        value = float(ours.split()[0].rstrip(","))
        limit = float(bound.split()[1]) if bound else float("nan")
        ends = value - 1.0, value + 1.0, 10, "of them"
        least = not bound.startswith("≤")
        found.append(
            Statement(says, figure, value, *ends, bound=limit, at_least=least, verdict="measured")
        )
    return found


def as_found(one: Statement, verdict: str) -> Statement:
    """The statement with a figure and an interval that give this verdict."""
    if np.isnan(one.bound):
        return one
    side = {HOLDS: 1.0, FAILS: -1.0, OPEN: 0.0}[verdict] * (1.0 if one.at_least else -1.0)
    value = one.bound + 0.1 * side
    changed = replace(one, value=value, low=value - 0.05, high=value + 0.05, verdict="")
    assert changed.alone == verdict
    return replace(changed, verdict=verdict)


@pytest.mark.parametrize("name", CLAIMS)
def test_what_follows_says_nothing_that_its_verdicts_deny(name: str) -> None:
    experiment = paper.EXPERIMENTS[name]
    statements = statements_of(name)
    rng = np.random.default_rng(5)
    mixed = [rng.choice(JUDGED, len(statements)).tolist() for _ in range(40)]
    seen = set()
    for verdicts in itertools.chain(([one] * len(statements) for one in JUDGED), mixed):
        text = experiment.follows(
            [as_found(one, v) for one, v in zip(statements, verdicts, strict=True)]
        )
        assert not re.search(r"\bnan\b|\binf\b|  |\.\.|: \.|; \.", text), text
        for phrase, k, allowed in PHRASES.get(name, ()):
            if phrase in text:
                assert verdicts[k] in allowed, (phrase, verdicts[k], text)
                seen.add((phrase, k))
    assert len(seen) == len(PHRASES.get(name, ())), set(PHRASES[name]) - seen


@pytest.mark.parametrize("name", CLAIMS)
def test_opposite_verdicts_have_different_conclusions(name: str) -> None:
    experiment = paper.EXPERIMENTS[name]
    statements = statements_of(name)
    words = [
        re.sub(
            r"[-+]?\d+(\.\d+)?",
            "",
            experiment.follows([as_found(one, verdict) for one in statements]),
        )
        for verdict in (HOLDS, FAILS)
    ]
    assert words[0] != words[1]


def test_the_spline_names_what_it_costs_more_than() -> None:
    statements = statements_of("spline")
    verdicts = [HOLDS, FAILS, *[HOLDS] * (len(statements) - 2)]
    found = [as_found(one, v) for one, v in zip(statements, verdicts, strict=True)]
    text = paper.EXPERIMENTS["spline"].follows(found)
    assert "It costs more than the quintic between two points." in text
    assert "It costs no more than the cubic between two points; " in text


def test_prm_is_compared_by_verdict() -> None:
    statements = statements_of("prm_time")
    verdicts = [FAILS, HOLDS, FAILS, OPEN, *[HOLDS] * (len(statements) - 4)]
    found = [as_found(one, v) for one, v in zip(statements, verdicts, strict=True)]
    text = paper.EXPERIMENTS["prm_time"].follows(found)
    assert "more than that of kpiece, " in text
    assert "less than that of bkpiece;" in text
    assert "open against lbkpiece." in text


@pytest.mark.parametrize(("by", "says"), [(1.0, "together better."), (-1.0, "together worse.")])
def test_what_the_load_does_to_the_ranks_follows_from_the_figures(by: float, says: str) -> None:
    rng = np.random.default_rng(6)
    rows: list[Row] = []
    for k in range(60):
        joules = rng.uniform(1e3, 4e3)
        noise = rng.normal(0.0, 1e3)
        ranked = {"W": joules + (by > 0.0) * noise, _paper_cost.EMPTY: joules + (by < 0.0) * noise}
        row: Row = {"kind": "movement", "joules": joules, "seconds": 1.0 + joules, **ranked}
        row |= {"load": ("none", "tool")[k % 2], "direction": ("up", "down", "level")[k % 3]}
        rows.append(row | {_paper_cost.PRINTED: joules})
        rows.append(
            row | {"kind": "choice", "least": joules, "mean": joules, _paper_cost.PRINTED: joules}
        )
    text = _paper_cost.EXPERIMENT.follows(_paper_cost.judge(rows))
    assert ("together better." in text, "together worse." in text) == (by > 0.0, by < 0.0)
    assert says in text
    assert {row["reading"] for row in list(_paper_cost.tables(rows).values())[1]} == {
        "as read",
        _paper_cost.EMPTY,
        _paper_cost.PRINTED,
    }


def test_the_line_says_how_many_movements_of_the_common_programs_are_no_straight_ones() -> None:
    row: Row = {"cell": "open", "seconds": 10.0, "drives": 0.3, "mains": 0.2, "across": 4}
    rows = [
        row | {"stops": stops, "around": around}
        for stops, around in (("a b", 1), ("b a", 3), ("b a", 3))
    ]
    statements = _paper_line.judge(rows)
    assert statements[-1].value == pytest.approx(100.0 * 7 / 12)
    assert {one.count for one in statements} == {2}  # a program that every seed plans is one
    assert "58 % of the common programs' movements run around bodies" in _paper_line.follows(
        statements
    )


def test_savings_say_how_often_the_answer_is_the_ptp_itself() -> None:
    arms = {f"{arm} J": 1500.0 for arm in (*_paper_savings.ARMS, _paper_savings.SLOWED)}
    row: Row = {"load": "none", "direction": "up", "common_J": 2000.0, **arms}
    rows = [row | {"same time J": joules} for joules in (2000.0, 2000.0, 2000.0, 1990.0)]
    by = {one.says: one for one in _paper_savings.judge(rows)}
    assert by[_paper_savings.ITSELF].value == 75.0
    assert "the answer itself for 75 % of the movements" in _paper_savings.follows(
        list(by.values())
    )
