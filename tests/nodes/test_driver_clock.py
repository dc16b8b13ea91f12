"""The driver on somebody else's /clock: late start, freeze, a hundred times faster, back and
ahead.
"""

from __future__ import annotations

import threading
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, UInt64

from ir_description import load_cell
from ir_msgs.action import ExecuteTrajectory
from ir_msgs.msg import PlcInputs
from ir_msgs.srv import SetPlcInput
from ir_msgs_py import names
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.conversions import trajectory_to_msg
from ir_msgs_py.ros.node_process import heed_times_only
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.ros.topics import LATCHED
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.node import SimDriver

NS = 1_000_000_000
PERIOD = 2_000_000
# messages that wait for a listener; beyond 5,000 within a process Fast DDS gives no more, ever
DEPTH = 4_000
TOLD = 30.0  # s; on a busy machine
TICK = 5_000_000  # ns of real time between two messages of the clock
# of its speed, while the plant of a busy machine is a second behind; at five the grid begins anew
CREEP = 0.01


class ClockSource:
    """Publishes /clock every 5 ms from a thread of its own, `rate` [s/s] times as fast as real
    time.

    A rate of up to 1 is for a plant that follows: where its joint states, `stamps`, are behind, it
    is waited for.
    """

    def __init__(self, node, stamps):
        self._stamps = stamps
        self._publisher = node.create_publisher(Clock, "/clock", 10)
        self.now = 0
        self._rate = 1.0
        self._changing = threading.Lock()
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self, now):
        self.now = now
        self._thread.start()

    def run_at(self, rate):
        """Go on at this rate; the present time [ns]."""
        with self._changing:
            self._rate = rate
            return self.now

    def leap(self, seconds):
        with self._changing:
            self.now += seconds * NS

    def close(self):
        self._end.set()
        if self._thread.is_alive():
            self._thread.join()

    def _follows(self):
        return self._rate > 1.0 or not self._stamps or self.now - self._stamps[-1] < NS

    def _run(self):
        while not self._end.wait(TICK / NS):
            with self._changing:
                self.now += round(TICK * self._rate * (1.0 if self._follows() else CREEP))
            msg = Clock()
            msg.clock.sec, msg.clock.nanosec = divmod(self.now, NS)
            self._publisher.publish(msg)


@pytest.fixture
def clock(ros_node, stamps):
    source = ClockSource(ros_node, stamps)
    yield source
    source.close()


@pytest.fixture
def stamps(ros_node):
    received = []
    ros_node.create_subscription(
        JointState,
        names.JOINT_STATES,
        lambda msg: received.append(msg.header.stamp.sec * NS + msg.header.stamp.nanosec),
        QoSProfile(depth=DEPTH),
    )
    return received


@pytest.fixture
def driver(ros_context, ros_executor):
    values = {"cell": "open", "backend": "ideal", "wake_port": 0, "use_sim_time": True}
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    return ros_executor.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))


@pytest.fixture
def client(ros_context, driver):
    with Client(context=ros_context, timeout=PATIENCE) as client:
        yield client


def movement(step=0.05, duration=0.5):
    cell = load_cell("open")
    q = np.array(cell.machine_home)
    rest = np.zeros((2, 6))
    return JointTrajectory.from_seconds(
        cell.robot.joint_names, [0.0, duration], [q, q + step], rest, rest
    )


def gaps(stamps):
    return [b - a for a, b in pairwise(stamps)]


def test_before_the_clock_starts_nothing_passes_and_then_the_grid_begins(
    driver, clock, stamps, wait_for
):
    wait_for(lambda: clock._publisher.get_subscription_count() > 0)
    assert driver._joints is None  # nothing was stepped
    assert not stamps
    clock.start(1_000 * NS)
    wait_for(lambda: len(stamps) > 300)
    assert stamps[0] >= 1_000 * NS
    assert set(gaps(stamps[:300])) == {PERIOD}


def test_times_that_are_none_are_ignored(driver, ros_executor, clock, stamps, wait_for):
    ros_executor.run(lambda: heed_times_only(driver))
    clock.start(-5 * NS)  # it passes 1970 after a while
    clock.run_at(20.0)
    wait_for(lambda: clock.now > NS)
    clock.run_at(1.0)
    wait_for(lambda: len(stamps) > 50)
    assert min(stamps) > 0
    ros_executor._raise_failure()


def test_a_frozen_clock_freezes_the_plant_and_nothing_is_skipped_after(
    driver, client, clock, stamps, wait_for
):
    clock.start(50 * NS)
    wait_for(lambda: len(stamps) > 100)
    frozen = clock.run_at(0.0)
    wait_for(lambda: stamps[-1] + PERIOD > frozen)
    count = len(stamps)
    for _ in range(20):  # services go on while time stands
        assert client.graph.publishers(names.JOINT_STATES)
    assert len(stamps) == count
    clock.run_at(1.0)
    wait_for(lambda: len(stamps) > count + 100)
    assert set(gaps(stamps)) == {PERIOD}
    assert client.execute(movement(), timeout=PATIENCE).energy > 0.0


