"""The summary of the statistics: counts, a table with intervals, notes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ir_recorder.report.money_text import money
from ir_recorder.report.number_text import DASH, kilowatt_hours
from ir_recorder.report.prices import Costs
from ir_studies.statistics.findings import NO_PAIR, NOT_DRIVEN, failures_of, findings_of
from ir_studies.statistics.outputs import (
    FEW,
    page_html,
    percent,
    summary_of,
    summed_up,
)
from ir_studies.statistics.settings import DRAWN, StatisticsSettings

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
    """The summary."""
    return summary_of(findings_of(rows), settings)


def line(rows: list[dict[str, Any]], name: str = "energy, direct") -> list[str]:
    """The cells of a comparison in the table of the summary, without its name."""
    found = next(each for each in said(rows).splitlines() if each.startswith(f"{name}  "))
    return found.removeprefix(name).split("  ")


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
    assert line(rows)[-1] != "yes"


def test_a_mean_stands_beside_its_interval() -> None:
    rows = pairs(*([0.01, -0.01] * 20))
    assert "-0.27 to +0.27" in said(rows)
    assert line(rows)[-1] != "yes"


def test_figures_that_differ_by_rounding_are_alike() -> None:
    rows = pairs(*(1e-14 * k for k in range(1, 40)), column="movement_cost")
    found = findings_of(rows)
    cost = next(each for each in found.comparisons if each.name == "movement cost")
    assert (cost.less, cost.more, cost.outside, cost.shown) == (0, 0, False, False)


@pytest.mark.parametrize(
    ("shares", "words"),
    [
        ((0.0, 0.05, 0.1), "<b>Predicted energies are 7.3 % too low</b>"),
        ((-0.5, -0.4), "% too high, which may be chance."),
        ((), ""),
    ],
)
def test_the_page_says_first_how_far_the_prediction_is_off(
    shares: tuple[float, ...], words: str
) -> None:
    page = page_html(findings_of(pairs(*shares)), ASKED)
    assert "Simulated, not measured" in page.partition("<main>")[0]
    answer = page.partition('<section id="answer">')[2].partition("</section>")[0]
    assert words in answer
    assert bool(answer) == bool(shares)
    if shares:
        assert f"of {2 * len(shares)} simulated ones lie in the predicted 90 % interval" in answer
        assert page.index(answer) < page.index('class="dots"')
        assert "intervals begin at the prediction" in answer


def test_what_lies_beyond_the_axis_is_an_arrow_at_its_end() -> None:
    """It was a dot at the edge, as if it lay there."""
    rows = pairs(*([0.001, -0.001] * 40), 9.0)
    drawn = page_html(findings_of(rows), ASKED).partition('id="timings"')[2]
    energy = drawn.partition(">energy, direct</text>")[2].partition('class="name"')[0]
    assert energy.count('class="out"') == 1
    assert ">+900 %</text>" in energy
    assert energy.count("<circle") == 80


@pytest.mark.parametrize("shares", [(), (0.1,), (0.1, 0.1), (0.0, 0.0)])
def test_few_or_equal_pairs_have_no_interval(shares: tuple[float, ...]) -> None:
    rows = pairs(*shares)
    assert f"{len(shares):>6}  compared" in said(rows)
    assert ("Fewer than" in said(rows)) == bool(shares)
    assert ("Fewer than" in page_html(findings_of(rows), ASKED)) == bool(shares)
    if shares:
        assert percent(100.0 * shares[0]) in " ".join(line(rows))
        assert " to " not in " ".join(line(rows))


def test_movements_that_were_drawn_again_are_counted() -> None:
    words = said(pairs(0.1, 0.1, 0.1, number=7))
    assert "     3  compared\n     1  different movements among these" in words


def test_all_coincide_and_nothing_is_compared() -> None:
    rows = [
        {"synchronous": movement("synchronous", 0), "asynchronous": movement("synchronous", 0)}
    ] * 3
    found = findings_of(rows)
    assert (found.solved, found.same, found.driven) == (3, 3, 3)
    assert "     3  same answer in both\n     0  compared" in said(rows)
    assert "a rule, no finding" not in said(rows)
    assert f"Fewer than {FEW} pairs may miss" in said(rows)


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
    assert "left out: 2 pairs without both movements: on it t_f2" in words
    assert "left out: 1 movements without a measurement: axis 2" in words
    page = page_html(findings_of([lost(18.5), still, lost(17.25)]), ASKED)
    assert "What was left out" in page
    assert "axis 2" in page


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (replace(ASKED, objective="time"), "none may be slower; a rule, no finding"),
        (ASKED, "A named planner lets joints move asynchronously wherever it can"),
        (replace(ASKED, planner=""), "better by the objective as predicted: a rule, no finding"),
    ],
)
def test_what_a_rule_of_the_planner_makes_is_no_finding(
    asked: StatisticsSettings, words: str
) -> None:
    summary = said(pairs(0.1, 0.0, -0.1, column="duration_s"), asked)
    assert words in summary
    assert "     1  asynchronous takes longer" in summary


def test_one_robot_says_little_of_the_predicted_interval() -> None:
    assert "One robot says little" in said(pairs(0.1, 0.2))
    assert "One robot says little" not in said(pairs(0.1, 0.2), replace(ASKED, plant=DRAWN))


def test_each_pair_has_a_robot_of_its_own() -> None:
    assert [replace(ASKED, plant=DRAWN).plant_of(k) for k in (0, 7)] == ["typical:0", "typical:7"]
    assert ASKED.plant_of(7) == "typical:0"


def test_the_summary_has_every_comparison_and_agreement() -> None:
    lines = summed_up(findings_of(pairs(0.1, 0.2, 0.3))).splitlines()
    assert len(lines) == 1 + 8 + 2
    assert lines[-1].startswith('"indirect against direct",3,6,')


def test_differences_that_are_alike_up_to_rounding_show_nothing() -> None:
    rows = pairs(*[0.1] * 40)
    for k, row in enumerate(rows):
        for timing, share in zip(SIDES, (1.0, 1.1), strict=True):
            row[timing]["direct_j"] = (100.0 + 7.3 * k) * share
    assert [cell.strip() for cell in line(rows) if cell.strip()][:3] == ["40", "+10.00", DASH]


def test_small_differences_keep_a_digit_and_movements_in_the_interval_are_counted() -> None:
    rows = pairs(*(3e-5 + 1e-6 * (-1) ** k for k in range(300)))
    rows[0]["synchronous"]["direct_j"] = 300.0
    assert "   599  simulated within the predicted 90 % interval" in said(rows)
    assert "+0.003 to +0.003" in said(rows[1:])
    assert [percent(value) for value in (0.0, -3e-5, 12.0)] == ["0.00", "0.00", "+12.00"]


def test_settings_stand_as_a_table_without_the_empty_ones() -> None:
    """Once a dictionary in braces."""
    page = page_html(findings_of(pairs(0.1, 0.2)), ASKED)
    shown = page.partition("<h2>Settings</h2>")[2].partition("</details>")[0].replace("<wbr>", "")
    assert "{" not in shown
    for name, value in ASKED.budget.items():
        assert (f"<code>{name}</code>" in shown) == (value not in ("", (), {}))
    assert ">0.02<" in shown


def test_what_is_off_is_no_green_badge_and_pairs_without_a_plan_are_said() -> None:
    shares = np.random.default_rng(4).normal(0.05, 0.02, 20).tolist()
    lost = {timing: {"solved": False, "message": "no path"} for timing in SIDES}
    page = page_html(findings_of([*pairs(*shares), lost]), ASKED)
    assert '<p class="verdict open">7.3 % too low</p>' in page
    assert "1 of 21 pairs could not be planned." in page


@pytest.mark.parametrize("driven", [True, False])
def test_a_manager_reads_what_movements_cost(driven: bool) -> None:
    """The page had percent alone: no kWh, and no money but of 100 EUR."""
    rows = pairs(0.1, 0.2, -0.1, 0.3)
    for row in rows:
        for side in SIDES:
            scale = 36.0  # of 100 J: 3.6 kJ, so that a million movements are 1 MWh
            figures = ("direct_j", "indirect_j", "predicted_j")
            row[side] |= {name: scale * row[side][name] for name in figures}
            if not driven:
                row[side] |= {"direct_j": float("nan"), "indirect_j": float("nan")}
    found = findings_of(rows)
    answer = page_html(found, ASKED).split('<section id="answer">')[1].partition("</section>")[0]
    costs = Costs()
    if driven:
        (each,) = (one for one in found.agreements if one.name.startswith("predicted"))
        meter, predicted = each.levels[1], each.levels[0]
    else:
        (each,) = (one for one in found.comparisons if one.name == "energy, predicted")
        meter = predicted = each.levels[1]
    for joules in {meter, predicted}:
        words = f"{kilowatt_hours(1e6 * joules)}, {money(costs.money(1e6 * joules), 'EUR')}"
        assert words in answer
    assert "at 0.2 EUR/kWh, assumed" in answer
    assert ("on the meter" in answer) == driven
    assert "With asynchronous joints a million takes " in answer
    shown = any(one.shown for one in found.comparisons if one.name.startswith("energy"))
    assert ("which is not shown" in answer) != shown
