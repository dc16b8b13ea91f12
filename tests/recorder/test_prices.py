"""Law: a page at a price that its reader types says what a page made with that price says.

Needs Chromium. Without it the tests in a browser say `not checked: browser`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ir_recorder import Analysis, findings
from ir_recorder.analysis.production import PREDICTED
from ir_recorder.report import report_html
from ir_recorder.report.fleet import fleet_html
from ir_recorder.report.fleet_members import Member, member_of
from ir_recorder.report.money_text import Repriced, money, with_elements, yearly_money
from ir_recorder.report.prices import Costs
from ir_recorder.report.robots import robots_html
from ir_recorder.report.side_by_side import comparison_html

TYPED = (0.31, 0.087, 1.9)
AMOUNTS = "[...document.querySelectorAll('data[value]')].map((each) => each.textContent)"
TYPE = """((price) => {
    const field = document.getElementById('price');
    field.value = price;
    field.dispatchEvent(new Event('input'));
})"""


def report(analysis: Analysis, costs: Costs) -> str:
    return report_html(analysis, findings(analysis), costs=costs)


def recordings(analysis: Analysis, costs: Costs) -> str:
    other = replace(analysis, recording=replace(analysis.recording, path=Path("other.mcap")))
    checks = findings(analysis)
    return comparison_html([(analysis, checks), (other, checks)], costs=costs)


def fleet(analysis: Analysis, costs: Costs) -> str:
    member = member_of(analysis, "robot")
    assert member is not None
    return fleet_html([member, replace(member, robot="second")], costs=costs)


def robots(analysis: Analysis, costs: Costs) -> str:
    return robots_html({"left": analysis, "right": analysis}, (), costs)


PAGES: tuple[Callable[[Analysis, Costs], str], ...] = (report, recordings, fleet, robots)


@pytest.mark.parametrize(
    "made",
    [fleet, *(pytest.param(made, marks=pytest.mark.long) for made in (report, recordings, robots))],
)
def test_a_typed_price_says_what_a_page_of_that_price_says(
    browser: Any, analysis: Analysis, tmp_path: Path, made: Callable[[Analysis, Costs], str]
) -> None:
    def shown(costs: Costs, name: str) -> Any:
        path = tmp_path / f"{name}.html"
        path.write_text(made(analysis, costs), encoding="utf-8")
        return browser.open(path, 1400, 900)

    page = shown(Costs(price=0.2), "given")
    before = page.run(AMOUNTS)
    for price in TYPED:
        page.run(f"{TYPE}('{price}')")
        typed = page.run(AMOUNTS)
        other = shown(Costs(price=price), "other")
        assert typed == other.run(AMOUNTS)
        assert typed != before
        other.close()
    page.run(f"{TYPE}('0,2')")  # a comma, as many people write
    assert page.run(AMOUNTS) == before
    for nonsense in ("", "-1", "abc"):
        page.run(f"{TYPE}('{nonsense}')")
        assert page.run(AMOUNTS) == before
    page.close()


def test_no_amount_of_a_page_stands_still(analysis: Analysis) -> None:
    """Every figure with the currency of the page follows, but for those with a price of their own:
    a kilowatt of demand, an engineer's hour, and the night's, which is 0 where it has none.
    """
    costs = Costs(currency="CHF")
    for made in PAGES:
        page = re.sub(r"<(script|style).*?</\1>", "", made(analysis, costs), flags=re.DOTALL)
        left = re.sub(r"<data [^>]*>.*?</data> CHF|<data [^>]*>.*?</data>", "", page)
        figures = re.findall(r"[\d.]+(?: |\u00a0)CHF[^,<)]*", left)
        assert [
            each for each in figures if not each.endswith(("CHF/h", "CHF/kW", "0 CHF/kWh"))
        ] == []


def test_amounts_have_no_marks_where_no_price_can_be_typed(analysis: Analysis) -> None:
    """At night another price: amounts are in proportion to none."""
    night = Costs(price_night=0.1)
    for made in PAGES:
        page = made(analysis, night)
        assert "<data " not in page
        assert 'id="price"' not in page
        assert not re.search("[\ue000-\ue002]", page + made(analysis, Costs()))


@pytest.mark.parametrize("seed", range(5))
def test_marks_change_no_text(seed: int) -> None:
    values = 10.0 ** np.random.default_rng(seed).uniform(-6.0, 6.0, 50)
    for value in values.tolist():
        for show in (money, yearly_money):
            marked = with_elements(f'<i title="{show(value, Repriced("EUR"))}"></i>')
            assert marked == f'<i title="{show(value, "EUR")}"></i>'
            element = with_elements(f"<b>{show(value, Repriced('EUR'))}</b>")
            assert re.sub(r"</?data[^>]*>", "", element) == f"<b>{show(value, 'EUR')}</b>"


def rows_of(page: str) -> dict[str, float]:
    """What a year's bars carry beside their names."""
    year = page.split('<section id="year">')[1].partition("</section>")[0]
    rows = re.findall(r'class="label">(.*?)</span>.*?<b><data value="[a-z]:([^"]*)"', year)
    return {name: sum(map(float, values.split(","))) for name, values in rows}


def plain(page: str) -> str:
    """The page without the elements of its amounts of money."""
    return re.sub(r"</?data[^>]*>", "", page)


