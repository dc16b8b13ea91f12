"""Law: parts of an amount of money that stand beside their sum add up to it as they are shown."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_recorder import Analysis, findings
from ir_recorder.analysis.production import PREDICTED, Amount
from ir_recorder.report import report_html
from ir_recorder.report.compare import comparison_html
from ir_recorder.report.costs import Costs
from ir_recorder.report.fleet import Member, fleet_html, member_of
from ir_recorder.report.money_text import (
    adding_up,
    groups_adding_up,
    money,
    money_of,
    yearly_money,
)
from ir_recorder.report.robots import robots_html

AMOUNTS = st.lists(st.floats(-1e4, 1e5, allow_subnormal=False), min_size=1, max_size=9)
EUR = re.compile(r"(-?\d[\d\s\u00a0\u202f]*(?:\.\d+)?) EUR")
Scattered = Callable[[Analysis, int], Analysis]


def shown(words: str) -> float:
    """The first amount of a text."""
    found = EUR.search(words)
    assert found is not None, words
    return float(re.sub(r"\s", "", found[1]))


def plain(page: str) -> str:
    return re.sub(r"</?data[^>]*>", "", page)


@given(AMOUNTS, st.floats(0.0, 100.0))
def test_parts_add_up_and_none_is_off_by_a_whole_digit(parts: list[float], more: float) -> None:
    total = math.fsum(parts)
    for words, found in (
        (yearly_money(total, "EUR"), adding_up(parts, "EUR")),
        (money(total, "EUR"), adding_up(parts, "EUR", yearly=False)),
        (
            money_of(Amount(total, total - more - 1.0, total + more), "EUR"),
            adding_up(parts, "EUR", max(abs(total - more - 1.0), abs(total + more))),
        ),
    ):
        if not EUR.fullmatch(words):
            continue  # practically nothing
        decimals = len(words.removesuffix(" EUR").partition(".")[2])
        assert sum(map(shown, found)) == pytest.approx(shown(words), abs=1e-6)
        for part, each in zip(parts, found, strict=True):
            assert abs(shown(each) - part) < 1.000001 * 10.0**-decimals


@given(st.lists(AMOUNTS, min_size=1, max_size=4))
def test_groups_and_their_parts_add_up(groups: list[list[float]]) -> None:
    found = groups_adding_up(groups, "EUR")
    for whole, parts in found:
        assert sum(map(shown, parts)) == pytest.approx(shown(whole), abs=1e-6)
    divided = groups_adding_up([[math.fsum(group)] for group in groups], "EUR")
    assert [whole for whole, _ in divided] == [whole for whole, _ in found]
    total = yearly_money(math.fsum(part for group in groups for part in group), "EUR")
    if EUR.fullmatch(total):
        assert sum(shown(whole) for whole, _ in found) == pytest.approx(shown(total), abs=1e-6)


def test_what_each_rounds_to_by_itself_does_not_add_up() -> None:
    """The judge sees what the rule mends."""
    assert [yearly_money(each, "EUR") for each in (10.4, 10.4)] == ["10 EUR", "10 EUR"]
    assert adding_up((10.4, 10.4), "EUR") == ["11 EUR", "10 EUR"]
    assert adding_up((math.nan, 1.0), "EUR") == ["–", "–"]


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


def fleet_of(analysis: Analysis, scattered: Scattered) -> list[Member]:
    """Robots of different costs, of which one's plan nobody drove."""
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


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(6))
def test_tables_of_a_bill_add_up(analysis: Analysis, scattered: Scattered, seed: int) -> None:
    costs = Costs(price=float(np.random.default_rng(seed).uniform(0.05, 2.0)))
    fleet = plain(fleet_html(fleet_of(analysis, scattered), costs=costs))
    table = rows_of(fleet, "Robots")
    robots = [cells for name, cells in table.items() if name.startswith("robot ")]
    assert len(robots) == 4
    for column in (1, 2, 3):
        known = [cells[column] for cells in robots if EUR.search(cells[column])]
        assert sum(map(shown, known)) == pytest.approx(shown(table["all"][column]), abs=1e-6)
    for cells in (*robots, table["all"]):
        parts = EUR.findall(cells[3].rpartition("\n")[2])
        values = [float(re.sub(r"\s", "", part)) for part in parts]
        assert sum(values) == pytest.approx(shown(cells[3]), abs=1e-6)
    page = plain(report_html(analysis, findings(analysis), costs=costs))
    saved = rows_of(page, "What a cycle costs")
    for column in (2, 3, 4):
        parts = [saved[f"saved {name}"][column] for name in ("by its movements", "in its pauses")]
        whole = saved["saved together"][column]
        if all(EUR.search(words) for words in (*parts, whole)):
            assert sum(map(shown, parts)) == pytest.approx(shown(whole), abs=1e-9)
    pair = [(analysis, findings(analysis))] * 2
    side = rows_of(plain(comparison_html(pair, costs=costs)), "For those who pay")
    parts = [side["saved by its plan, a year"], side["saved at night and at weekends, a year"]]
    for column in (1, 2):
        each = sum(shown(row[column]) for row in parts)
        assert each == pytest.approx(shown(side["both together, a year"][column]), abs=1e-9)
    both = plain(robots_html({"left": analysis, "right": analysis}, (), costs))
    parts_of = rows_of(both, "Robots")
    each = sum(shown(parts_of[name][1]) for name in ("left", "right"))
    assert each == pytest.approx(shown(parts_of["all together"][1]), abs=1e-9)
    for made in (fleet, page, both):
        year = made.split('<section id="year">')[1].partition("</section>")[0]
        for value, note in re.findall(r"<b>([^<]*EUR)</b><small>([^<]*EUR outside)", year):
            assert sum(map(shown, note.split(","))) == pytest.approx(shown(value), abs=1e-9)
        assert "rounded by itself" not in made


NIGHTS = re.compile(r"at night and at weekends: ([^(<]*) \(")


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(6))
def test_what_nights_save_is_one_amount_on_a_page(
    analysis: Analysis, scattered: Scattered, seed: int
) -> None:
    """In a list of steps, and in tables with a sum: as a part it was another by one."""
    costs = Costs(price=float(np.random.default_rng(seed).uniform(0.05, 2.0)))
    pair = [
        (replace(each, recording=replace(each.recording, path=Path(f"{k}.mcap"))), ())
        for k, each in enumerate(scattered(analysis, k) for k in range(2))
    ]
    page = plain(comparison_html(pair, costs=costs))
    (said,) = NIGHTS.findall(page)
    rows = rows_of(page, "For those who pay")
    assert shown(said) == shown(rows["saved at night and at weekends, a year"][1])
    fleet = plain(fleet_html(fleet_of(analysis, scattered), costs=costs))
    (said,) = NIGHTS.findall(fleet)
    row = rows_of(fleet, "Robots")["all"][3]
    (part,) = re.findall(r"([\d\s.]+ EUR) at night", row)
    measures = rows_of(fleet, "What could still be saved")
    assert shown(said) == shown(part) == shown(measures["at night and at weekends"][1])
