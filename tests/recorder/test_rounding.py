"""Law: every figure is rounded from its own value, alike on all pages, and a page with sums says
so: what is shown of parts may differ from their sum by a last digit, what is shown of one amount
never differs from page to page.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_planner import Planner
from ir_planner.before_after import before_after_common
from ir_recorder import Analysis, findings
from ir_recorder.analysis.production import PREDICTED
from ir_recorder.report import report_html
from ir_recorder.report.before_after import before_after_html
from ir_recorder.report.fleet import fleet_html
from ir_recorder.report.fleet_members import Member, member_of
from ir_recorder.report.money_text import money, yearly_money
from ir_recorder.report.number_text import (
    joules,
    kilograms,
    kilowatt_hours,
    watt_hours,
    watts,
    yearly_kilowatt_hours,
)
from ir_recorder.report.prices import ROUNDED, Costs
from ir_recorder.report.robots import robots_html
from ir_recorder.report.side_by_side import comparison_html

NUMBER = re.compile(r"-?\d[\d\s\u00a0\u202f]*(?:\.\d+)?")
SCALES = {"kWh": 3.6e6, "Wh": 3600.0, "kJ": 1000.0, "J": 1.0, "W": 1.0, "kg": 1.0, "EUR": 1.0}
SHOWN: tuple[Callable[[float], str], ...] = (
    lambda value: money(value, "EUR"),
    lambda value: yearly_money(value, "EUR"),
    joules,
    kilograms,
    kilowatt_hours,
    watt_hours,
    watts,
    yearly_kilowatt_hours,
)
AMOUNT = re.compile(r'<data value="([a-z]+):([^"]*)">([^<]*)</data>')
SINGLE = ("m", "y")
OTHERS = ("s", "h", "t", "p")
"""Kinds of single amounts, and of ends of intervals, hours, months and the price."""
Scattered = Callable[[Analysis, int], Analysis]


def off(words: str, value: float) -> float:
    """How far what is shown lies from a value, in units of its last digit; of Wh, which have three
    that count however many there are, of the third.
    """
    found = NUMBER.match(words)
    assert found is not None, words
    digits = re.sub(r"\s", "", found[0])
    unit = SCALES[words.rpartition(" ")[2]]
    exact = float(digits) * unit
    last = 10.0 ** -len(digits.partition(".")[2]) * unit
    if words.endswith(" Wh") and exact:
        last = max(last, 10.0 ** (math.floor(math.log10(abs(exact) / unit)) - 2) * unit)
    return abs(exact - value) / last


@given(st.floats(-1e9, 1e9), st.sampled_from(SHOWN))
def test_a_figure_is_its_own_value_rounded(value: float, show: Callable[[float], str]) -> None:
    words = show(value)
    if NUMBER.match(words):  # else in words: practically nothing
        assert off(words, value) <= 0.500001 + 1e-9 * abs(value)


def amounts(page: str) -> Iterator[tuple[str, float, str]]:
    """Kind, exact value and text of each single amount that a page shows."""
    for kind, values, words in AMOUNT.findall(page):
        assert kind in (*SINGLE, *OTHERS), "rounded by another rule"
        if kind in SINGLE:
            yield kind, float(values), words


def fleet_of(analysis: Analysis, scattered: Scattered) -> list[Member]:
    """Robots of different costs, of which one's plan nobody drove; the first is the report's."""
    members = []
    for k in range(4):
        member = member_of(scattered(analysis, k), f"robot {k}")
        assert member is not None
        members.append(member)
    cycle = members[-1].cycle
    assert cycle.savings is not None
    planned = cycle.savings.total.planned
    own = replace(cycle, origin=PREDICTED, energy=planned, low=planned, high=planned)
    return [*members[:-1], replace(members[-1], cycle=own)]


def pages_of(analysis: Analysis, scattered: Scattered, costs: Costs) -> dict[str, str]:
    """Every page of recordings, one of them on all."""
    own = scattered(analysis, 0)
    first = replace(own, recording=replace(own.recording, path=Path("first.mcap")))
    pair = [(first, findings(first)), (scattered(analysis, 1), ())]
    return {
        "report": report_html(own, findings(own), costs=costs),
        "recordings": comparison_html(pair, costs=costs),
        "fleet": fleet_html(fleet_of(analysis, scattered), costs=costs),
        "fleet of one": fleet_html(fleet_of(analysis, scattered)[:1], costs=costs),
        "robots": robots_html({"left": own, "right": own}, (), costs),
    }


def alike(pages: dict[str, str]) -> None:
    """One amount is one text on all pages, its own value rounded, and each page says so."""
    texts: dict[tuple[str, float], str] = {}
    for name, page in pages.items():
        found = list(amounts(page))
        assert len(found) > 10, name
        for kind, value, words in found:
            if NUMBER.match(words):
                assert off(words, value) <= 0.50001, (name, value, words)
            size = kind if abs(value) < 1.0 else ""  # of a part of a cent more digits
            assert texts.setdefault((size, value), words) == words, (name, value)
        assert ROUNDED in page, name


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(6))
def test_an_amount_is_one_text_on_all_pages(
    analysis: Analysis, scattered: Scattered, seed: int
) -> None:
    """The nights of a programme were 217 EUR on one page and 216 on another: there a part of a sum
    was rounded so that the sum as shown came out.
    """
    costs = Costs(price=float(np.random.default_rng(seed).uniform(0.05, 2.0)))
    alike(pages_of(analysis, scattered, costs))


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(3))
def test_changes_of_a_program_are_rounded_by_themselves(seed: int) -> None:
    planner = Planner("open", clock=lambda: 0.0)
    home = planner.cell.machine_home
    found = before_after_common(planner, ("p1", "p2", "home"), home, 30.0)
    costs = Costs(price=float(np.random.default_rng(seed).uniform(0.05, 2.0)))
    alike({"before and after": before_after_html(found, planner.cell, costs)})


NIGHTS = re.compile(r"at night and at weekends: ([^(<]*) \(")


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(6))
def test_what_nights_save_is_one_amount(
    analysis: Analysis, scattered: Scattered, seed: int
) -> None:
    """In lists of what to do and in tables, of one recording on its page, side by side with another
    and in a fleet of its own.
    """
    costs = Costs(price=float(np.random.default_rng(seed).uniform(0.05, 2.0)))
    made = pages_of(analysis, scattered, costs)
    said = {
        name: {words.strip() for words in NIGHTS.findall(plain(made[name]))}
        for name in ("report", "recordings", "fleet of one")
    }
    assert len(set.union(*said.values())) == 1, said
    (words,) = said["report"]
    rows = rows_of(plain(made["recordings"]), "For those who pay")
    assert rows["saved at night and at weekends, a year"][1].startswith(words)
    rows = rows_of(plain(made["fleet of one"]), "Robots")
    (row,) = (cells for name, cells in rows.items() if name == "robot 0")
    assert f"{words} at night" in row[3]


def plain(page: str) -> str:
    return re.sub(r"</?data[^>]*>", "", page)


def rows_of(page: str, caption: str) -> dict[str, list[str]]:
    """Rows of a table by their first words, cells as text with lines for small letters."""
    found = {}
    for table in re.findall(r"<table.*?</table>", page, re.DOTALL):
        if f">{caption}</caption>" not in table:
            continue
        for row in re.findall(r"<tr[^>]*>(.*?)</tr>", table, re.DOTALL):
            cells = re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row, re.DOTALL)
            lines = [re.sub(r"<[^>]*>", "", cell.replace("<small>", "\n")) for cell in cells]
            found[lines[0].partition("\n")[0]] = lines
    return found


def test_the_judge_sees_a_figure_that_is_off() -> None:
    assert off("217 EUR", 216.4) == pytest.approx(0.6)
    assert off("1.24 kWh", 1.234 * 3.6e6) == pytest.approx(0.6)
    assert yearly_money(math.nan, "EUR") == "–"
