"""What the node knows of the robot."""

from __future__ import annotations

from typing import Any

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st
from sensor_msgs.msg import JointState

from ir_description import load_cell
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError
from ir_planner.node.inputs import (
    LOOKS,
    LastState,
    has_joints,
    measured_velocity,
    of_joints,
    state_of,
)
from ir_planner.scene.motion_limits import STILL
from ir_values.errors import JointNamesError


def test_a_standing_robot_is_one_start_however_its_measurement_trembles() -> None:
    home = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
    rng = np.random.default_rng(1)
    state = LastState()
    seen = set()
    for _ in range(100):
        state.take(home + rng.uniform(-1e-15, 1e-15, 6), 0.0)
        q = state.fresh(0.0, 1.0)
        assert np.abs(q - home).max() < STILL
        seen.add(q.tobytes())
    assert len(seen) == 1


def test_no_state_and_an_old_one_are_distinguished() -> None:
    state = LastState()
    assert state.known(0.0, 1.0) is None
    with pytest.raises(RequestError, match="no joint_states of this robot have come yet"):
        state.fresh(0.0, 1.0)
    state.take(np.zeros(6), 0.0)
    with pytest.raises(RequestError, match=r"came 2.5 s ago: it must be at most 1 s"):
        state.fresh(2.5, 1.0)


class Busy:
    """A machine on which a driver is heard only after so many looks; time passes while somebody
    sleeps.
    """

    def __init__(self, after: int, offered: bool = True) -> None:
        self.looks = 0
        self.now = 100.0
        self._after = after
        self.state = LastState(self._look, lambda: offered)

    def _look(self) -> None:
        self.looks += 1
        if self.looks > self._after:
            self.state.take(np.ones(6), self.now)

    def ask(self) -> Any:
        return self.state.soon(lambda: self.now, 1.0, sleep=self._sleep)

    def _sleep(self, seconds: float) -> None:
        self.now += seconds


@pytest.mark.parametrize("before", [None, 2.5])
def test_a_driver_that_is_held_up_is_heard_a_moment_later(before: float | None) -> None:
    busy = Busy(after=LOOKS - 1)
    if before is not None:
        busy.state.take(np.zeros(6), busy.now - before)
    assert busy.ask().tolist() == [1.0] * 6
    looks = busy.looks
    assert busy.ask().tolist() == [1.0] * 6
    assert busy.looks == looks + 2, "nobody waits for a state that is there"


def test_a_driver_that_stays_silent_and_one_that_is_not_there_are_said() -> None:
    silent = Busy(after=10 * LOOKS)
    with pytest.raises(RequestError, match="no joint_states of this robot have come yet"):
        silent.ask()
    assert silent.looks <= LOOKS + 1
    missing = Busy(after=5, offered=False)
    with pytest.raises(RequestError, match="no joint_states of this robot have come yet"):
        missing.ask()
    assert missing.looks <= 2


def test_a_moving_robot_is_no_start_but_a_state() -> None:
    state = LastState()
    state.take(np.zeros(6), 0.0, np.array([0.0, 0.0, -0.3, 0.001, 0.0, 0.0]))
    sentence = (
        r"the robot is moving: joint_a3 has a velocity of -0\.3 rad/s, it must be 0 rad/s "
        r"within 0\.01"
    )
    with pytest.raises(RequestError, match=sentence) as caught:
        state.fresh(0.0, 1.0, JOINT_NAMES)
    assert caught.value.status.code == StatusCode.START_STATE_INVALID
    with pytest.raises(RequestError, match="the robot is moving"):
        state.known(0.0, 1.0, JOINT_NAMES)
    for q in (state.fresh(0.0, 1.0), state.known(0.0, 1.0), state.known(2.0, 1.0, JOINT_NAMES)):
        assert q is not None
        assert q.tolist() == [0.0] * 6
    for velocity in (np.full(6, 0.009), None):
        state.take(np.zeros(6), 0.0, velocity)
        assert state.fresh(0.0, 1.0, JOINT_NAMES).tolist() == [0.0] * 6


