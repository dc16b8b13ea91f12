"""Eq. (9): joints that carry more count more."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_description import load_robot
from ir_planner.scene.movement_cost import movement_cost, movement_weights, path_cost

ROBOT = load_robot()
WEIGHTS = movement_weights(ROBOT.link_mass, ROBOT.velocity_max)


def test_weights_are_the_sum_from_the_joint_to_the_tool() -> None:
    n = len(ROBOT.velocity_max)
    for i in range(n):
        total = sum(
            ROBOT.link_mass[link] * ROBOT.velocity_max[link - 1] ** 2
            for link in range(i + 1, n + 1)
        )
        assert WEIGHTS[i] == pytest.approx(0.5 * total, rel=1e-14)


def test_weights_fall_from_base_to_tool_and_grow_with_the_load_alike() -> None:
    assert (np.diff(WEIGHTS) < 0.0).all()
    loaded = movement_weights(ROBOT.link_mass, ROBOT.velocity_max, 155.0)
    assert loaded - WEIGHTS == pytest.approx(np.full(6, 0.5 * 155.0 * ROBOT.velocity_max[-1] ** 2))


@given(st.lists(st.floats(-3.0, 3.0), min_size=18, max_size=18))
def test_a_stop_between_never_makes_a_movement_cheaper(values: list[float]) -> None:
    a, via, b = np.array(values).reshape(3, 6)
    through = path_cost(WEIGHTS, np.stack([a, via, b]))
    assert through >= float(movement_cost(WEIGHTS, a, b)) - 1e-9
    inside = np.clip(via, np.minimum(a, b), np.maximum(a, b))
    assert path_cost(WEIGHTS, np.stack([a, inside, b])) == pytest.approx(
        float(movement_cost(WEIGHTS, a, b))
    )
