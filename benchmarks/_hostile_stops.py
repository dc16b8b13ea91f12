"""Stops on a real node, in random interleavings with two clients, a PLC and its service.

    python benchmarks/_hostile_stops.py COUNT SEED

Each episode sends goals (long ones to check, some by topic, some with a stamp ahead), writes bits,
cancels, and presses the emergency stop by one of three ways somewhere in between. What was sent
before a person recovers may not move a joint once the robot stands.
"""

from __future__ import annotations

import json
import os
import random
import socket
import struct
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from typing import Any

import numpy as np
from _hostile_node import PRESS, RELEASE, Prey, prey
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, UInt64
from trajectory_msgs.msg import JointTrajectory as TrajectoryMsg

from ir_msgs.action import ExecuteTrajectory
from ir_msgs.msg import PlcInputs, PowerState
from ir_msgs.srv import Recover, SetPlcInput
from ir_msgs_py import names
from ir_msgs_py.modes import Mode
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.conversions import float_array, trajectory_to_msg
from ir_msgs_py.ros.rclpy_inside import take_bytes
from ir_msgs_py.ros.testing import own_domain
from ir_msgs_py.ros.topics import ACTION_SERVICES, PolledGroup
from ir_msgs_py.trajectory import JointTrajectory
from ir_values.errors import IrError

NEW = 5  # axis of the goals that are sent after the recovery
STILL = 1e-3  # rad; a motor that is switched on again takes up less
STANDING = 3  # messages, 60 ms, in which a robot that stands does not turn
ROLLS = 250  # messages, 5 s, in which a stopped robot has to stand
PATIENCE = 30.0
BACK = 1.5  # s of the goal that brings the robot home
PLC = ("conf_mess", "drives_on", "drives_off", "move_enable", "ab", "end_rest", "AUT")
SHORT = {
    "joint_state_rate": 50,
    "modbus_idle": "3600.0",  # the ways are drawn: on a busy machine none is silent for too long
    "transitions.bus_power_off_enter": "0.05",
    "transitions.bus_power_off_leave": "0.05",
    "transitions.bus_power_off_minimum_stay": "0.05",
    "transitions.stand_on_brakes_enter": "0.02",
    "transitions.stand_on_brakes_minimum_stay": "0.02",
}


DEEP = QoSProfile(depth=2_000)  # of the driver's streams: nothing is lost between two looks
_HEAD = 4  # bytes of CDR in front of a message; what follows is aligned from there


class Stream:
    """A topic whose messages wait, as bytes of CDR, until somebody asks: to wake an executor for
    each costs more processor than all else that a stop needs.
    """

    def __init__(self, node: Node, kind: Any, topic: str) -> None:
        self._subscription = node.create_subscription(
            kind, topic, lambda data: None, DEEP, callback_group=PolledGroup(), raw=True
        )

    def take(self) -> Iterator[bytes]:
        """All that have come, oldest first."""
        taken = take_bytes(self._subscription)
        while taken is not None:
            yield taken[0]
            taken = take_bytes(self._subscription)


def after_header(data: bytes) -> int:
    """Where the field behind a std_msgs/Header that begins a message lies, before it is aligned."""
    return _after_text(data, _HEAD + 8)


def positions_in(data: bytes) -> int:
    """Where the positions of a sensor_msgs/JointState begin; the same in all of one driver."""
    at = _aligned(after_header(data), 4)
    (count,) = struct.unpack_from("<I", data, at)
    at += 4
    for _ in range(count):
        at = _after_text(data, _aligned(at, 4))
    return _aligned(_aligned(at, 4) + 4, 8)


def _after_text(data: bytes, at: int) -> int:
    (size,) = struct.unpack_from("<I", data, at)
    return at + 4 + int(size)


