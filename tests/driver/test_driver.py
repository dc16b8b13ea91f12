"""The running simulation without ROS: frames, goals checked beside it, outcomes to their
senders.
"""

from __future__ import annotations

import functools
import threading

import numpy as np
import pytest

from ir_msgs_py.modes import Mode
from ir_msgs_py.ros.testing import PATIENCE
from ir_sim_driver.controller.driver import Driver
from ir_sim_driver.controller.goals import NO_GOAL, QUEUE_MAX
from ir_sim_driver.controller.settings import ControllerSettings
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion import ExecutionSettings
from ir_sim_driver.motion.goal import ErrorCode, TrajectoryGoal
from ir_sim_driver.power import IdleTimes

PERIOD = 2_000_000


@pytest.fixture
def driver(make):
    driver = Driver(make())
    yield driver
    driver.close()


def frames(driver, count, first=1):
    return [driver.tick((first + k) * PERIOD) for k in range(count)]


def test_frames_carry_what_is_due(driver):
    got = frames(driver, 500)
    assert all(frame.joints.q is not None for frame in got)
    assert sum(frame.power is not None for frame in got) == 100
    assert sum(frame.following is not None for frame in got) == 50
    assert sum(frame.outputs is not None for frame in got) == 1  # outputs only when they change


def test_joints_are_handed_out_before_the_meter_is_read(make, monkeypatch):
    """The meter takes a fifth of a tick at every fifth one: joint states would come that
    irregularly.
    """
    simulation = make()
    driver = Driver(simulation)
    happened = []
    settle = simulation.mains.settle
    monkeypatch.setattr(simulation.mains, "settle", lambda: (happened.append("meter"), settle())[1])
    for k in range(1, 51):
        frame = driver.tick(k * PERIOD, happened.append)
        assert frame.joints in happened[-2:]
    driver.close()
    assert happened.count("meter") == 10
    before_meter = [happened[k - 1] for k, event in enumerate(happened) if event == "meter"]
    assert [joints.stamp_ns for joints in before_meter] == [5 * k * PERIOD for k in range(1, 11)]


def test_power_is_the_mean_since_the_last_frame(driver, plan, cell, wait_for):
    home = np.array(cell.machine_home)
    goal = TrajectoryGoal(plan(1.5, home, home + 0.1))
    ticket = driver.submit(2, lambda: goal, lambda outcome: None)
    wait_for(lambda: driver.following(ticket) is not None, what="the goal starts")
    powers = [frame.power for frame in frames(driver, 500) if frame.power is not None]
    energy = np.array([power.energy for power in powers])
    mean = np.array([power.power for power in powers])
    assert np.allclose(np.diff(energy), mean[1:] * 0.01, rtol=1e-9)
    assert len(set(np.round(mean, 3))) > 5


def test_a_sleeping_controller_leaves_only_the_meter(make):
    driver = Driver(make(controller=ControllerSettings(start_mode="HIBERNATION")))
    got = frames(driver, 50)
    assert all(frame.joints.q is None and frame.following is None for frame in got)
    powers = [frame.power for frame in got if frame.power is not None]
    assert len(powers) == 10
    assert powers[-1].mode is Mode.HIBERNATION
    assert not got[-1].outputs or not got[-1].outputs.bbs
    driver.close()


def test_outcomes_reach_the_sender_of_their_goal(driver, plan, cell, wait_for):
    home = np.array(cell.machine_home)
    outcomes = []
    for target in (home + 0.05, home - 0.05):
        goal = TrajectoryGoal(plan([1.5], target))
        ended = functools.partial(
            lambda target, outcome: outcomes.append((target[0], outcome.code)), target
        )
        ticket = driver.submit(2, lambda goal=goal: goal, ended)
        wait_for(lambda ticket=ticket: driver.following(ticket) is not None, what="the goal starts")
        frames(driver, 100)
    frames(driver, 800)
    assert outcomes == [
        (home[0] + 0.05, ErrorCode.INVALID_GOAL),  # preempted
        (home[0] - 0.05, ErrorCode.SUCCESSFUL),
    ]


