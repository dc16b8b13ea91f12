"""What the node knows of the robot."""

from __future__ import annotations

import numpy as np
import pytest
from ir_planner.errors import RequestError
from ir_planner.node_inputs import LastState
from ir_planner.timing import STILL


def test_a_standing_robot_is_one_start_however_its_measurement_trembles() -> None:
    home, rng = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]), np.random.default_rng(1)
    state = LastState()
    seen = set()
    for _ in range(100):
        state.take(home + rng.uniform(-1e-15, 1e-15, 6), 0.0)
        q = state.fresh(0.0, 1.0)
        assert np.abs(q - home).max() < STILL
        seen.add(q.tobytes())
    assert len(seen) == 1


def test_no_state_and_an_old_one_are_told_apart() -> None:
    state = LastState()
    with pytest.raises(RequestError, match="no joint_states have come yet"):
        state.fresh(0.0, 1.0)
    state.take(np.zeros(6), 0.0)
    with pytest.raises(RequestError, match=r"came 2.5 s ago: it must be at most 1 s"):
        state.fresh(2.5, 1.0)