def _aligned(at: int, size: int) -> int:
    return _HEAD + -(-(at - _HEAD) // size) * size


class Cell:
    """A driver with two clients; q: its last positions; moved: axes that have turned since `mark`.

    home: where it stood first. goals: of the present episode, each with what calls a function
    beside its client.
    """

    def __init__(self, driver: Prey, second: Client, modbus: socket.socket) -> None:
        self.driver = driver
        self.clients = (driver.client, second)
        self.modbus = modbus
        self.q: Any = None
        self.home: Any = None
        self.heard = 0
        self._mark: Any = None
        self.moved: set[int] = set()
        self.goals: list[Any] = []
        self.number = 0  # of the last stop
        self.latched = False
        self.mode: int | None = None
        run = driver.client._executor.run
        node = driver.client.node
        self._joints = run(lambda: Stream(node, JointState, names.JOINT_STATES))
        self._powers = run(lambda: Stream(node, PowerState, names.POWER_STATE))
        self._positions = 0
        driver.client.subscribe(names.STOP_NUMBER, UInt64, self._count)
        driver.client.subscribe(names.STOP_LATCHED, Bool, self._latch)
        self._actions = [
            client._executor.run(lambda client=client: self._action(client))
            for client in self.clients
        ]
        self._plc = run(
            lambda: node.create_publisher(PlcInputs, names.PLC_INPUTS, QoSProfile(depth=1000))
        )
        self._path = run(
            lambda: node.create_publisher(TrajectoryMsg, names.COMMANDED_TRAJECTORY, 10)
        )
        ready = (lambda: self.q is not None, self._plc.get_subscription_count)
        for each in (*ready, *(action.server_is_ready for action in self._actions)):
            self.wait(each)

    @staticmethod
    def _action(client: Client) -> ActionClient:
        return ActionClient(
            client.node, ExecuteTrajectory, names.EXECUTE_TRAJECTORY, **ACTION_SERVICES
        )

    def hear(self) -> None:
        """Look at every position that has come, and at the mode."""
        for data in self._joints.take():
            self._positions = self._positions or positions_in(data)
            q = np.frombuffer(data, "<f8", 6, self._positions)
            self.home = q if self.home is None else self.home
            self.q = q
            if self._mark is not None and np.abs(q - self._mark).max() > STILL:
                self.moved.update(np.flatnonzero(np.abs(q - self._mark) > STILL).tolist())
            self.heard += 1
        for data in self._powers.take():
            self.mode = data[after_header(data)]

    def _count(self, message: UInt64) -> None:
        self.number = message.data

    def _latch(self, message: Bool) -> None:
        self.latched = message.data

    def mark(self) -> None:
        """Note from here on which axes turn."""
        self.hear()
        self.moved = set()
        self._mark = self.q

    def stands(self) -> bool:
        """Wait until the robot stands, in the time of its plant, which lags on a busy machine."""
        self.frames(STANDING)  # some are on their way
        for _ in range(ROLLS // STANDING):
            self.mark()
            self.frames(STANDING)
            if not self.moved:
                return True
        return False

    def frames(self, count: int) -> None:
        """Wait for so many messages of positions."""
        ends = self.heard + count
        self.wait(lambda: self.heard >= ends)

    def wait(self, condition: Callable[[], Any], seconds: float = PATIENCE) -> bool:
        """Whether it holds within this time."""

        def holds() -> bool:
            self.hear()
            return bool(condition())

        return self.driver.client._executor.wait_until(holds, seconds)

    def send(self, generator: random.Random, axis: int, *, plain: bool = False) -> None:
        """A goal that turns one axis from where the robot is; plain: and brings the others home,
        as each stop lets the arm sag.
        """
        points = 2 if plain else generator.choice((2, 2, 2, 500, 5_000))
        seconds = generator.uniform(0.2, 1.0)
        self.hear()
        target = np.array(self.home if plain else self.q)
        target[axis] += 0.05 if self.q[axis] < self.home[axis] else -0.05
        seconds = BACK if plain else seconds
        message = message_of(points)
        share = np.linspace(0.0, 1.0, points)[:, None]
        positions = self.q + (share * share * (3.0 - 2.0 * share)) * (target - self.q)
        rates = 6.0 * share * (1.0 - share) * (target - self.q) / seconds
        times = np.rint((0.3 + seconds * share[:, 0]) * 1e9).astype(np.int64).tolist()
        for point, q, qd, at in zip(message.points, positions, rates, times, strict=True):
            point.positions = float_array(q)
            point.velocities = float_array(qd)
            point.time_from_start.sec, point.time_from_start.nanosec = divmod(at, 10**9)
        message.header.stamp.sec, message.header.stamp.nanosec = (0, 0)
        sender = generator.choice((0, 1))
        if not plain and generator.random() < 0.2:
            self.driver.client._executor.run(lambda: self._path.publish(message))
            return
        if not plain and generator.random() < 0.2:
            ahead = self.clients[sender].node.get_clock().now().nanoseconds + 400_000_000
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(ahead, 10**9)
        goal = ExecuteTrajectory.Goal(trajectory=message)
        run = self.clients[sender]._executor.run
        self.goals.append((run, run(lambda: self._actions[sender].send_goal_async(goal))))

    def cancel(self) -> None:
        """Cancel a goal that was taken."""
        for run, sent in self.goals:
            if sent.done() and sent.result().accepted:
                run(sent.result().cancel_goal_async)
                return

    def ended(self) -> list[int] | None:
        """Codes of all goals once each has a result; None while one has not."""
        codes: list[int] = []
        for run, sent in self.goals:
            if not self.wait(sent.done):
                return None
            if sent.result().accepted:
                future = run(sent.result().get_result_async)
                if not self.wait(future.done):
                    return None
                codes.append(int(future.result().result.error_code))
        return codes

    def write(self, name: str, value: bool) -> None:
        """One bit by the service, which may refuse it."""
        self.driver.client.call(names.SET_PLC_INPUT, SetPlcInput.Request(name=name, value=value))

    def press(self, way: str, level: bool) -> None:
        """The button, down or up."""
        if way == "service":
            self.write("emergency_stop", level)
        elif way == "modbus":
            self.modbus.sendall(PRESS if level else RELEASE)
            if not self.modbus.recv(64):
                raise ConnectionError("the driver has cut its Modbus client")
        else:
            levels = PlcInputs(emergency_stop=level, move_enable=True)
            self.driver.client._executor.run(lambda: self._plc.publish(levels))

    def rest(self) -> None:
        """All bits as they are without a PLC."""
        self.write("EXT", True)
        levels = PlcInputs(move_enable=True)
        self.driver.client._executor.run(lambda: self._plc.publish(levels))
        self.write("emergency_stop", False)

    def run(self) -> bool:
        """Recover until the motors are on."""
        for _ in range(100):
            self.driver.client.call(names.RECOVER, Recover.Request())
            self.hear()
            self.mode = None
            self.wait(lambda: self.mode is not None)
            if self.mode == Mode.STAND_ON_BRAKES:
                self.write("drives_on", True)
                time.sleep(0.03)
                self.write("drives_on", False)
            if self.mode == Mode.STAND_ON_MOTORS:
                return True
            time.sleep(0.02)
        return False


@cache
def message_of(points: int) -> TrajectoryMsg:
    """A trajectory of so many points, to be filled again and again: a message is written when it is
    sent, and making thousands of points takes longer than sending them.
    """
    times = np.arange(1, points + 1, dtype=np.float64)
    zeros = np.zeros((points, 6))
    return trajectory_to_msg(JointTrajectory.from_seconds(names.JOINT_NAMES, times, zeros, zeros))


@contextmanager
def cell() -> Iterator[Cell]:
    """A driver with short ways between its modes."""
    with (
        prey(watched=False, **SHORT) as driver,
        Client(timeout=PATIENCE, node_name="second") as second,
        socket.create_connection(("127.0.0.1", driver.port), timeout=PATIENCE) as modbus,
    ):
        yield Cell(driver, second, modbus)


def _events(cell: Cell, generator: random.Random, bits: tuple[str, ...]) -> None:
    """A few things that clients and PLC do, at random times."""
    for _ in range(generator.randrange(1, 5)):
        what = generator.choice(("goal", "goal", "bit", "bit", "cancel"))
        if what == "goal":
            cell.send(generator, generator.randrange(NEW))
        elif what == "cancel":
            cell.cancel()
        else:
            cell.write(generator.choice(bits), generator.random() < 0.6)
        time.sleep(generator.choice((0.0, 0.0, 0.005, 0.025, 0.1)))


class BrokenLawError(Exception):
    """What an episode shows that must not be."""


def _holds(law: bool, otherwise: str) -> None:
    if not law:
        raise BrokenLawError(otherwise)


def episode(cell: Cell, generator: random.Random) -> None:
    """Press, release and recover once, amid whatever comes; raises BrokenLawError."""
    cell.goals = []
    # one of the two that recover together, so that only a person does
    kept_from_the_plc = generator.choice(("conf_mess", "drives_on"))
    bits = tuple(bit for bit in PLC if bit != kept_from_the_plc)
    _press(cell, generator, bits)
    if generator.random() < 0.7:
        _events(cell, generator, bits)
    time.sleep(generator.choice((0.0, 0.05, 0.2)))
    _stands(cell, "while a stop is latched")
    _holds(cell.latched, "the driver says that no stop is latched")
    cell.rest()
    if generator.random() < 0.3:
        _events(cell, generator, ("move_enable",))
        cell.write("move_enable", True)
    time.sleep(0.025)
    _stands(cell, "after the release")
    _holds(cell.run(), f"no recovery: mode {cell.mode}")
    # when all have a result nothing is left that could move; the topic gives none
    _holds(cell.ended() is not None, "a goal has no result")
    cell.frames(generator.choice((1, 3, 10)))
    _stands(cell, "after the recovery, by what came before")
    _holds(cell.wait(lambda: not cell.latched), "the driver says that the stop is still latched")
    if generator.random() < 0.1:
        _moves(cell, generator)


def _press(cell: Cell, generator: random.Random, bits: tuple[str, ...]) -> None:
    """Press the button amid whatever comes, until the robot stands."""
    if generator.random() < 0.7:
        _events(cell, generator, PLC)
    way = generator.choice(("topic", "service", "modbus"))
    known = cell.number
    cell.press(way, True)
    if generator.random() < 0.3:
        cell.press(way, False)
    if generator.random() < 0.5:
        _events(cell, generator, bits)
    _holds(cell.wait(lambda: cell.number > known), f"a press by {way} has no number")
    _holds(cell.stands(), "the robot does not stand after a press")


def _stands(cell: Cell, when: str) -> None:
    cell.hear()
    _holds(not cell.moved, f"axes {sorted(cell.moved)} move {when}")


def _moves(cell: Cell, generator: random.Random) -> None:
    """A goal of after the recovery is driven."""
    cell.goals = []
    cell.send(generator, NEW, plain=True)
    codes = cell.ended()
    _holds(codes == [0], f"a goal of after the recovery ends with {codes}")
    cell.hear()
    _holds(NEW in cell.moved, f"only axes {sorted(cell.moved)} move by a goal for axis {NEW}")


def stops_row(count: int, seed: int) -> dict[str, Any]:
    """Interleavings on a node, and how many of them broke the law."""
    wrong = 0
    began = time.monotonic()
    with cell() as driven:
        for k in range(count):
            try:
                episode(driven, random.Random(seed * 1_000_000 + k))
            except (BrokenLawError, IrError, OSError) as error:
                print(f"episode {k} of seed {seed}: {type(error).__name__}: {error}", flush=True)
                wrong += 1
                with suppress(IrError):
                    driven.rest()
                    driven.run()
    seconds = time.monotonic() - began
    load = os.getloadavg()[0]
    return {
        "case": "node stops",
        "seed": seed,
        "cases": count,
        "wrong": wrong,
        "s": seconds,
        "load": load,
    }


if __name__ == "__main__":
    os.environ["ROS_DOMAIN_ID"] = str(own_domain())
    print(json.dumps(stops_row(int(sys.argv[1]), int(sys.argv[2]))))
