"""How near two robots of a recording came to each other, judged by Coal."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace as Of
from typing import Any

import numpy as np
import pytest

from ir_description import Cell, load_robot_cells
from ir_recorder.analysis.robots import nearest

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judge of the benchmark

from _robots_judge import Judge


def recorded(cell: Cell, q: np.ndarray) -> Any:
    joints = Of(time=np.arange(float(len(q))), position=q)
    return Of(recording=Of(joints=joints), cell=cell, steps=())


@pytest.mark.parametrize("seed", range(4))
def test_the_least_distance_of_two_arms_is_that_of_their_capsules(seed: int) -> None:
    several = load_robot_cells("two_robots")
    assert several is not None
    one, other = several.cells
    draw = np.random.default_rng(seed)
    base = other.base_pose.copy()
    base[:2, 3] = draw.uniform(1.5, 2.5, 2)
    other = replace(other, base_pose=base)
    low = np.maximum(one.robot.position_min, -np.pi)
    high = np.minimum(one.robot.position_max, np.pi)
    q = draw.uniform(low, high, (2, 20, one.robot.n))
    found = nearest(recorded(one, q[0]), recorded(other, q[1]))
    assert found is not None
    judge = Judge((one, other))
    judged = [judge.distance((a, b), ("", "")) for a, b in zip(q[0], q[1], strict=True)]
    assert found.time == int(np.argmin(judged))
    assert max(found.distance, 0.0) == pytest.approx(max(min(judged), 0.0), abs=1e-5)


def test_recordings_without_a_common_time_have_no_distance() -> None:
    several = load_robot_cells("two_robots")
    assert several is not None
    q = np.zeros((3, 6))
    later = recorded(several.cells[1], q)
    later.recording.joints.time = later.recording.joints.time + 10.0
    assert nearest(recorded(several.cells[0], q), later) is None
