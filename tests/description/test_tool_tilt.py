"""How far a tool may lean, in the words of a cell file."""

from __future__ import annotations

import math

import pytest

from ir_description import Cell, cell_from_yaml, cell_hash, cell_to_yaml, load_cell
from ir_description.cell import ToolTilt
from ir_values.errors import CellFileError, InvalidValueError

PLACE = "{station: place, dwell: 0.5"


def with_step(keys: str) -> Cell:
    """The bench of the KR 6 whose second step has these keys."""
    text = cell_to_yaml(load_cell("kr6_bench"))
    assert PLACE in text
    return cell_from_yaml(text.replace(PLACE, f"{PLACE}, {keys}"))


def test_what_is_written_is_read_back() -> None:
    cell = with_step("tilt: {max_deg: 5, axis: [-2, 0, 0], direction: [0, 0, 1]}")
    assert cell.program[1].tilt == ToolTilt(math.radians(5.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    again = cell_from_yaml(cell_to_yaml(cell))
    assert again.program == cell.program
    assert cell_hash(again) == cell_hash(cell)
    assert with_step("tilt: {max: 0}").program[1].tilt == ToolTilt(0.0)


def test_stations_and_parts_have_one_too() -> None:
    lines = []
    for line in cell_to_yaml(load_cell("demo")).splitlines():
        lines.append(line)
        if line.endswith(("- name: lathe_work", "- name: gear")):
            lines.append(" " * line.index("name") + "tilt: {max: 0.2}")
    cell = cell_from_yaml("\n".join(lines))
    assert cell.part("gear").tilt == ToolTilt(0.2)
    assert cell.station("lathe_work").tilt == ToolTilt(0.2)
    assert cell_from_yaml(cell_to_yaml(cell)).part("gear").tilt == ToolTilt(0.2)
    moved = cell.with_station("lathe_work", cell.station("lathe_work").pose_in_equipment)
    assert moved.station("lathe_work").tilt == ToolTilt(0.2)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("tilt: {max_deg: 181}", "is 181 deg, must be in [0, 180] deg"),
        ("tilt: {max: 0.1, max_deg: 5}", "exactly one of max, max_deg"),
        ("tilt: {max: 0.1, axis: [0, 0, 0]}", "must have a length"),
        ("tilt: {max: 0.1, axis: [0, 0]}", "3"),
    ],
)
def test_what_makes_no_sense_is_refused(keys: str, said: str) -> None:
    with pytest.raises(CellFileError) as refused:
        with_step(keys)
    assert said in str(refused.value)


def test_a_pause_leans_nowhere() -> None:
    cell = load_cell("kr6_bench")
    with pytest.raises(InvalidValueError, match="stations and postures"):
        type(cell.program[2])(kind="PAUSE", dwell=1.0, power_mode="AUTO", tilt=ToolTilt(0.1))
