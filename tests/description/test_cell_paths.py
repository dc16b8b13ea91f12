"""Paths of the tool in a cell file: read, written, refused at their line."""

from __future__ import annotations

import numpy as np
import pytest

from ir_description import CellFileError, cell_from_yaml, cell_hash, cell_to_yaml
from ir_description.files import path_from_yaml
from ir_msgs_py.cartesian import CartesianPath

HEAD = "format: ir_cell/1\nname: c\nrobot: kr210_r2700_extra\n"
SEAM = """paths:
  - name: seam
    tool_speed: 0.02
    orientation: tangent
    start: {xyz: [1.8, -0.3, 1.2], abc_deg: [0, 90, 0]}
    segments:
      - {line: {xyz: [1.8, 0, 1.2], abc_deg: [0, 90, 0]}}
      - {circle: [{xyz: [1.9, 0.1, 1.2]}, {xyz: [2, 0, 1.2], abc_deg: [10, 80, 0]}], tool_speed: 0.015}
      - {spline: [{xyz: [2.1, 0, 1.2], abc_deg: [0, 90, 0]}, {xyz: [2.1, 0.1, 1.3], abc_deg: [0, 90, 5]}]}
"""  # noqa: E501


def same(first: CartesianPath, second: CartesianPath) -> bool:
    poses = [
        np.array([path.start, *(pose for part in path.segments for pose in part.poses)])
        for path in (first, second)
    ]
    settings = [
        [
            path.tool_speed,
            path.orientation,
            path.free_angle,
            *((p.kind, p.tool_speed) for p in path.segments),
        ]
        for path in (first, second)
    ]
    return bool(np.array_equal(*poses)) and settings[0] == settings[1]


def test_a_path_comes_back_from_the_file_that_is_written() -> None:
    cell = cell_from_yaml(HEAD + SEAM)
    again = cell_from_yaml(cell_to_yaml(cell))
    assert [path.name for path in again.paths] == ["seam"]
    assert same(cell.path("seam"), again.path("seam"))
    assert cell.path("seam").segments[1].tool_speed == 0.015
    assert cell_hash(cell) == cell_hash(cell_from_yaml(HEAD))  # a path moves nothing


def test_a_file_of_its_own_has_the_same_keys() -> None:
    lines = [line[4:] for line in SEAM.splitlines()[2:]]
    assert same(
        path_from_yaml("\n".join(lines), "seam.yaml"), cell_from_yaml(HEAD + SEAM).path("seam")
    )


@pytest.mark.parametrize(
    ("wrong", "right", "sentence"),
    [
        ("tool_speed: 0.02", "tool_speed: 20", "must be in [0.0001, 10] m/s"),
        ("tangent", "sideways", "must be one of given, constant, tangent"),
        ("{xyz: [1.9, 0.1, 1.2]}, ", "", "a circle has 1 poses: it must have 2"),
        ("- {line:", "- {bow:", "unknown key"),
        ("name: seam", "name: 7", "must be a name"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(wrong: str, right: str, sentence: str) -> None:
    text = HEAD + SEAM
    assert wrong in text
    with pytest.raises(CellFileError, match=r":\d+: ") as refused:
        cell_from_yaml(text.replace(wrong, right))
    assert sentence in str(refused.value)


BENCH = """equipment:
  - name: bench
    pose: {xyz: [2, 0, 0]}
    zone: OPEN
    bodies: [{name: bench_top, kind: box, size: [0.5, 0.5, 0.5], xyz: [0, 0, 0.25]}]
    stations: [{name: place, pose: {xyz: [0, 0, 1]}}]
"""
TOUCHING = SEAM.replace(
    "name: seam",
    "name: seam\n    equipment: bench\n    allowed_contacts:\n"
    "      - {between: [l6, bench_top], safety_distance: 0.002}",
)


def test_a_path_of_a_machine_moves_with_it_and_keeps_what_it_allows() -> None:
    cell = cell_from_yaml(HEAD + BENCH + TOUCHING + "program: [{path: seam, dwell: 1}]\n")
    again = cell_from_yaml(cell_to_yaml(cell))
    assert again.contacts_at("seam") == cell.contacts_at("seam")
    assert [(step.kind, step.target, step.dwell) for step in again.program] == [
        ("PATH", "seam", 1.0)
    ]
    turned = np.array(
        [[0.0, -1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 0.0], [0, 0, 0, 1.0]]
    )
    moved = cell.with_equipment("bench", turned)
    before = cell.path("seam")
    after = moved.path("seam")
    for old, new in (
        (before.start, after.start),
        (before.segments[1].poses[0], after.segments[1].poses[0]),
    ):
        seen = np.linalg.inv(cell.machine("bench").pose) @ old
        np.testing.assert_allclose(new, turned @ seen, atol=1e-12)


@pytest.mark.parametrize(
    ("wrong", "right", "sentence"),
    [
        ("equipment: bench", "equipment: desk", "desk"),
        ("    equipment: bench\n", "", "names no equipment"),
        ("[l6, bench_top]", "[l6, desk_top]", "desk_top"),
        ("name: seam", "name: place", "station or path place is there twice"),
        ("name: seam", "name: home", "station or path home is there twice"),
        ("path: seam", "path: bead", "bead"),
    ],
)
def test_what_a_path_names_is_there(wrong: str, right: str, sentence: str) -> None:
    program = "program: [{path: seam}]\n" if wrong.startswith("path") else ""
    text = HEAD + BENCH + TOUCHING + program
    assert wrong in text
    with pytest.raises(CellFileError) as refused:
        cell_from_yaml(text.replace(wrong, right))
    assert sentence in str(refused.value)
