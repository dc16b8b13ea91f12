"""Variants of cells are the same cells seen in a mirror, turned, or with machines a little
elsewhere.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from _regional_tasks import CELLS, scene_of_cell, tasks_of
from _variants import CLEARANCE, SHIFT, mirrored, turned, variant, variant_files

from ir_description import cell_to_yaml, load_cell

MIRROR = np.diag([1.0, -1.0, 1.0, 1.0])


@pytest.mark.parametrize("name", CELLS)
def test_distances_are_those_of_the_cell_itself(name: str) -> None:
    """What the robot is near at the ends of the tasks stays as near in the mirror and after a
    turn.
    """
    cell = load_cell(name)
    for changed in (mirrored(cell), turned(cell, 0.3)):
        for old, new in zip(cell.tasks, changed.tasks, strict=True):
            before = scene_of_cell(cell)
            after = scene_of_cell(changed)
            for q, r in ((old.start, new.start), (old.goal, new.goal)):
                a = before.collision.min_distance(np.asarray(q)[None]).distance[0]
                b = after.collision.min_distance(np.asarray(r)[None]).distance[0]
                assert b == pytest.approx(a, abs=1e-9)


def test_the_tool_is_seen_in_the_mirror() -> None:
    cell = load_cell("open")
    old = scene_of_cell(cell).chain
    new = scene_of_cell(mirrored(cell)).chain
    for task, other in zip(cell.tasks, mirrored(cell).tasks, strict=True):
        pose = old.tcp_poses(np.asarray(task.goal)[None])[0]
        assert np.allclose(
            new.tcp_poses(np.asarray(other.goal)[None])[0], MIRROR @ pose @ MIRROR, atol=1e-9
        )


def test_a_seed_gives_the_same_variant_and_another_one_not() -> None:
    cell = load_cell("table_columns")
    texts = [cell_to_yaml(variant(cell, seed, k)) for seed, k in ((0, 0), (0, 0), (0, 1), (1, 0))]
    assert texts[0] == texts[1]
    assert len(set(texts)) == 3


def test_variants_can_be_loaded_and_their_tasks_asked(tmp_path: Path) -> None:
    for file in variant_files(("open", "deep_box"), 2, 7, tmp_path / "new"):
        tasks = tasks_of(file)
        assert len(tasks) >= 6
        assert all(task.margin > 0.5 * CLEARANCE for task in tasks)
        plain = load_cell(tasks[0].cell.rsplit("_", 2)[0])
        moved = [
            np.linalg.norm(m.pose[2, 3] - n.pose[2, 3])
            for m, n in zip(plain.equipment, tasks[0].scene.cell.equipment, strict=True)
        ]
        assert max(moved) < 6.0 * SHIFT  # machines stay on the floor
