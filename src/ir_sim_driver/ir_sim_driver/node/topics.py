"""Topics of the driver's node: trajectories that come by topic, and what the plant's thread
publishes, joint states at every stamp and first, the rest when it is due.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header, UInt64
from trajectory_msgs.msg import JointTrajectory

from ir_msgs.msg import ControllerState, LoadCheck, PlcInputs, PlcOutputs, PowerState
from ir_msgs_py import names
from ir_msgs_py.names import own
from ir_msgs_py.plc import PlcInputs as Levels
from ir_msgs_py.ros.conversions import recovery_to_msg, time_to_msg
from ir_msgs_py.ros.power_conversions import (
    plc_inputs_to_msg,
    plc_outputs_to_msg,
    power_state_to_msg,
)
from ir_msgs_py.ros.rclpy_inside import can_take_messages, take_bytes
from ir_msgs_py.ros.topics import LATCHED
from ir_sim_driver.controller import Driver, Frame, Joints, refused
from ir_sim_driver.motion import ErrorCode, GoalOutcome, TrajectoryGoal
from ir_sim_driver.node.bounded_goals import Admit, TrajectoryReader
from ir_sim_driver.node.controller_interface import ControllerStates
from ir_sim_driver.node.messages import (
    fill_controller_state,
    fill_joint_state,
    fill_load_check,
    goal_from_trajectory,
)

# Trajectories by topic: taken as bytes, so that a huge one is refused before Python objects are
# made of it, and parsed beside the control loop.

# bytes; one with positions, velocities, accelerations and efforts of six joints has 232
_POINT = 256
_OBJECTS = 4  # times its bytes that a message takes as Python objects
_HEAD = 65_536  # bytes for header and names: some twenty times what they need


class TrajectoryTopic:
    """Hands each trajectory to the driver; what is refused becomes a warning.

    admit: from points, bytes and when it was sent.
    """

    def __init__(self, node: Node, driver: Driver, admit: Admit) -> None:
        self._driver = driver
        self._admit = admit
        self._reader = TrajectoryReader()
        topic = own(names.COMMANDED_TRAJECTORY)
        self._subscription = node.create_subscription(
            JointTrajectory, topic, self._take, 10, raw=True
        )

    def take_waiting(self, most: int) -> bool:
        """Take what waits for the executor now, from any thread; whether that was all."""
        if not can_take_messages(self._subscription):
            return True
        for _ in range(most):
            taken = take_bytes(self._subscription)
            if taken is None:
                return True
            self._take(*taken)
        return False

    def _take(self, message: bytes, times: dict[str, int]) -> None:
        most = self._driver.max_points
        bound = _HEAD + _POINT * most
        if len(message) > bound:
            excess = f"{len(message)} bytes: at most {bound}, for {most} points"
            self._driver.warn(f"trajectory of the topic: it has {excess}")
            return

        def read() -> TrajectoryGoal:
            return goal_from_trajectory(self._reader.read(message), most)

        sent = times.get("source_timestamp", 0)
        size = _OBJECTS * len(message)
        admission = self._admit(0, size, sent)  # points are counted when it is read
        if admission.refusal:
            self._ended(refused(admission.refusal))
        else:
            self._driver.submit(0, read, self._ended, admission.ticket)

    def _ended(self, outcome: GoalOutcome) -> None:
        if outcome.code is not ErrorCode.SUCCESSFUL:
            self._driver.warn(f"trajectory of the topic: {outcome.sentence} ({outcome.code.name})")


_NS = 1_000_000_000
# Deep: a subscriber that gets no processor for seconds must not lose what it has not acknowledged
# yet. What is acknowledged leaves the history, so depth costs nothing while everybody keeps up.
_STREAM = QoSProfile(depth=2000)
# messages of /clock per second of real time at most, and at least 100: each wakes every node
_CLOCK_RATE = 125


class StopTopics:
    """Tells of the last stop, and of the PLC's levels in force, as soon as they have changed,
    whoever notices it first: also while the clock of the plant stands.
    """

    def __init__(self, node: Node, driver: Driver) -> None:
        self._driver = driver
        self._stop_numbers = node.create_publisher(UInt64, own(names.STOP_NUMBER), LATCHED)
        self._stop_latched = node.create_publisher(Bool, own(names.STOP_LATCHED), LATCHED)
        self._recoveries = node.create_publisher(Header, own(names.LAST_RECOVERY), LATCHED)
        self._in_force = node.create_publisher(PlcInputs, own(names.PLC_INPUTS_IN_FORCE), LATCHED)
        self._telling = threading.Lock()  # what is newer is told later
        self._number = -1
        self._stopped: bool | None = None
        self._recovery: tuple[int, int] | None = None
        self._inputs: Levels | None = None

    def tell(self) -> None:
        """Publish what has changed; any thread may call it."""
        with self._telling:
            number = self._driver.stop_number
            if number != self._number:
                self._number = number
                self._stop_numbers.publish(UInt64(data=number))
            stopped = self._driver.stopped
            recovery = self._driver.recovery
            if recovery != self._recovery:
                self._recovery = recovery
                self._recoveries.publish(recovery_to_msg(*recovery))
            if stopped is not self._stopped:
                self._stopped = stopped
                self._stop_latched.publish(Bool(data=stopped))
            inputs = self._driver.inputs_in_force
            if inputs is not None and inputs != self._inputs:
                self._inputs = inputs
                self._in_force.publish(plc_inputs_to_msg(inputs))


class Streams:
    """Publishers of `node` for frames of the joints of these names."""

    def __init__(self, node: Node, joint_names: Sequence[str]) -> None:
        self._node = node
        self._names = joint_names
        self._joint_states = node.create_publisher(JointState, names.JOINT_STATES, _STREAM)
        self._power_states = node.create_publisher(PowerState, own(names.POWER_STATE), _STREAM)
        self._controller_states = node.create_publisher(
            ControllerState, own(names.CONTROLLER_STATE), _STREAM
        )
        self._states_of_controllers = ControllerStates(node, joint_names, _STREAM)
        self._load_checks = node.create_publisher(LoadCheck, own(names.LOAD_CHECK), LATCHED)
        self._outputs = node.create_publisher(PlcOutputs, own(names.PLC_OUTPUTS), LATCHED)
        self._joint_state = JointState(name=list(joint_names))
        self._joint_state.header.frame_id = names.BASE_FRAME
        self._clock = None
        self._clock_period = 1

    def give_time(self, rate: int, factor: float) -> None:
        """Publish /clock from now on, for `rate` stamps per second that passes `factor` times as
        fast.
        """
        self._clock = self._node.create_publisher(Clock, "/clock", 10)
        self._clock_period = math.ceil(rate * factor / _CLOCK_RATE) * (_NS // rate)

    def publish_joints(self, joints: Joints) -> None:
        """Publish time, where it is ours, and the joints."""
        stamp_ns = joints.stamp_ns
        if self._clock is not None and stamp_ns % self._clock_period == 0:
            self._clock.publish(Clock(clock=time_to_msg(stamp_ns)))
        if joints.q is not None and joints.qd is not None and joints.torque is not None:
            fill_joint_state(self._joint_state, stamp_ns, joints.q, joints.qd, joints.torque)
            self._joint_states.publish(self._joint_state)

    def publish(self, frame: Frame) -> None:
        """Publish what the frame holds beside its joints."""
        stamp_ns = frame.joints.stamp_ns
        if frame.power is not None:
            self._power_states.publish(power_state_to_msg(frame.power))
        if frame.following is not None:
            state = ControllerState()
            fill_controller_state(state, self._names, stamp_ns, frame.following)
            self._controller_states.publish(state)
            self._states_of_controllers.publish(stamp_ns, frame.following)
        if frame.outputs is not None:
            msg = plc_outputs_to_msg(frame.outputs)
            msg.header.stamp = time_to_msg(stamp_ns)
            self._outputs.publish(msg)
        if frame.load_check is not None:
            msg = LoadCheck()
            fill_load_check(msg, stamp_ns, frame.load_check)
            self._load_checks.publish(msg)
