"""What a program would cost if: a row for each combination, the same with any number of workers."""

from __future__ import annotations

import math

import pytest

from ir_planner import RequestError, what_if

VALUES = {"mass gripper": [0.5, 400.0], "y pick": [0.0]}


@pytest.fixture(scope="module")
def table() -> list[dict[str, float | bool | str]]:
    return what_if("kr6_bench", VALUES)


def test_a_row_holds_its_values_and_what_the_program_costs(table: list[dict[str, object]]) -> None:
    light, heavy = table
    assert [light["mass gripper"], light["y pick"]] == [0.5, 0.0]
    assert light["certified"] is True
    assert light["joules_low"] < light["joules"] < light["joules_high"]  # type: ignore[operator]
    assert light["kwh"] == pytest.approx(light["joules"] / 3.6e6)  # type: ignore[operator]
    assert math.isnan(heavy["joules"])  # type: ignore[arg-type]
    assert "carries at most" in str(heavy["sentence"])
    assert set(light) == set(heavy)


@pytest.mark.long
def test_workers_change_nothing(table: list[dict[str, object]]) -> None:
    assert str(what_if("kr6_bench", VALUES, workers=2)) == str(table)


@pytest.mark.parametrize(
    ("name", "known"),
    [("mass gear", "gripper"), ("x nowhere", "tray_in"), ("colour", "cycle_time")],
)
def test_what_nobody_can_change_lists_what_can_be(name: str, known: str) -> None:
    with pytest.raises(RequestError, match=known):
        what_if("kr6_bench", {name: [1.0]})


def test_no_rows_and_no_workers_are_refused() -> None:
    with pytest.raises(RequestError, match="at least 1 worker"):
        what_if("kr6_bench", {"cycle_time": [0.0]}, workers=0)
    with pytest.raises(RequestError, match="0 rows"):
        what_if("kr6_bench", {"cycle_time": []})
