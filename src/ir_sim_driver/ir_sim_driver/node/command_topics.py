"""Trajectories by topic: taken as bytes, so that a huge one is refused before Python objects are
made of it, and parsed beside the control loop.
"""

from __future__ import annotations

from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from ir_msgs_py import names
from ir_msgs_py.names import own
from ir_msgs_py.ros.rclpy_inside import can_take_messages, take_bytes
from ir_sim_driver.controller import Driver, refused
from ir_sim_driver.motion import ErrorCode, GoalOutcome, TrajectoryGoal
from ir_sim_driver.node.messages import goal_from_trajectory
from ir_sim_driver.node.trajectory_actions import Admit, TrajectoryReader

# bytes; one with positions, velocities, accelerations and efforts of six joints has 232
_POINT = 256
_OBJECTS = 4  # times its bytes that a message takes as Python objects
_HEAD = 65_536  # bytes for header and names: some twenty times what they need


class TrajectoryTopic:
    """Hands each trajectory to the driver; what is refused becomes a warning.

    admit: from points and bytes.
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
            self._take(taken[0])
        return False

    def _take(self, message: bytes) -> None:
        most = self._driver.max_points
        bound = _HEAD + _POINT * most
        if len(message) > bound:
            size = f"{len(message)} bytes: at most {bound}, for {most} points"
            self._driver.warn(f"trajectory of the topic: it has {size}")
            return

        def read() -> TrajectoryGoal:
            return goal_from_trajectory(self._reader.read(message), most)

        admission = self._admit(0, _OBJECTS * len(message))  # points are counted when it is read
        if admission.refusal:
            self._ended(refused(admission.refusal))
        else:
            self._driver.submit(0, read, self._ended, admission.ticket)

    def _ended(self, outcome: GoalOutcome) -> None:
        if outcome.code is not ErrorCode.SUCCESSFUL:
            self._driver.warn(f"trajectory of the topic: {outcome.sentence} ({outcome.code.name})")
