"""What was dragged in `ir view`, written into a cell's file: nothing else of it changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_cli.commands import BY_PATH, renamed
from ir_cli.errors import CommandError
from ir_cli.view.cell_file import Watched, save
from ir_cli.view.moves import DragTarget, cell_with, edited, meant, pose_in, snippet, targets
from ir_description import Cell, cell_from_yaml, cell_to_yaml, load_cell
from ir_description.poses import pose_of, rotation_from_abc

BUNDLED = Path(str(__import__("ir_description").__file__)).parent / "data" / "cells"
LAYOUTS = """\
format: ir_cell/1
name: layouts
robot: kr210_r2700_extra
equipment:
  - name: block  # machines are not always in braces
    pose:
      # first the place
      xyz:
        - 1.5
        - 0   # beside the column
        - 0
      quaternion: [0, 0, 0, 1]
      # behind the pose
    bodies: []
    zone: {kind: OPEN, size: [1, 1, 1]}
    stations:
    - name: a
      pose: {abc_deg: [0, 90, 0]}
    - {name: b, pose: {rotation: [[1, 0, 0], [0, 1, 0],
                                  [0, 0, 1]], xyz: [0, 0, 1]}}
  - {name: flow, bodies: [], zone: {kind: OPEN, size: [1, 1, 1]}}
  - bodies: []   # no pose, and the name last: \u00fc\u20ac
    zone: {kind: OPEN, size: [1, 1, 1]}
    name: last
# the end
"""

numbers = st.floats(-5.0, 5.0).map(lambda value: round(value, 3))
angles = st.floats(-180.0, 180.0).map(lambda value: round(value, 1))
poses = st.tuples(
    st.tuples(numbers, numbers, numbers), st.none() | st.tuples(angles, angles, angles)
)


def without_poses(text: str) -> list[str]:
    """The comments of a text, and its lines without their numbers."""
    return [line.partition("#")[2] for line in text.splitlines() if "#" in line]


def dragged(
    cell: Cell, target: DragTarget, xyz: tuple[float, ...], abc: tuple[float, ...] | None
) -> np.ndarray:
    before = pose_in(cell, target)
    return meant(pose_of(xyz, before[:3, :3] if abc is None else rotation_from_abc(abc)), before)


@settings(max_examples=20, deadline=None)
@given(st.data())
def test_the_file_reads_back_as_the_cell_that_was_shown(data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(["demo", "", ""]))
    text = (BUNDLED / f"{name}.yaml").read_text() if name else LAYOUTS
    cell = load_cell(name) if name else cell_from_yaml(text)
    chosen = data.draw(
        st.lists(st.sampled_from(targets(cell)), min_size=1, max_size=4, unique=True)
    )
    moves = {target: dragged(cell, target, *data.draw(poses)) for target in chosen}
    new = edited(text, cell, moves)
    assert cell_to_yaml(cell_from_yaml(new)) == cell_to_yaml(cell_with(cell, moves))
    assert without_poses(new) == without_poses(text)


def test_what_did_not_move_is_not_written_again() -> None:
    cell = cell_from_yaml(LAYOUTS)
    moves = {DragTarget("equipment", "block"): pose_of((1.5, 0.2, 0.0))}
    assert edited(LAYOUTS, cell, moves) == LAYOUTS.replace("- 0   # beside", "- 0.2   # beside")
    assert snippet(moves) == "# machine block\npose: {xyz: [1.5, 0.2, 0]}"


def test_small_numbers_of_a_browser_are_no_move() -> None:
    before = pose_of((1.23456789, 0.1, 0.0), rotation_from_abc((12.345, 0.0, 0.0)))
    noisy = before.astype(np.float32).astype(np.float64)
    np.testing.assert_array_equal(meant(noisy, before), before)


def test_nothing_is_overwritten_and_a_changed_file_is_not_mixed(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    path.write_text(LAYOUTS, encoding="utf-8")
    cell = load_cell(path)
    moves = {DragTarget("station", "a"): pose_of((0.1, 0.0, 0.0))}
    assert [save(Watched(str(path)), cell, moves).name for _ in range(2)] == [
        "c_moved.yaml",
        "c_moved_2.yaml",
    ]
    path.write_text(LAYOUTS.replace("xyz: [0, 0, 1]", "xyz: [0, 0, 2]"), encoding="utf-8")
    with pytest.raises(CommandError, match="changed meanwhile"):
        save(Watched(str(path)), cell, moves)
    assert sorted(each.name for each in tmp_path.iterdir()) == [
        "c.yaml",
        "c_moved.yaml",
        "c_moved_2.yaml",
    ]
    watched = Watched(str(path))
    path.unlink()
    with pytest.raises(CommandError):
        save(watched, cell, moves)


@pytest.mark.parametrize("page", ["view", "cad"])
def test_commands_of_the_pages_are_understood(page: str) -> None:
    text = (Path(__file__).resolve().parents[2] / "docs" / f"{page}.md").read_text(encoding="utf-8")
    commands = [line.split()[1:] for line in text.splitlines() if line.startswith("    ir ")]
    assert commands
    for words in commands:
        path, count, notice = renamed(words)
        assert not notice
        assert BY_PATH[path].parser().parse_args(words[count:]).run is not None
