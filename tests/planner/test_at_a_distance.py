"""Law: states at the safety distance are free or refused at once, everywhere alike, and a refusal
tells value and bound apart.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_planner import Planner
from ir_planner.presentation import in_mm

MARGIN = 0.02  # m
CELLS = ("demo", "table_columns", "deep_box")
OFF = (-2e-5, -1e-6, -6e-7, -4e-7, -2.5e-7, -1.5e-7, 0.0, 1e-6)  # m from the safety distance


def at_a_distance(planner: Planner, draw: np.random.Generator, off: float) -> np.ndarray:
    """A configuration (n,) whose least distance is the safety distance and `off` m."""
    robot = planner.cell.robot
    scene = planner.scene()
    kept = scene.thresholds(MARGIN)

    def left(q: np.ndarray) -> float:
        return float((scene.collision.distances(q[None])[0] - kept).min())

    while True:
        free = draw.uniform(robot.position_min, robot.position_max)
        near = free.copy()
        near[1] = np.clip(free[1] + draw.choice([-0.8, 0.8]), *_range(robot, 1))
        if left(free) > 1e-3 and left(near) < -1e-3:
            break
    low = 0.0
    high = 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if left(free + middle * (near - free)) > off:
            low = middle
        else:
            high = middle
    return np.asarray(free + low * (near - free))


def _range(robot: object, joint: int) -> tuple[float, float]:
    return robot.position_min[joint], robot.position_max[joint]  # type: ignore[attr-defined]


@pytest.mark.parametrize("cell", CELLS)
def test_a_start_at_the_distance_is_planned_from_or_refused_at_once(cell: str) -> None:
    """As the check of a state says, without a search that can't succeed."""
    planner = Planner(cell, clock=lambda: 0.0)
    draw = np.random.default_rng(3)
    for off in OFF:
        start = at_a_distance(planner, draw, off)
        valid = planner.check_state(start).valid
        assert valid == planner.check_states(start[None]).valid[0]
        assert valid == (off > -2e-7)
        plan = planner.plan_regional(start=start, goal="home")
        if valid:
            assert plan.status.ok, plan.status.message
            continue
        assert plan.info.iterations == 0
        said = re.search(r"distance (\S+) mm, .* more than (\S+) mm", plan.status.message)
        assert said is not None
        assert float(said[1]) < float(said[2])


@given(
    st.floats(-1.0, 1.0),
    st.floats(1e-9, 1.0),
)
def test_two_distances_never_print_alike(distance: float, apart: float) -> None:
    first, second = in_mm(distance, distance + apart)
    assert first != second
    assert float(first) <= float(second)
