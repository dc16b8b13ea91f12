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
from ir_recorder.report import report_html
from ir_recorder.report.compare import comparison_html
from ir_recorder.report.costs import Costs
from ir_recorder.report.fleet import fleet_html, member_of
from ir_recorder.report.money_text import Repriced, money, with_elements, yearly_money
from ir_recorder.report.robots import robots_html

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


@pytest.mark.parametrize("made", PAGES)
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
