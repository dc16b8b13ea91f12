"""A settings class describes itself: ranges for the check, a table for the documentation."""

from __future__ import annotations

import re
from dataclasses import dataclass

import pytest

from ir_values.errors import InvalidValueError
from ir_values.settings import check_settings, describe, setting, settings_table


@dataclass(frozen=True)
class Oven:
    heat: float = setting(180.0, "Temperature wanted.", unit="degC", minimum=0.0, maximum=250.0)
    racks: int = setting(2, "Racks inside.", minimum=1, read_only=True)
    fan: bool = setting(True, "Whether the fan turns.")
    program: str = setting("bake", "What to do.", choices=("bake", "grill"))
    steps: tuple[float, ...] = setting((1.0, 2.0), "Durations.", unit="s", minimum=0.0)

    def __post_init__(self) -> None:
        check_settings(self)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"heat": 300.0}, "heat is 300 degC: it must be 0 .. 250 degC"),
        ({"heat": float("nan")}, "heat is nan: it must be finite"),
        ({"racks": 0}, "racks is 0: it must be at least 1"),
        ({"program": "fry"}, 'program is "fry": known are bake, grill'),
        (
            {"program": "\x1b[2J" + "x" * 20_000},
            'program is "\\x1b[2J' + "x" * 70 + '...": known are bake, grill',
        ),
        ({"steps": (1.0, -1.0)}, "steps is -1 s: it must be at least 0 s"),
    ],
)
def test_a_value_out_of_range_is_named(changes, sentence):
    with pytest.raises(InvalidValueError, match=re.escape(sentence)):
        Oven(**changes)


def test_the_table_of_the_documentation_has_a_row_per_setting():
    table = settings_table(Oven(), prefix="oven.").splitlines()
    assert table[0] == "| Parameter | Default | Unit | Range | Meaning |"
    assert table[2] == "| `oven.heat` | 180.0 | degC | 0 .. 250 degC | Temperature wanted. |"
    assert table[3] == "| `oven.racks` | 2 |  | at least 1 | Racks inside. Fixed at start. |"
    assert len(table) == 2 + len(describe(Oven))


def test_a_field_without_description_is_refused():
    @dataclass(frozen=True)
    class Bare:
        heat: float = 1.0

    with pytest.raises(InvalidValueError, match=r"Bare\.heat has no description"):
        describe(Bare)