@pytest.mark.parametrize(
    ("velocity", "stated"),
    [([0.1] * 6, True), ([], False), ([float("nan")] * 6, False), ([0.1] * 5, False)],
)
def test_joint_states_without_velocities_do_not_state_them(
    velocity: list[float], stated: bool
) -> None:
    message = JointState(name=list(JOINT_NAMES), position=[0.0] * 6, velocity=velocity)
    measured = measured_velocity(message, JOINT_NAMES)
    assert (measured is not None) == stated


CELL = load_cell("demo")


def given(**fields: list[float]) -> JointState:
    return JointState(**{"name": list(JOINT_NAMES), "position": list(CELL.park), **fields})


@pytest.mark.parametrize(
    ("message", "sentence"),
    [
        (
            given(velocity=[0.0, float("nan"), 0.0, 0.0, 0.0, 0.0]),
            r"velocity\[1\] is nan: it must be finite",
        ),
        (given(velocity=[float("inf")] * 6), r"velocity\[0\] is inf"),
        (given(velocity=[0.0]), "velocity has 1 values: it must have none or as many as 6 joints"),
        (given(position=[], name=[], velocity=[0.0] * 6), "position has 0 values"),
    ],
)
def test_velocities_of_a_state_are_looked_at(message: JointState, sentence: str) -> None:
    for code in (StatusCode.START_STATE_INVALID, StatusCode.INVALID_ROBOT_STATE):
        with pytest.raises(RequestError, match=sentence) as caught:
            state_of(message, CELL, code)
        assert caught.value.status.code == code


def test_a_start_or_goal_that_moves_is_refused_and_a_state_that_moves_is_none_the_less_a_state() -> (  # noqa: E501
    None
):
    names = list(JOINT_NAMES)[::-1]
    position = list(CELL.park)[::-1]
    message = given(name=names, position=position, velocity=[0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    sentence = r"start: joint_a6 has a velocity of 0\.5 rad/s, it must be 0 rad/s within 0\.01"
    with pytest.raises(RequestError, match=sentence):
        state_of(message, CELL, StatusCode.START_STATE_INVALID, "start")
    free = state_of(message, CELL, StatusCode.INVALID_ROBOT_STATE)
    assert free is not None
    assert free.tolist() == list(CELL.park)
    slow = given(velocity=[1e-4] * 6, effort=[float("nan")] * 6)
    assert state_of(slow, CELL, StatusCode.START_STATE_INVALID, "start") is not None


@hypothesis.given(
    own=st.permutations(["joint_a1", "joint_a2", "joint_a3"]),
    others=st.lists(
        st.sampled_from(["finger", "e1", "left/joint_a1", "left_joint_a2"]), unique=True
    ),
    seed=st.integers(0, 2**32 - 1),
    velocities=st.booleans(),
)
def test_joints_beside_the_robot_s_are_left_out_of_joint_states(own, others, seed, velocities):
    names = [*own, *others]
    generator = np.random.default_rng(seed)
    generator.shuffle(names)
    values = {
        name: float(value)
        for name, value in zip(names, generator.normal(size=len(names)), strict=True)
    }
    msg = JointState(name=names, position=[values[name] for name in names])
    if velocities:
        msg.velocity = [2.0 * values[name] for name in names]
    robot = ("joint_a1", "joint_a2", "joint_a3")
    assert has_joints(msg, robot)
    found = of_joints(msg, robot)
    assert sorted(found.name) == sorted(robot)
    assert list(found.position) == [values[name] for name in found.name]
    assert list(found.velocity) == [2.0 * values[name] for name in found.name] * velocities


def test_joints_that_are_missing_in_joint_states_are_named():
    msg = JointState(name=["joint_a1", "finger"], position=[0.0, 0.0])
    assert not has_joints(msg, ("joint_a1", "joint_a2"))
    with pytest.raises(JointNamesError, match=r"joint_a2 missing .* has joint_a1, finger"):
        of_joints(msg, ("joint_a1", "joint_a2"))
