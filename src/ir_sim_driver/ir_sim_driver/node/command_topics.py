"""Commands by topic: trajectories and PLC inputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rclpy.node import Node
from rclpy.serialization import deserialize_message
from trajectory_msgs.msg import JointTrajectory

from ir_msgs.msg import PlcInputs
from ir_msgs_py import names
from ir_msgs_py.errors import MsgsError
from ir_msgs_py.plc import PlcInputs as Levels
from ir_msgs_py.ros.power_conversions import plc_inputs_from_msg
from ir_msgs_py.ros.topics import CommandTopic
from ir_sim_driver.controller import Driver
from ir_sim_driver.errors import DriverError
from ir_sim_driver.motion import ErrorCode, Outcome, TrajectoryGoal
from ir_sim_driver.node.messages import goal_from_trajectory
from ir_sim_driver.plc import TOPIC

# PLC inputs.


class PlcTopic:
    """Hands each message to the driver, in the order in which they were sent."""

    def __init__(self, node: Node, driver: Driver) -> None:
        self._driver = driver
        CommandTopic(node, PlcInputs, names.PLC_INPUTS, self._take)

    def _take(self, messages: Sequence[PlcInputs]) -> None:
        levels = [read for msg in messages if (read := self._read(msg)) is not None]
        self._write(lambda: self._driver.plc.write_all_inputs(TOPIC, *levels))

    def _read(self, msg: PlcInputs) -> Levels | None:
        """The levels; None for a message that makes no sense, of which only a pressed stop
        counts.
        """
        try:
            return plc_inputs_from_msg(msg)
        except (MsgsError, ValueError) as error:
            self._driver.warn(f"plc_inputs ignored: {error}")
        if msg.emergency_stop:
            self._write(lambda: self._driver.plc.write_inputs(TOPIC, {"emergency_stop": True}))
        return None

    def _write(self, write: Callable[[], None]) -> None:
        try:
            write()
        except (MsgsError, DriverError) as error:
            self._driver.warn(f"plc_inputs ignored: {error}")


# Trajectories by topic: taken as bytes, so that a huge one is refused before Python objects are
# made of it, and parsed beside the control loop.

_POINT = (
    256  # bytes; one with positions, velocities, accelerations and efforts of six joints has 232
)
_HEAD = 65_536  # bytes for header and names: some twenty times what they need


class TrajectoryTopic:
    """Hands each trajectory to the driver; what is refused becomes a warning."""

    def __init__(self, node: Node, driver: Driver) -> None:
        self._driver = driver
        topic = names.COMMANDED_TRAJECTORY
        node.create_subscription(JointTrajectory, topic, self._take, 10, raw=True)

    def _take(self, message: bytes) -> None:
        most = self._driver.max_points
        bound = _HEAD + _POINT * most
        if len(message) > bound:
            size = f"{len(message)} bytes: at most {bound}, for {most} points"
            self._driver.warn(f"trajectory of the topic: it has {size}")
            return

        def read() -> TrajectoryGoal:
            return goal_from_trajectory(deserialize_message(message, JointTrajectory), most)

        self._driver.submit(0, read, self._ended)  # the points are counted when it is read

    def _ended(self, outcome: Outcome) -> None:
        if outcome.code is not ErrorCode.SUCCESSFUL:
            self._driver.warn(f"trajectory of the topic: {outcome.sentence} ({outcome.code.name})")
