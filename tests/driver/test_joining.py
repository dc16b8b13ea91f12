"""Law: a trajectory that begins in the motion which the driven movement has farther on is joined
there: what is driven until then is the movement as it was planned, and nothing jumps.
"""

from __future__ import annotations

import numpy as np
import pytest

from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion import ErrorCode
from ir_values.arrays import FloatArray


def drawn(cell, seed) -> tuple[JointTrajectory, JointTrajectory, float]:
    """A movement over a knot, another that begins on it, and the time where."""
    draw = np.random.default_rng(seed)
    home = np.array(cell.machine_home)
    names = cell.robot.joint_names
    away = draw.uniform(0.1, 0.3, 6) * draw.choice([-1.0, 1.0], 6)
    rest = np.zeros(6)
    driven = JointTrajectory.from_seconds(
        names,
        [0.0, 1.5, 3.0],
        [home, home + 0.5 * away, home + away],
        [rest, 0.6 * away / 1.5, rest],
        [rest, draw.uniform(-0.1, 0.1, 6), rest],
    )
    at = draw.uniform(0.9, 2.3)
    q, qd, qdd = (values[0] for values in driven.sample([at])[:3])
    goal = home + 0.5 * away + draw.uniform(-0.1, 0.1, 6)
    following = JointTrajectory.from_seconds(names, [0.0, 2.5], [q, goal], [qd, rest], [qdd, rest])
    return driven, following, at


def commands(simulation, steps: int) -> FloatArray:
    found = []
    for _ in range(steps):
        simulation.step()
        found.append(simulation.executor.command.copy())
    return np.array(found)


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("scaling", [1.0, 0.6])
@pytest.mark.parametrize("stamped", [False, True])
def test_what_was_planned_ahead_is_joined_without_a_jump(make, start, cell, seed, scaling, stamped):
    driven, following, at = drawn(cell, seed)
    simulation = make()
    simulation.set_speed_scaling(scaling)
    start(simulation, driven)
    dt = simulation.settings.dt
    before = commands(simulation, round((at - 0.5) / scaling / dt))
    s = simulation.executor.path_time
    stamp = round((at - s) * 1e9) if stamped else 0
    start(simulation, following, 0, **({"stamp_ns": stamp} if stamped else {}))
    assert simulation.executor.path_time == pytest.approx(s - at, abs=1e-5)
    after = commands(simulation, round((following.duration + 0.5) / scaling / dt) + 10)
    whole = driven.until(at).then(following)
    q = np.concatenate([before, after])
    path_times = np.minimum(scaling * dt * np.arange(1, len(q) + 1), whole.duration)
    begun = int(np.argmax(np.abs(q - driven.positions[0]).max(axis=1) > 0.0))
    expected = whole.sample(np.minimum(path_times + 0.0, whole.duration)).q
    offset = np.abs(q - expected).max()
    assert offset < 2.0 * dt * cell.robot.velocity_max.max(), begun
    change = np.abs(np.diff(q, 2, axis=0)) / (scaling * dt) ** 2
    smooth = np.abs(np.diff(whole.sample(path_times).q, 2, axis=0)) / (scaling * dt) ** 2
    assert change.max() <= smooth.max() + 0.1
    codes = [outcome.code for outcome in simulation.take_outcomes()]
    assert codes == [ErrorCode.INVALID_GOAL, ErrorCode.SUCCESSFUL]
    assert np.abs(simulation.backend.q - following.positions[-1]).max() < 1e-6


def test_what_begins_beside_the_movement_or_behind_is_not_joined(make, start, cell):
    driven, following, at = drawn(cell, 1)
    simulation = make()
    start(simulation, driven)
    simulation.run(at - 0.4)
    beside = JointTrajectory(
        following.joint_names,
        following.times_ns,
        following.positions + 0.02,
        following.velocities,
        following.accelerations,
    )
    with pytest.raises(TrajectoryRefusedError):
        start(simulation, beside)
    simulation.run(0.8)
    with pytest.raises(TrajectoryRefusedError):
        start(simulation, following)
    assert simulation.executor.active


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(8))
def test_a_stop_at_any_moment_ends_the_movement_and_what_joins_it(make, start, cell, seed):
    """Nothing moves between the stop and the recovery nor for longer than both would take after
    it.
    """
    driven, following, at = drawn(cell, seed)
    draw = np.random.default_rng(seed)
    simulation = make()
    start(simulation, driven)
    simulation.run(at - 0.5)
    start(simulation, following)
    simulation.run(draw.uniform(0.0, 2.0))  # before they meet, or behind
    assert simulation.executor.active
    simulation.plc.set_bit("emergency_stop", True)
    simulation.run(draw.uniform(0.5, 1.0))
    stood = simulation.backend.q.copy()
    assert [outcome.code for outcome in simulation.take_outcomes()] == [ErrorCode.INVALID_GOAL] * 2
    simulation.plc.set_bit("emergency_stop", False)
    simulation.run(draw.uniform(0.05, 1.0))
    assert np.array_equal(simulation.backend.q, stood)
    simulation.recover()
    simulation.run(driven.duration + following.duration)
    assert not simulation.executor.active
    assert np.abs(simulation.backend.q - stood).max() < 1e-3  # motors take up what the arm sagged