def shown_in(words: str) -> float:
    """The first amount of a text, as it is shown."""
    found = re.search(r"(-?[\d\s\u00a0\u202f.]+) ?EUR", words)
    assert found is not None, words
    return float(re.sub(r"\s", "", found[1]))


def bars_of(page: str) -> dict[str, float]:
    """What stands beside the bars of a year, by the first word of each."""
    year = plain(page.split('<section id="year">')[1].partition("</section>")[0])
    rows = re.findall(r'class="label">(.*?)</span>.*?<b>(.*?)</b>', year)
    return {name: shown_in(words) for name, words in rows}


def undriven(member: Member, robot: str) -> Member:
    """A robot whose plan nobody drove."""
    cycle = member.cycle
    assert cycle.savings is not None
    planned = cycle.savings.total.planned
    own = replace(cycle, origin=PREDICTED, energy=planned, low=planned, high=planned)
    return replace(member, robot=robot, cycle=own)


def mixed(analysis: Analysis, costs: Costs) -> str:
    member = member_of(analysis, "robot")
    assert member is not None
    return fleet_html([member, undriven(member, "second")], costs=costs)


@pytest.mark.sampled
@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 4))]
)
@pytest.mark.parametrize("made", [report, fleet, mixed])
def test_what_is_reached_and_what_is_left_are_the_differences_of_the_bars(
    analysis: Analysis,
    scattered: Callable[[Analysis, int], Analysis],
    made: Callable[[Analysis, Costs], str],
    seed: int,
) -> None:
    """Of what is computed; what is shown is each rounded by itself, so that every page shows the
    same. Of a driven plan nothing is asked for twice, and nothing is left out.
    """
    price = np.random.default_rng(seed).uniform(0.3, 3.0)
    page = made(scattered(analysis, seed), Costs(price=price))
    answer = page.split('<section id="answer">')[1].partition("</section>")[0]
    result = plain(answer.partition("</b>")[0])
    rows = rows_of(page)
    before = next(money for name, money in rows.items() if name.startswith("common program"))
    planned = next(money for name, money in rows.items() if name.startswith("planned program"))
    now = next(money for name, money in rows.items() if name.startswith(("as driven", "today")))
    assert rows["reached"] == pytest.approx(before - now, rel=1e-6)
    assert rows["still to save"] == pytest.approx(now - planned, rel=1e-6)
    for name, shown in bars_of(page).items():
        assert shown == shown_in(yearly_money(rows[name], "EUR"))
    amounts = [shown_in(part) for part in result.partition("<b>")[2].split(" of ")]
    together = rows["reached"] + rows["still to save"]
    assert amounts == [shown_in(yearly_money(each, "EUR")) for each in (rows["reached"], together)]
    done, left = answer.partition("Reached")[2].split("Still to save")
    assert "ibernation" in left
    assert "ibernation" not in done


@pytest.mark.parametrize("made", [report, fleet, mixed])
def test_the_bill_of_today_stands_beside_the_planned_one(
    analysis: Analysis, made: Callable[[Analysis, Costs], str]
) -> None:
    """It was in the middle of a sentence: what stands in the result is what the bars show."""
    page = plain(made(analysis, Costs()))
    answer = page.split('<section id="answer">')[1].partition("</section>")[0]
    result = answer.partition('<div class="do">')[0]
    bills = dict(re.findall(r"<dt>(.*?)</dt><dd>(.*?) <small>a year</small></dd>", result))
    names = list(bills)
    assert names[0].startswith("common program")
    assert names[-1].startswith("planned program")
    assert names[1] in ("as driven", "today")
    bars = bars_of(page)
    for name, bill in bills.items():
        assert shown_in(bill) in [money for label, money in bars.items() if label.startswith(name)]


def test_pages_of_savings_say_what_hours_of_an_engineer_they_pay(analysis: Analysis) -> None:
    costs = Costs(engineer_hour=37.0)
    for made in PAGES:
        page = plain(made(analysis, costs))
        answer = page.split('<section id="answer">')[1].partition("</section>")[0]
        assert re.search(r"pays for [\d.]+ h of an engineer a year \(37 EUR/h\)", answer), made


def test_a_page_counts_one_number_of_cycles_a_year(
    analysis: Analysis, scattered: Callable[[Analysis, int], Analysis]
) -> None:
    """However much longer than its plan a run took."""
    for seed in range(3):
        page = plain(report(scattered(analysis, seed), Costs()))
        shown = re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL)
        found = re.findall(r"(\d[\d\s\u00a0\u202f]*) cycles, one each", shown)
        assert len(found) > 1
        assert len(set(found)) == 1


def test_a_year_without_a_comparison_counts_nights(analysis: Analysis) -> None:
    alone = replace(analysis, recording=replace(analysis.recording, savings=()))
    for made in (report, robots):
        page = made(alone, Costs())
        rows = rows_of(page)
        answer = page.split('<section id="answer">')[1].partition("</section>")[0]
        (whole,) = re.findall(r'value="y:([^"]*)"', answer.partition("</b>")[0])
        driven = next(money for name, money in rows.items() if name.startswith("as driven"))
        assert driven == pytest.approx(float(whole))
        (deep,) = (money for name, money in rows.items() if name.endswith("in hibernation"))
        assert rows["still to save"] == pytest.approx(driven - deep)