def test_a_goal_that_is_cancelled_while_it_is_checked_ends_as_cancelled(
    driver, plan, cell, wait_for
):
    home = np.array(cell.machine_home)
    release = threading.Event()
    outcomes = []

    def slow():
        release.wait(PATIENCE)
        return TrajectoryGoal(plan(60.0, home, home + 0.1))

    ticket = driver.submit(2, slow, outcomes.append)
    driver.cancel(ticket)
    release.set()
    wait_for(lambda: driver.following(ticket) is not None, what="the goal starts")
    frames(driver, 500)
    assert [(outcome.canceled, outcome.code) for outcome in outcomes] == [
        (True, ErrorCode.SUCCESSFUL)
    ]


def test_what_a_goal_is_refused_for_reaches_its_sender(driver):
    heard = []
    done = threading.Event()

    def refuse():
        raise TrajectoryRefusedError(ErrorCode.INVALID_JOINTS, "no such joint")

    def ended(outcome):
        heard.append(outcome)
        done.set()

    driver.submit(2, refuse, ended)
    assert done.wait(PATIENCE)
    assert (heard[0].goal_id, heard[0].code, heard[0].sentence) == (
        NO_GOAL,
        ErrorCode.INVALID_JOINTS,
        "no such joint",
    )


def test_a_flood_of_goals_is_bounded(driver):
    release = threading.Event()
    answers = []

    def slow():
        release.wait(PATIENCE)
        raise TrajectoryRefusedError(ErrorCode.INVALID_GOAL, "late")

    for _ in range(QUEUE_MAX + 20):
        driver.submit(2, slow, answers.append)
    assert len(answers) == 20
    assert all("send fewer" in answer.sentence for answer in answers)
    release.set()


def test_a_goal_of_too_many_points_is_refused_before_it_waits(driver):
    answers = []
    limit = ExecutionSettings().max_points
    driver.submit(limit + 1, lambda: pytest.fail("it was read"), answers.append)
    assert answers[0].sentence == f"the trajectory has {limit + 1} points: at most {limit}"


def test_a_check_does_not_hold_up_the_plant(driver):
    blocking = threading.Event()
    release = threading.Event()

    def slow():
        blocking.set()
        release.wait(PATIENCE)
        raise TrajectoryRefusedError(ErrorCode.INVALID_GOAL, "late")

    driver.submit(2, slow, lambda outcome: None)
    assert blocking.wait(PATIENCE)
    assert len(frames(driver, 100)) == 100
    release.set()


def test_energy_is_the_integral_of_the_published_power(make):
    driver = Driver(make(idle=IdleTimes(motors_to_brakes_in_program=5.0)), steps=20)
    total = 0.0
    for k in range(1, 1500):
        frame = driver.tick(k * 10 * PERIOD)
        if frame.power is not None:
            total += frame.power.power * 0.02
            last = frame.power.energy
    assert total == pytest.approx(last, rel=1e-9)
    driver.close()


def test_what_was_sent_before_the_last_recovery_is_refused_but_not_by_a_clock_that_was_set_back(
    driver, monkeypatch
):
    clock = [5000]
    monkeypatch.setattr(driver._goals, "_wall", lambda: clock[0])
    assert driver.recovery[1] == 0
    assert driver.admit(1, sent=1)  # no stop came yet
    driver.press("service", "emergency_stop", True)
    frames(driver, 500)
    driver.press("service", "emergency_stop", False)
    frames(driver, 500, first=501)
    assert driver.recovery[1] == 0  # a press is no recovery
    clock[0] = 7000
    driver.recover()
    assert driver.recovery == (driver.stop_number, 7000)
    with pytest.raises(TrajectoryRefusedError, match="before stop 1 was recovered"):
        driver.admit(1, sent=6999)
    assert driver.admit(1, sent=7000)
    assert driver.admit(1)  # not known when it was sent
    clock[0] = 6000
    frames(driver, 1, first=1001)
    assert driver.recovery == (driver.stop_number, 6000)
    assert driver.admit(1, sent=6000)
