"""What a cycle costs: right by its own arithmetic, and every assumption named as one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from ir_recorder import Analysis, analyse
from ir_recorder.analysis.production import production_of
from ir_recorder.errors import RecorderError
from ir_recorder.report.costs import (
    NAMES,
    Costs,
    costs_section,
    lever_section,
    read_costs,
)
from ir_values.settings import settings_table

GIVEN = """format: ir_costs/1
price: 0.5
currency: CHF
grid: 0.1
shift_hours: 10
shifts_per_day: 1
days_per_year: 100
parts_per_cycle: 2
availability: 1.0
"""


def test_a_file_says_what_a_joule_costs(tmp_path: Path) -> None:
    path = tmp_path / "costs.yaml"
    path.write_text(GIVEN)
    costs = read_costs(path)
    assert costs.money(7.2e6) == pytest.approx(1.0)
    assert costs.co2(7.2e6) == pytest.approx(0.2)
    assert costs.cycles_per_shift(60.0) == pytest.approx(600.0)
    assert costs.cycles_per_year(60.0) == pytest.approx(60_000.0)
    assert set(costs.given) == set(NAMES)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("price: 0.2", "begins with format"),
        ("format: ir_costs/1\nprize: 0.2", "prize is unknown, known are price"),
        ("format: ir_costs/1\nprice: cheap", "must be a number"),
        ("format: ir_costs/1\nprice: true", "must be a number"),
        ("format: ir_costs/1\nprice: -1", "price is -1"),
        ("format: ir_costs/1\nprice: .nan", "must be finite"),
        ("format: ir_costs/1\navailability: 2", "availability is 2"),
        ("format: ir_costs/1\ncurrency: 12", "must be a text"),
        (
            "format: ir_costs/1\nprice: 1\nprice: 2",
            r"yaml:3: 'price' stands here twice",
        ),
        ("format: [", "costs.yaml"),
        ("[" * 5000, "costs.yaml"),
        (
            "format: ir_costs/1\nshift_hours: 12\nshifts_per_day: 3",
            "together they must be at most 24 h a day",
        ),
        ('format: ir_costs/1\ncurrency: "a\\nb"', "at most 12 characters in one line"),
        ("format: ir_costs/1\ncurrency: '  '", "at most 12 characters in one line"),
    ],
)
def test_a_file_that_makes_no_sense_is_a_sentence(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "costs.yaml"
    path.write_text(text)
    with pytest.raises(RecorderError, match=words):
        read_costs(path)


def test_assumptions_are_marked_and_given_figures_are_not(analysis: Analysis) -> None:
    assumed = costs_section(analysis, Costs())
    assert assumed.count("(assumed)") == len(NAMES)
    own = costs_section(analysis, replace(Costs(), price=0.5, given=("price",)))
    assert own.count("(assumed)") == len(NAMES) - 1
    assert "price 0.5," in own
    assert "(assumed)" not in costs_section(analysis, replace(Costs(), given=NAMES))


def test_the_cycle_is_the_one_with_full_pauses(analysis: Analysis) -> None:
    run = production_of(analysis)
    full = production_of(
        analyse(replace(analysis.recording, facts=(("unshortened_pauses", "600 s, 1800 s"),)))
    )
    assert run is not None
    assert full is not None
    assert full.seconds > 2400.0
    assert full.energy > run.energy
    assert "full pauses" in full.name


def test_markup_in_a_currency_stays_text(analysis: Analysis) -> None:
    costs = replace(Costs(), currency="<b>x</b>")
    assert "<b>x" not in costs_section(analysis, costs) + lever_section(analysis, costs)


def test_the_documentation_has_the_table_of_the_settings() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "report.md").read_text(encoding="utf-8")
    rows = [row for row in settings_table(Costs()).splitlines() if not row.startswith("| `given`")]
    assert "\n".join(rows) in page


def test_without_a_program_there_is_nothing_to_pay(analysis: Analysis) -> None:
    bare = analyse(replace(analysis.recording, events=(), savings=()))
    assert costs_section(bare, Costs()) == ""
    assert lever_section(bare, Costs()) == ""
