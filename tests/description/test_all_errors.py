"""Every mistake in a cell file is reported in one run, with its own line, and nothing else is."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import CellFileError, bundled_cells, load_cell
from ir_description.library import cell_file_errors

DEMO = (files("ir_description") / "data" / "cells" / "demo.yaml").read_text(encoding="utf-8")
# what is written, what is typed instead, and a word of the sentence it gets
MISTAKES = (
    ("size: [0.8, 1.2, 0.15]", "size: [0.8, -1.2, 0.15]", "(0, 1000] m"),
    ("name: infeed_stand, kind: box", "name: infeed_stand, kind: cube", "must be one of box"),
    ("zone: SEMI_CLOSED", "zoone: SEMI_CLOSED", "unknown key 'zoone'"),
    ("{name: lathe_wall_left,", "{name: lathe_bed,", "lathe_bed is there twice"),
    (
        "station: gauge_measure, planner",
        "station: gauge_mesure, planner",
        "'gauge_mesure' is unknown",
    ),
    ("{pause: 1800, power_mode: HIBERNATION}", "{pause: 1800, power_mode: SLEEP}", "'SLEEP'"),
    ("{between: [t_f1, gear_lying]", "{between: [t_f9, gear_lying]", "'t_f9' is unknown"),
    ("{pause: 180,", "{pause: -180,", "604800"),
    ("dwell: 3.0", "dwell: three", "must be a number"),
)


def line_of(words: str) -> int:
    return next(k for k, line in enumerate(DEMO.splitlines(), 1) if words in line)


def read(tmp_path: Path, text: str) -> tuple[CellFileError, ...]:
    path = tmp_path / "cell.yaml"
    path.write_text(text, encoding="utf-8")
    return cell_file_errors(path)


@settings(max_examples=25, deadline=None)
@given(chosen=st.sets(st.sampled_from(MISTAKES), min_size=1))
def test_all_mistakes_are_reported_with_their_lines(
    tmp_path_factory: pytest.TempPathFactory, chosen: set[tuple[str, str, str]]
) -> None:
    text = DEMO
    for written, typed, _ in chosen:
        assert written in text
        text = text.replace(written, typed, 1)
    found = read(tmp_path_factory.mktemp("cell"), text)
    expected = sorted((line_of(written), word) for written, _, word in chosen)
    lines = [line for line, _ in expected]
    # a contact is blamed on its station, which begins some lines before
    assert len(found) == len(expected), [str(error) for error in found]
    for error, (line, word) in zip(found, sorted(expected), strict=True):
        assert word in error.sentence
        assert error.line == line or (
            "t_f9" in error.sentence and line - 8 <= error.line <= line
        ), lines


@pytest.mark.parametrize("name", bundled_cells())
def test_a_cell_that_can_be_read_has_none(name: str, tmp_path: Path) -> None:
    text = (files("ir_description") / "data" / "cells" / f"{name}.yaml").read_text(encoding="utf-8")
    assert read(tmp_path, text) == ()
    assert load_cell(tmp_path / "cell.yaml").name == name


@pytest.mark.parametrize(
    ("text", "word"),
    [("", "empty"), ("a: [", "not YAML"), ("a: 1\na: 2\n", "twice"), ("a: 1\n", "unknown key 'a'")],
)
def test_what_is_no_cell_at_all_has_at_least_one(text: str, word: str, tmp_path: Path) -> None:
    assert word in " ".join(error.sentence for error in read(tmp_path, text))


def test_a_file_that_is_not_there_is_one_error(tmp_path: Path) -> None:
    (error,) = cell_file_errors(tmp_path / "nowhere.yaml")
    assert "can't be opened" in str(error)


def test_numbers_of_entries_are_those_of_the_file(tmp_path: Path) -> None:
    text = DEMO.replace(
        "kind: box, size: [0.8, 1.2, 0.15]", "kind: ball, size: [0.8, 1.2, 0.15]", 1
    )
    text = text.replace(
        "radius: 0.02, length: 0.10, xyz: [0, 0.045", "radius: -2, length: 0.10, xyz: [0, 0.045", 1
    )
    first, second = read(tmp_path, text)
    assert first.sentence.startswith("equipment[0].bodies[0].kind")
    assert second.sentence.startswith("equipment[0].bodies[3].radius")


MESH_CELL = """
format: ir_cell/1
name: bench
robot: kr210_r2700_extra
equipment:
  - name: press
    bodies:
      - {name: press_cad, mesh: nowhere.stl, unit: mm, pieces: 4}
      - {name: press_hood, mesh: hood.stl, unit: inch, colour: red, xyz: [0, 0, 3 m]}
"""


def test_a_mesh_that_cannot_be_read_makes_no_other_key_unknown(tmp_path: Path) -> None:
    found = [error.sentence for error in read(tmp_path, MESH_CELL) if "bodies" in error.sentence]
    places = [
        "[0].mesh: file",
        "[1] has the unknown key 'colour'",
        "[1].xyz[2] is '3 m'",
        "[1].mesh: file",
    ]
    assert len(found) == len(places), found
    for place in places:
        assert any(f"equipment[0].bodies{place}" in sentence for sentence in found), place


@pytest.mark.parametrize(
    ("written", "typed", "word"),
    [
        ("attach: gear", "atach: gear", "unknown key 'atach'"),
        ("attach: gear", "attach: geer", "part 'geer' is unknown"),
        ("states:\n      door_open: [lathe_door_up]\n      door_closed: "
"[lathe_door_down]", "states: [up]",
         "equipment[1].states must be a mapping"),
        ("follows: lathe_open_door", "follow: lathe_open_door", "unknown key 'follow'"),
    ],
)  # fmt: skip
def test_what_follows_from_a_mistake_is_not_reported(
    written: str, typed: str, word: str, tmp_path: Path
) -> None:
    assert written in DEMO
    found = read(tmp_path, DEMO.replace(written, typed, 1))
    assert [word in error.sentence for error in found] == [True], [
        error.sentence for error in found
    ]


def test_a_part_that_nobody_holds_is_reported_where_the_program_is_whole(tmp_path: Path) -> None:
    text = DEMO.replace("infeed_pick, attach: gear", "infeed_pick", 1)
    size, hands = read(tmp_path, text.replace("size: [0.8,", "size: [-0.8,", 1))
    assert "is -0.8 m, must be in" in size.sentence
    assert "no part is held" in hands.sentence
