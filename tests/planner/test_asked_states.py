"""Many states at once are answered as each of them alone, and the first bad one is named."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from ir_msgs.srv import CheckState
from ir_msgs_py.ros.messages import message_from_yaml
from ir_planner.errors import RequestError
from ir_planner.planner import Planner
from ir_values.errors import InvalidValueError


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner("demo", clock=itertools.repeat(0.0).__next__)


@pytest.mark.parametrize("station", ["", "lathe_work"])
@pytest.mark.parametrize("load", ["none", ""])
def test_a_batch_says_what_each_state_says(planner: Planner, station: str, load: str) -> None:
    robot = planner.cell.robot
    rng = np.random.default_rng(3)
    q = rng.uniform(robot.position_min, robot.position_max, (300, robot.n))
    q[::3] = np.array(planner.cell.machine_home) + rng.uniform(-0.3, 0.3, (100, robot.n))
    q = np.clip(q, robot.position_min, robot.position_max)
    batch = planner.check_states(q, safety_distance=0.02, load=load, station=station)
    for k, state in enumerate(q):
        one = planner.check_state(
            state, safety_distance=0.02, max_pairs=1, load=load, station=station
        )
        assert batch.valid[k] == one.valid
        assert batch.distances[k] == pytest.approx(one.min_distance, abs=1e-6)
        pair = batch.closest[k]
        assert pair is not None
        assert pair.distance == pytest.approx(one.pairs[0].distance, abs=1e-6)
    assert 0 < int(batch.valid.sum()) < len(q)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e308, -1e308, 7.0])
def test_the_first_bad_state_is_named_by_its_index(planner: Planner, value: float) -> None:
    q = np.tile(np.array(planner.cell.machine_home), (5, 1))
    q[2, 3] = value
    q[4, 0] = value
    with pytest.raises(RequestError, match=r"states\[2\]: joint_a4 is ") as refused:
        planner.check_states(q, safety_distance=0.02)
    assert "inf deg" not in str(refused.value)


@pytest.mark.filterwarnings("error")
def test_a_state_beyond_any_angle_is_a_clean_sentence(planner: Planner) -> None:
    q = np.array(planner.cell.machine_home)
    q[0] = 1e308
    with pytest.raises(RequestError, match=r"joint_a1 is 1e\+308 rad: it must be in \["):
        planner.check_state(q, safety_distance=0.02, max_pairs=1)


@pytest.mark.parametrize("count", [0, 10_001])
def test_none_and_too_many_states_are_refused(planner: Planner, count: int) -> None:
    q = np.tile(np.array(planner.cell.machine_home), (count, 1))
    with pytest.raises(RequestError, match=f"states has {count} states: it must be 1 to 10000"):
        planner.check_states(q, safety_distance=0.02)


def test_a_text_with_a_nul_is_refused_before_ros_cuts_it() -> None:
    with pytest.raises(
        InvalidValueError, match=r"station is .* must not contain the character NUL"
    ):
        message_from_yaml(CheckState.Request, '{station: "lathe_work\\0"}')
