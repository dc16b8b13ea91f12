"""What the statistics may say: what is shown and what is not, and in which words."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ir_studies.statistics.failures import NO_PAIR, NOT_DRIVEN, failures_of
from ir_studies.statistics.figures import findings_of
from ir_studies.statistics.outputs import page_html, summed_up
from ir_studies.statistics.settings import DRAWN, StatisticsSettings
from ir_studies.statistics.verdict import effect_words, sentences

ASKED = StatisticsSettings("open")
SIDES = ("synchronous", "asynchronous")


def movement(timing: str, number: int, **figures: float) -> dict[str, Any]:
    """A solved and driven movement."""
    common = {"duration_s": 2.0, "direct_j": 100.0, "indirect_j": 95.0, "predicted_j": 95.0}
    within = {"predicted_low_j": 95.0, "predicted_high_j": 120.0}
    named = {"solved": True, "timing": timing, "trajectory_id": f"{timing}{number}", "message": ""}
    return named | common | within | figures


def pairs(
    *shares: float, column: str = "direct_j", number: int | None = None
) -> list[dict[str, Any]]:
    """Rows whose asynchronous movement takes so many shares more of a figure that is 100."""
    return [
        {
            "start": "a",
            "goal": "b",
            "synchronous": movement(
                "synchronous", k if number is None else number, **{column: 100.0}
            ),
            "asynchronous": movement(
                "asynchronous", k if number is None else number, **{column: 100.0 * (1.0 + share)}
            ),
        }
        for k, share in enumerate(shares)
    ]


def said(rows: list[dict[str, Any]], settings: StatisticsSettings = ASKED) -> str:
    """All sentences."""
    return " ".join(sentences(findings_of(rows), settings))


def test_one_difference_among_eight_that_chance_explains_is_not_shown() -> None:
    shares = np.random.default_rng(8).normal(0.0, 0.02, 40)
    shares += 0.0068 - shares.mean()  # its own interval leaves out zero, by little
    rows = pairs(*shares.tolist())
    for k, row in enumerate(rows):  # the other figures vary too
        for name in ("duration_s", "predicted_j", "indirect_j", "peak_w"):
            row["synchronous"][name] = 100.0
            row["asynchronous"][name] = 100.0 + (-1.0) ** k
    found = findings_of(rows)
    energy = next(each for each in found.comparisons if each.name == "energy, direct")
    assert energy.outside
    assert not energy.shown
    assert "among so many comparisons it is not shown" in said(rows)


def test_no_difference_names_what_the_means_are_equal_within() -> None:
    rows = pairs(*([0.01, -0.01] * 20))
    assert "no difference is shown, the means are equal within 0.27 %" in said(rows)


def test_figures_that_differ_by_rounding_are_alike() -> None:
    rows = pairs(*(1e-14 * k for k in range(1, 40)), column="movement_cost")
    found = findings_of(rows)
    cost = next(each for each in found.comparisons if each.name.startswith("W "))
    assert (cost.less, cost.more, cost.outside, cost.shown) == (0, 0, False, False)


@pytest.mark.parametrize(
    ("shares", "words"),
    [
        ((), "so 0 are compared"),
        ((0.1,), "+10.00 % in 1 pair, which says nothing of others"),
        ((0.1,), "Fewer than 30 pairs may miss the few that carry a mean"),
        ((0.1, 0.1), "+10.00 % in 2 pairs, all alike"),
        ((0.0, 0.0), "energy, direct: 0.00 % in 2 pairs, all alike"),
        ((0.1, -0.1), "no difference is shown"),
    ],
)
def test_few_pairs_say_little(shares: tuple[float, ...], words: str) -> None:
    assert words in said(pairs(*shares))
    assert words.split(":")[0] in page_html(findings_of(pairs(*shares)), ASKED)


def test_movements_that_were_drawn_again_are_counted() -> None:
    assert "3 are compared, 1 of them different" in said(pairs(0.1, 0.1, 0.1, number=7))


def test_all_coincide_and_nothing_is_compared() -> None:
    rows = [
        {"synchronous": movement("synchronous", 0), "asynchronous": movement("synchronous", 0)}
    ] * 3
    found = findings_of(rows)
    assert (found.solved, found.same, found.driven) == (3, 3, 3)
    assert "in 3 of them the asynchronous answer is the synchronous one, so 0 are compared" in said(
        rows
    )
    assert "candidate" not in said(rows)
    assert "Fewer than 30 pairs may miss" in said(rows)


def test_reasons_are_counted_without_their_figures_and_movements_that_were_not_driven_apart() -> (
    None
):
    def lost(clearance: float) -> dict[str, Any]:
        message = (
            f"on it t_f2 and lathe come to {clearance} mm at 11 % of it (tcp at 0.66, "
            f"{clearance} m)"
        )
        return {timing: {"solved": False, "message": message} for timing in SIDES}

    still = pairs(0.0)[0]
    still["synchronous"] |= {"direct_j": float("nan"), "message": "axis 2: 99.1 % of its torque"}
    found = failures_of([lost(18.5), still, lost(17.25)])
    assert [(each.what, each.count) for each in found] == [(NO_PAIR, 2), (NOT_DRIVEN, 1)]
    assert "18.5 mm" in found[0].example
    words = said([lost(18.5), still, lost(17.25)])
    assert "2 pairs without both movements, since on it t_f2" in words
    assert "1 movement without a measurement, since axis 2" in words
    page = page_html(findings_of([lost(18.5), still, lost(17.25)]), ASKED)
    assert "What was left out" in page
    assert "axis 2" in page


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (
            replace(ASKED, objective="time"),
            "none may be slower: a rule, no finding. Slower are 1 of 3",
        ),
        (ASKED, "1 of 3 take longer"),
        (replace(ASKED, planner=""), "better by time_and_energy as predicted"),
    ],
)
def test_what_a_rule_of_the_planner_makes_is_no_finding(
    asked: StatisticsSettings, words: str
) -> None:
    assert words in said(pairs(0.1, 0.0, -0.1, column="duration_s"), asked)


def test_one_robot_says_little_of_the_predicted_interval() -> None:
    assert "all of one robot" in said(pairs(0.1, 0.2))
    assert "by a robot drawn for it" in said(pairs(0.1, 0.2), replace(ASKED, plant=DRAWN))


def test_each_pair_has_a_robot_of_its_own() -> None:
    assert [replace(ASKED, plant=DRAWN).plant_of(k) for k in (0, 7)] == ["typical:0", "typical:7"]
    assert ASKED.plant_of(7) == "typical:0"


def test_effects_have_the_usual_words() -> None:
    words = [effect_words(d).split(" beside")[0] for d in (0.1, -0.2, 0.5, -0.8, 3.0)]
    assert words == ["very small", "small", "medium", "large", "large"]


def test_the_summary_has_every_comparison_and_agreement() -> None:
    lines = summed_up(findings_of(pairs(0.1, 0.2, 0.3))).splitlines()
    assert len(lines) == 1 + 8 + 2
    assert lines[-1].startswith('"indirect against direct",3,6,')


def test_differences_that_are_alike_up_to_rounding_show_nothing() -> None:
    rows = pairs(*[0.1] * 40)
    for k, row in enumerate(rows):
        for timing, share in zip(SIDES, (1.0, 1.1), strict=True):
            row[timing]["direct_j"] = (100.0 + 7.3 * k) * share
    assert "energy, direct: +10.00 % in 40 pairs, all alike" in said(rows)


def test_small_differences_keep_a_digit_and_movements_in_the_interval_are_counted() -> None:
    rows = pairs(*(3e-5 + 1e-6 * (-1) ** k for k in range(300)))
    rows[0]["synchronous"]["direct_j"] = 300.0
    assert "energy of 599 of 600 movements" in said(rows)
    assert "+0.003 % (+0.003 % to +0.003 %" in said(rows[1:])
