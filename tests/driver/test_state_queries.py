"""The commanded state at a time, as clients of the joint trajectory controller ask for it; needs no
control_msgs.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from builtin_interfaces.msg import Time

from ir_description import load_cell
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.controller import Driver, make_simulation
from ir_sim_driver.controller.settings import SimulationSettings
from ir_sim_driver.motion import TrajectoryGoal
from ir_sim_driver.node.controller_interface import StateQueries

TICK = 2_000_000  # ns
DT = TICK * 1e-9
ROUNDING = 1e-6  # rad: a stamp has whole nanoseconds, path time sums steps


class Asked:
    """A driver that is ticked by hand, and asked."""

    def __init__(self):
        cell = load_cell("open")
        self.driver = Driver(make_simulation(cell, "none", "ideal", SimulationSettings()))
        self.now = 0
        self.ended = []

    def tick(self, count=1):
        for _ in range(count):
            self.now += TICK
            self.driver.tick(self.now)

    def at(self, stamp_ns):
        seconds, nanoseconds = divmod(stamp_ns, 10**9)
        request = SimpleNamespace(time=Time(sec=seconds, nanosec=nanoseconds))
        response = SimpleNamespace(success=None, message="", position=[], velocity=[], name=[])
        return StateQueries(self.driver).answer(request, response)

    def command(self):
        return np.array(self.at(self.now).position)

    def start(self, wait_for):
        start = self.command()
        points = np.stack([start, start + 0.2, start])
        trajectory = JointTrajectory(
            self.driver.joint_names,
            times_ns=np.array([0, 1, 2]) * 10**9,
            positions=points,
            velocities=np.zeros((3, 6)),
        )
        self.driver.submit(3, lambda: TrajectoryGoal(trajectory, 0), self.ended.append)
        wait_for(lambda: self.driver.moving, what="the movement starts")


@pytest.fixture
def asked():
    asked = Asked()
    asked.tick(5)
    yield asked
    asked.driver.close()


def test_standing_it_is_the_held_command_now_and_later_and_nothing_before(asked):
    here = asked.at(asked.now)
    later = asked.at(asked.now + 10**9)
    assert here.success
    assert here.name == list(asked.driver.joint_names)
    assert list(here.position) == list(later.position)
    assert not any(here.velocity)
    before = asked.at(asked.now - TICK)
    assert not before.success
    assert "0.002 s ago" in before.message


@pytest.mark.parametrize("ahead", [1, 7, 40, 200])
def test_what_is_foretold_is_what_is_commanded_then(asked, wait_for, ahead):
    asked.start(wait_for)
    asked.tick(300)  # past the beginning, at full speed
    foretold = asked.at(asked.now + ahead * TICK)
    begun = np.array(foretold.velocity)
    asked.tick(ahead)
    assert np.array(foretold.position) == pytest.approx(asked.command(), abs=ROUNDING)
    assert begun == pytest.approx(asked.at(asked.now).velocity, abs=1e-3)


def test_velocity_is_the_derivative_of_position_at_any_speed_factor(asked, wait_for):
    asked.start(wait_for)
    asked.driver.set_speed_scaling(0.4)
    asked.tick(400)
    early, now, late = (asked.at(asked.now + k * TICK) for k in (-1, 0, 1))
    slope = (np.array(late.position) - np.array(early.position)) / (2.0 * DT)
    assert np.abs(slope).max() > 0.01
    assert slope == pytest.approx(now.velocity, abs=1e-4)


def test_after_the_end_it_stands_there_and_long_ago_is_refused(asked, wait_for):
    start = asked.command()
    asked.start(wait_for)
    asked.tick(300)
    end = asked.at(asked.now + 10**10)
    assert np.array(end.position) == pytest.approx(start, abs=1e-9)
    assert not any(end.velocity)
    assert not asked.at(asked.now - 10**10).success
