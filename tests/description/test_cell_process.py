"""A cell that is read in a process of its own is the one that is read here, and so are the
errors.
"""

from __future__ import annotations

import pickle
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ir_description import (
    CellFileError,
    DescriptionError,
    UnknownNameError,
    bundled_cells,
    cell_from_yaml,
    cell_to_yaml,
    load_cell,
)
from ir_description import library as cell_process
from ir_description.library import read_cell_apart

LONG = (
    "# " + "x" * cell_process.CHARACTERS_HERE + "\n"
)  # a comment that makes a text too long to be read here


@pytest.mark.parametrize("name", bundled_cells())
def test_a_cell_comes_back_the_same_and_read_only(name: str) -> None:
    cell = load_cell(name)
    back = pickle.loads(cell_process.pickled(cell))
    assert cell_to_yaml(back) == cell_to_yaml(cell)
    assert back.robot is cell.robot
    arrays = [
        a for machine in back.equipment for body in machine.bodies for a in (body.pose, body.size)
    ]
    assert arrays
    assert not any(array.flags.writeable for array in (*arrays, back.base_pose, back.park))


def test_long_texts_and_files_are_read_apart(tmp_path: Path) -> None:
    text = cell_to_yaml(load_cell("open"))
    path = tmp_path / "open.yaml"
    path.write_text(text, encoding="utf-8")
    assert cell_to_yaml(read_cell_apart(LONG + text, "")) == text
    assert cell_to_yaml(read_cell_apart("", str(path))) == text


@pytest.mark.parametrize(
    ("text", "path"),
    [
        ("name: [1", ""),
        (LONG + "name: [1", ""),
        ("", "nowhere.yaml"),
        ("", "atlantis"),
        (LONG + "a: &x b", ""),
    ],
)
def test_errors_are_those_of_reading_it_here(text: str, path: str) -> None:
    apart = refusal(lambda: read_cell_apart(text, path))
    here = refusal(lambda: read_here(text, path))
    assert str(apart) == str(here)
    assert type(apart) is type(here)


def read_here(text: str, path: str) -> object:
    return cell_from_yaml(text) if text else load_cell(path)


def refusal(act: Callable[[], object]) -> DescriptionError:
    with pytest.raises(DescriptionError) as caught:
        act()
    return caught.value


@pytest.mark.parametrize(
    "error", [CellFileError("a.yaml", 3, "is wrong"), UnknownNameError("part", "x\0", ["a", "b"])]
)
def test_errors_can_be_sent_to_another_process(error: DescriptionError) -> None:
    back = pickle.loads(pickle.dumps(error))
    assert type(back) is type(error)
    assert str(back) == str(error)


@pytest.mark.long
def test_meshes_are_bounded_together() -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(1000, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]  # of a sphere: each is a corner
    corners = ", ".join(str([round(float(x), 4) for x in point]) for point in points)
    bodies = "\n".join(f"- {{name: b{k}, kind: mesh, vertices: [{corners}]}}" for k in range(52))
    head = (
        "format: ir_cell/1\nname: x\nrobot: kr210_r2700_extra\nequipment:\n- name: m\n  bodies:\n"
    )
    with pytest.raises(
        CellFileError, match=r"one mesh too many: all have 5\d+ corners, at most 50000"
    ):
        read_cell_apart(head + "\n".join("  " + line for line in bodies.splitlines()), "")


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("dies", "why"),
    [
        ("while True: pass", "processor time"),
        ("bytearray(10_000_000_000)", "GB of memory"),
        ("raise OSError('no such thing')", "ended with 1: OSError: no such thing"),
    ],
)
def test_a_process_without_an_answer_says_why(
    dies: str, why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its bounds are its own, but for the minute that would be long here; slow imports do not
    count.
    """
    program = tmp_path / "reader.py"
    reads = f"cell_process.load_cell = lambda name: exec({dies!r})"
    slow = "import time\nwhile time.process_time() < 1.1: pass"
    own = (
        "from ir_description import library as cell_process\ncell_process.PROCESSOR_SECONDS = "
        f"1\n{reads}\n{slow}\n"
    )
    program.write_text(f"#!{sys.executable}\n{own}cell_process.main()\n", encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(program))
    with pytest.raises(CellFileError, match=why):
        read_cell_apart("", "any.yaml")