def test_a_press_is_told_at_once_while_the_clock_stands(
    driver, ros_node, ros_executor, client, clock, stamps, wait_for
):
    told = {}
    for kind, name in (
        (UInt64, names.STOP_NUMBER),
        (Bool, names.STOP_LATCHED),
        (PlcInputs, names.PLC_INPUTS_IN_FORCE),
    ):
        hear = partial(told.__setitem__, name)
        ros_executor.run(
            lambda kind=kind, name=name, hear=hear: ros_node.create_subscription(
                kind, f"/{name}", hear, LATCHED
            )
        )
    clock.start(50 * NS)
    wait_for(lambda: len(stamps) > 100 and len(told) == 3)
    frozen = clock.run_at(0.0)
    wait_for(lambda: stamps[-1] + PERIOD > frozen)
    before = told[names.STOP_NUMBER].data
    count = len(stamps)
    pressing = SetPlcInput.Request(name="emergency_stop", value=True)
    assert client.call(names.SET_PLC_INPUT, pressing).inputs.emergency_stop
    wait_for(lambda: told[names.STOP_NUMBER].data != before, timeout=TOLD, what="its number")
    wait_for(lambda: told[names.STOP_LATCHED].data, timeout=TOLD, what="it is latched")
    in_force = names.PLC_INPUTS_IN_FORCE
    wait_for(lambda: told[in_force].emergency_stop, timeout=TOLD, what="it is in force")
    assert len(stamps) == count


@pytest.mark.parametrize(("jump", "where"), [(-20, "back"), (100, "ahead")])
def test_a_jump_aborts_the_goal_with_its_reason_and_the_grid_starts_anew(
    client, clock, stamps, wait_for, jump, where
):
    clock.start(100 * NS)
    wait_for(lambda: len(stamps) > 100)
    jumped = []

    def leap(feedback):
        if not jumped:
            jumped.append(feedback)
            clock.leap(jump)

    goal = ExecuteTrajectory.Goal(trajectory=trajectory_to_msg(movement(-0.3, 60.0)))
    result = client.send_goal(names.EXECUTE_TRAJECTORY, goal, feedback=leap, timeout=PATIENCE)
    assert result.error_code == ExecuteTrajectory.Result.INVALID_GOAL
    assert f"the clock jumped {where}" in result.error_string
    assert client.send_goal(names.EXECUTE_TRAJECTORY, lead_in(), timeout=PATIENCE).error_code == 0
    assert all(stamp % PERIOD == 0 for stamp in stamps)
    assert sum(gap != PERIOD for gap in gaps(stamps)) == 1


def lead_in():
    """A goal from wherever the robot stands."""
    cell = load_cell("open")
    home = np.array(cell.machine_home)[None]
    trajectory = JointTrajectory.from_seconds(cell.robot.joint_names, [2.0], home, np.zeros((1, 6)))
    return ExecuteTrajectory.Goal(trajectory=trajectory_to_msg(trajectory))


@pytest.mark.long
def test_a_hundred_times_faster_stamps_stay_on_the_grid_and_go_forward(
    client, clock, stamps, wait_for
):
    clock.start(10 * NS)
    wait_for(lambda: len(stamps) > 100)
    clock.run_at(100.0)
    wait_for(lambda: stamps[-1] > 13 * NS)
    clock.run_at(
        0.3
    )  # a busy machine may not follow even at the speed of real time, a frozen clock nobody
    wait_for(lambda: clock.now - stamps[-1] < NS)
    clock.run_at(1.0)
    assert min(gaps(stamps)) >= PERIOD
    assert all(stamp % PERIOD == 0 for stamp in stamps)
    assert client.send_goal(names.EXECUTE_TRAJECTORY, lead_in(), timeout=PATIENCE).error_code == 0


def test_the_clock_is_not_changed_while_the_robot_moves(client, driver, clock, stamps, wait_for):
    clock.start(10 * NS)
    wait_for(lambda: len(stamps) > 100)
    answers = []

    def change(feedback):
        if not answers:
            answers.append(driver.set_parameters([Parameter("use_sim_time", value=False)])[0])
            clock.run_at(1.0)

    clock.run_at(0.2)  # a busy machine must not reach the end before the feedback comes
    goal = ExecuteTrajectory.Goal(trajectory=trajectory_to_msg(movement(0.1, 1.0)))
    assert (
        client.send_goal(
            names.EXECUTE_TRAJECTORY, goal, feedback=change, timeout=PATIENCE
        ).error_code
        == 0
    )
    assert not answers[0].successful
    assert "the robot moves" in answers[0].reason
    assert driver.get_parameter("use_sim_time").value is True


@pytest.mark.parametrize("factor", [1.5, 4.0])
def test_its_own_clock_is_published_100_to_125_times_a_second(
    ros_context, ros_executor, ros_node, wait_for, factor
):
    ticks = []
    states = []
    ros_node.create_subscription(
        Clock, "/clock", lambda msg: ticks.append(stamp_of(msg.clock)), DEPTH
    )
    ros_node.create_subscription(
        JointState, names.JOINT_STATES, lambda msg: states.append(stamp_of(msg.header.stamp)), DEPTH
    )
    values = {"cell": "open", "backend": "ideal", "wake_port": 0, "real_time_factor": factor}
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    ros_executor.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))
    wait_for(lambda: len(ticks) > 20 and len(states) > 200)
    periods = {b - a for a, b in pairwise(ticks)}
    assert len(periods) == 1
    assert NS / 125 <= periods.pop() / factor <= NS / 100  # of real time
    assert set(gaps(states)) == {PERIOD}


def stamp_of(time):
    return time.sec * NS + time.nanosec
