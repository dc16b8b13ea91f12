"""A robot that stands within the start tolerance of a trajectory gets onto it from every side."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ir_sim_driver.controller.simulation import make_simulation
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion import ExecutionSettings, PathMotion, check_trajectory, checked_route

SETTINGS = ExecutionSettings()
SIGNS = [[1.0 if k >> j & 1 else -1.0 for j in range(6)] for k in range(64)]


@pytest.fixture(scope="module")
def loaded():
    """Simulations of the demonstration by load."""
    return {
        load: make_simulation("demo", load, "ideal") for load in ("none", "cell", "gripper+gear")
    }


def still(q):
    return PathMotion(q, np.zeros(6), np.zeros(6))


def on(simulation, plan, q, stands):
    """Route from where the robot stands onto a trajectory that waits at q; None where that is
    refused.
    """
    robot = simulation.robot
    dynamics = simulation.dynamics
    waiting = plan(1.0, q, q)
    try:
        check_trajectory(waiting, robot, dynamics, SETTINGS)
    except TrajectoryRefusedError:
        return None
    return checked_route(waiting, still(stands), robot, dynamics, SETTINGS)


def at_home(simulation, signs, size):
    home = np.array(simulation.cell.machine_home)
    return home, home + size * np.array(signs)


@pytest.mark.sampled
@pytest.mark.parametrize("load", ["none", "cell", "gripper+gear"])
@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e-3, 0.0099])
def test_at_home_every_direction_of_the_difference_is_closed(loaded, plan, load, size):
    for signs in SIGNS:
        q, stands = at_home(loaded[load], signs, size)
        route = on(loaded[load], plan, q, stands)
        assert route is not None
        assert route.lead == 1
        assert np.abs(route.path.position(route.offset) - q).max() < 1e-12


@settings(max_examples=300)
@given(
    load=st.sampled_from(["none", "cell", "gripper+gear"]),
    where=st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6),
    shares=st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6),
    exponent=st.floats(-11.0, -2.01),
)
@example("cell", [0.5, 0.5, 0.5, 0.5, 0.5, 0.5], [1.0, 1.0, -1.0, 1.0, 1.0, 1.0], -4.0)
def test_wherever_it_stands_the_difference_is_closed_straight(
    loaded, plan, load, where, shares, exponent
):
    simulation = loaded[load]
    low = simulation.robot.position_min
    high = simulation.robot.position_max
    q = low + np.array(where) * (high - low)
    stands = np.clip(q + 10.0**exponent * np.array(shares), low, high)
    route = on(simulation, plan, q, stands)
    if route is None:  # the trajectory itself asks too much
        return
    straight = np.array([route.path.position(route.offset * k / 50.0) for k in range(51)])
    assert np.abs(straight[-1] - q).max() < 1e-12
    steps = np.diff(straight, axis=0) * np.sign(q - stands)
    assert steps.min() > -1e-13  # straight there: no joint turns back


def test_what_is_closed_gently_already_is_not_slowed_down_for_those_that_are_not(loaded, plan):
    """The time follows from the torques of this difference, not from the worst one."""
    times = []
    for signs in SIGNS:
        q, stands = at_home(loaded["cell"], signs, 0.005)
        times.append(on(loaded["cell"], plan, q, stands).offset)
    assert min(times) < 0.2
    assert len({round(time, 6) for time in times}) > 1


def test_a_stamp_is_kept_also_where_a_difference_is_closed_before_it(make, plan, start, cell):
    simulation = make()
    home = np.array(cell.machine_home)
    start(simulation, plan(1.0, home + 0.009, home), stamp_ns=1_000_000_000)
    simulation.run(1.0)
    assert simulation.executor.path_time == pytest.approx(0.0, abs=2e-3)
    assert np.abs(simulation.executor.command - home - 0.009).max() < 1e-6
