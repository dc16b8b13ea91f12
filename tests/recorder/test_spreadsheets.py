"""Tables for spreadsheets: what is read back is what was written, in every locale and as a
workbook.
"""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_recorder import Analysis, RecorderError
from ir_recorder.report.fleet import fleet_html
from ir_recorder.report.fleet_members import member_of
from ir_recorder.report.prices import Costs
from ir_recorder.report.step_table import step_columns, workbook, write_columns, write_table

SHEET = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
VALUES = st.one_of(
    st.floats(allow_infinity=False), st.integers(-(10**12), 10**12), st.text(max_size=8)
)


def cells(content: bytes) -> list[list[str | None]]:
    """The rows of the first sheet as a reader finds them: numbers as their texts."""
    with ZipFile(BytesIO(content)) as file:
        assert file.testzip() is None
        root = ElementTree.fromstring(file.read("xl/worksheets/sheet1.xml"))
    return [[_read(cell) for cell in row] for row in root.iter(f"{SHEET}row")]


def _read(cell: ElementTree.Element) -> str | None:
    texts = [each.text or "" for each in cell.iter() if each.tag in (f"{SHEET}v", f"{SHEET}t")]
    return texts[0] if texts else None


@given(st.lists(st.tuples(VALUES, VALUES), min_size=1, max_size=6))
def test_a_workbook_holds_what_was_written(rows: list) -> None:
    columns = {"a": [one for one, _ in rows], "b & <c>": [other for _, other in rows]}
    content = workbook(columns)
    assert content == workbook(columns)
    head, *read = cells(content)
    assert head == ["a", "b & <c>"]
    for found, values in zip(read, rows, strict=True):
        for cell, value in zip(found, values, strict=True):
            if not isinstance(value, str):
                assert cell is None if math.isnan(value) else float(cell or "x") == value
            elif value.isprintable():
                assert cell == value


@given(st.floats(allow_infinity=False), st.text("ab;,\"'=", max_size=5))
def test_a_table_with_commas_is_read_back(
    tmp_path_factory: pytest.TempPathFactory, value: float, words: str
) -> None:
    path = tmp_path_factory.mktemp("tables") / "table.csv"
    columns = {"name": [words], "energy_j": [value]}
    write_columns(columns, path, b"name,", locale="de")
    assert path.read_bytes().startswith(b"\xef\xbb\xbfname;")
    with path.open(encoding="utf-8-sig", newline="") as file:
        (row,) = csv.DictReader(file, delimiter=";")
    assert "." not in row["energy_j"]
    shown = row["energy_j"].replace(",", ".")
    assert shown == "" if math.isnan(value) else float(shown) == value
    assert row["name"].strip("'") == words.strip("'")
    write_columns(columns, path, b"name,", locale="de")  # in place of its like


def test_steps_are_written_as_a_workbook_and_another_file_is_kept(
    analysis: Analysis, tmp_path: Path
) -> None:
    path = write_table([analysis], tmp_path / "steps.xlsx")
    assert cells(path.read_bytes())[0] == list(step_columns([analysis]))
    assert len(cells(path.read_bytes())) == 1 + len(analysis.steps)
    write_table([analysis, analysis], path)
    other = tmp_path / "other.xlsx"
    with ZipFile(other, "w") as file:
        file.writestr("letter.txt", "do not replace me")
    with pytest.raises(RecorderError):
        write_table([analysis], other)


def test_months_hold_what_was_driven_beside_what_was_predicted(analysis: Analysis) -> None:
    """A robot that takes a tenth more in June than was predicted shows it in June."""
    member = member_of(analysis, "robot")
    assert member is not None
    assert member.month == "2023-11"
    assert member.driven == pytest.approx(member.predicted, rel=1e-3)
    later = replace(member, month="2026-06", driven=1.1 * member.predicted)
    page = fleet_html([later, member], costs=Costs(parts_per_cycle=4.0))
    table = page.partition("Month by month</caption>")[2].partition("</table>")[0]
    assert table.index("2023-11") < table.index("2026-06")
    assert "+10.00 %" in table
    unknown = replace(member, driven=math.nan)
    assert "No recording holds a program that was driven" in fleet_html([unknown])
