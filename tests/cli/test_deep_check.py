"""`ir check --deep`: what it suggests makes the cell plan, and what it calls fine is
planned.
"""

from __future__ import annotations

import copy
import itertools
import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from generated_cells import Document, broken_documents, cell_of, pasted
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ir_cli.cell_mending import mended_cell, suggestions_of
from ir_cli.main import main
from ir_description import Cell, cell_to_yaml, load_cell
from ir_msgs_py.options import PlanOptions
from ir_planner import Planner

PAIR = re.compile(r"\b\w+ is [\d.]+ mm (inside|from) \w+")


def errors(cell: Cell) -> list[str]:
    return [each.sentence for each in suggestions_of(cell) if each.severity == "error"]


def with_suggestions(document: Document) -> Document:
    """The document with everything pasted that is suggested for it."""
    mended = copy.deepcopy(document)
    for each in mended_cell(cell_of(document))[1]:
        if each.yaml:
            pasted(mended, each.subject, each.yaml)
    return mended


@settings(max_examples=12, deadline=None, derandomize=True)
@given(document=broken_documents())
def test_what_is_suggested_is_all_that_stations_lack(document: Document) -> None:
    found = mended_cell(cell_of(document))[1]
    for each in found:
        if each.severity == "error" and "zone" not in each.sentence:
            assert PAIR.search(each.sentence), each.sentence
    assume(all(each.yaml for each in found if each.severity == "error"))
    again = mended_cell(cell_of(with_suggestions(document)))[1]
    assert [each for each in again if each.yaml] == []


def check_planned(document: Document, seed: int) -> None:
    """Whether what passes the check, at once or as it suggests, is planned with any seed."""
    mended = with_suggestions(document)
    cell = cell_of(mended)
    assume(not errors(cell))
    planner = Planner(clock=itertools.repeat(0.0).__next__)
    planner.set_cell(text=cell_to_yaml(cell))
    plan = planner.plan_program(options=PlanOptions(seed=seed), start=cell.posture("park"))
    assert plan.status.ok, plan.status.message


@pytest.mark.long
@settings(max_examples=2, deadline=None, derandomize=True)
@given(document=broken_documents(), seed=st.integers(1, 1000))
def test_what_the_check_calls_fine_is_planned(document: Document, seed: int) -> None:
    check_planned(document, seed)


@pytest.mark.long
@settings(max_examples=40, deadline=None)
@given(document=broken_documents(), seed=st.integers(1, 1000))
def test_what_the_check_calls_fine_is_planned_over_many_cells(
    document: Document, seed: int
) -> None:
    check_planned(document, seed)


def changed(cell: Cell, name: str, **fields: object) -> Cell:
    stations = tuple(
        replace(station, **fields) if station.name == name else station  # type: ignore[arg-type]
        for station in cell.stations
    )
    return replace(cell, stations=stations)


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("name", "missing"),
    [("infeed_pick", {"allowed_contacts": ()}), ("gauge_measure", {"approach_distance": 0.0}),
     ("outfeed_place", {"allowed_contacts": ()})],
)  # fmt: skip
def test_what_a_station_of_the_demonstration_lacks_is_suggested(
    name: str, missing: dict[str, object]
) -> None:
    mended, found = mended_cell(changed(load_cell("demo"), name, **missing))
    assert [
        (each.subject, next(iter(yaml.safe_load(each.yaml)))) for each in found if each.yaml
    ] == [(name, next(iter(missing)))]
    assert [each for each in mended_cell(mended)[1] if each.yaml] == []


def test_a_station_in_a_body_is_to_be_moved(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = cell_to_yaml(load_cell("kr6_bench"))
    document: Document = yaml.safe_load(text)
    station = document["equipment"][1]["stations"][0]
    station["pose"]["xyz"][2] -= 0.1
    path = tmp_path / "deep.yaml"
    path.write_text(yaml.safe_dump(document, sort_keys=False))
    line = path.read_text().splitlines().index(f"  - name: {station['name']}") + 1
    assert main(["cell", "check", str(path), "--deep"]) == 1
    out = capsys.readouterr().out
    (found,) = [row for row in out.splitlines() if "move the station" in row]
    assert found.startswith(f"{path}:{line}: error: {station['name']}: no configuration is free")
    assert PAIR.search(found)
    x, y, z = json.loads("[" + re.search(r"by \((.*)\) m", found).group(1) + "]")  # type: ignore[union-attr]
    assert z > 0.02
    assert abs(x) < 0.01
    assert abs(y) < 0.01
