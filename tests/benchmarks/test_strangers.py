"""The judges of files of strangers notice what was read otherwise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from _strangers_logs import bags, misread_log, tables
from _strangers_robots import meshes, misread_mesh, misread_robot, urdfs
from _strangers_worlds import misread_world, worlds

from ir_description import InvalidValueError


def test_the_judge_of_robots_notices_another_arm_and_a_body_that_is_gone(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    _, path, arm, more, _ = next(urdfs(rng, tmp_path))
    assert misread_robot(path, arm, more, rng) == ""
    longer = replace(arm, origins=1.1 * arm.origins)
    assert "stands out" in misread_robot(path, longer, False, rng)
    assert "stands out" in misread_robot(path, arm, True, rng)


def test_the_judge_of_meshes_notices_other_corners(tmp_path: Path) -> None:
    _, path, triangles, _ = next(meshes(np.random.default_rng(1), tmp_path))
    assert misread_mesh(path, triangles) == ""
    assert misread_mesh(path, triangles * 1.001)
    assert misread_mesh(path, triangles[1:])


@pytest.mark.long
def test_worlds_of_strangers_are_read_right_or_refused(tmp_path: Path) -> None:
    """Frames, includes, Collada trees and scenes of one seed."""
    for case in worlds(np.random.default_rng(1), tmp_path):
        if case.readable:
            assert misread_world(case) == "", case.name
        else:
            with pytest.raises(InvalidValueError) as refused:
                misread_world(case)
            assert "\n" not in str(refused.value), case.name


def test_the_judge_of_worlds_notices_other_places_and_bodies_that_are_gone(tmp_path: Path) -> None:
    case = next(worlds(np.random.default_rng(1), tmp_path))
    assert misread_world(case) == ""
    assert "no body has" in misread_world(replace(case, bodies=[case.bodies[0] + 1e-6]))
    assert "bodies of 2" in misread_world(replace(case, bodies=2 * case.bodies))
    assert "left out" in misread_world(replace(case, left_out=1))


def test_the_judge_of_logs_notices_other_rows_and_rows_that_are_gone(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    for made in (bags, tables):
        _, path, q, _ = next(made(rng, tmp_path))
        assert misread_log(path, q) == ""
        assert misread_log(path, q + 1e-4)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:50], *lines[60:], ""]))
    assert "without a word" in misread_log(path, q)
