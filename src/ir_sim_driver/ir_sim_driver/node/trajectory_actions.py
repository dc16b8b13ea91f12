"""Trajectory actions: goals given to the driver, followed with feedback, canceled, answered; their
clients watched.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any, Protocol

from ir_msgs.msg import LoadCheck
from ir_msgs_py.ros.goal_clients import Gone
from ir_msgs_py.ros.plan_conversions import contact_to_msg
from ir_sim_driver.controller import Driver, refused
from ir_sim_driver.load_check import LoadFinding
from ir_sim_driver.motion import ErrorCode, GoalOutcome, TrajectoryGoal
from ir_sim_driver.node.bounded_goals import Admission
from ir_sim_driver.node.messages import fill_load_check, fill_points, goal_from_action
from ir_values.errors import one_line


class Executing(Protocol):
    """What the node lends to an action: futures, timers and its clock."""

    def future(self) -> Any:
        """A future of the node's executor."""

    def wake(self) -> None:
        """Let the executor look at its futures."""

    def every(self, seconds: float, callback: Callable[[], None]) -> Callable[[], None]:
        """Call back again and again until the returned function is called."""

    def now_msg(self) -> Any:
        """Time of the plant, as a message."""


FEEDBACK_PERIOD = 0.05  # s: 20 Hz, enough for a person or a progress bar


class Executions:
    """Goals of one kind of action, ExecuteTrajectory or FollowJointTrajectory, on `driver`.

    client_timeout [s]: how long a movement goes on when its client is gone; 0: to its end.
    """

    def __init__(
        self, driver: Driver, node: Executing, action_type: Any, client_timeout: float
    ) -> None:
        self._driver = driver
        self._node = node
        self._type = action_type
        self._client_timeout = client_timeout
        self._tickets: dict[bytes, int] = {}
        self._canceled: set[bytes] = set()
        self.admission_of: Callable[[bytes], Admission] = lambda goal_id: Admission()
        self.watch: Callable[[bytes, float], Gone] = lambda goal_id, timeout: lambda: False

    async def execute(self, handle: Any) -> Any:
        """Carry a goal out; the action's result."""
        key = bytes(handle.goal_id.uuid)
        request = handle.request
        limit = self._driver.max_points
        done = self._node.future()

        def ended(outcome: GoalOutcome) -> None:
            done.set_result(outcome)
            self._node.wake()

        def read() -> TrajectoryGoal:
            goal = goal_from_action(request, limit)
            request.trajectory.points = []  # the arrays of the goal are all that is needed
            return goal

        admission = self.admission_of(key)
        gone = self.watch(key, self._client_timeout)
        if admission.refusal:
            return self._result(handle, refused(admission.refusal))
        points = len(request.trajectory.points)
        ticket = self._driver.submit(points, read, ended, admission.ticket)
        self._tickets[key] = ticket
        if key in self._canceled:  # before it was submitted
            self._driver.cancel(ticket)

        def report() -> None:
            self._publish_feedback(handle, ticket)
            if gone():
                seconds = self._client_timeout
                self._driver.abandon(ticket, f"the goal has had no client for {seconds:g} s")

        end_feedback = self._node.every(FEEDBACK_PERIOD, report)
        outcome: GoalOutcome = await _awaitable(done)
        end_feedback()
        self._tickets.pop(key, None)
        self._canceled.discard(key)
        request.trajectory.points = []  # of a goal that was not read; rclpy keeps it for a minute
        return self._result(handle, outcome)

    def cancel(self, handle: Any) -> None:
        """Stop a goal along its path."""
        key = bytes(handle.goal_id.uuid)
        self._canceled.add(key)
        ticket = self._tickets.get(key)
        if ticket is not None:
            self._driver.cancel(ticket)

    def _result(self, handle: Any, outcome: GoalOutcome) -> Any:
        result = self._type.Result()
        result.error_code = int(outcome.code)
        result.error_string = one_line(outcome.sentence)
        if hasattr(result, "max_tool_deviation"):  # ours; FollowJointTrajectory knows neither
            result.max_tool_deviation = outcome.max_tool_deviation
            result.energy = outcome.energy
            result.max_tracking_error = list(outcome.max_tracking_error)
            result.settling_time = outcome.settling_time
            result.plant = self._driver.plant.name
            result.load_check = _load_checks(outcome.load_check, self._driver.stamp_ns)
            result.contacts = [] if outcome.contact is None else [contact_to_msg(outcome.contact)]
        if outcome.canceled or (
            handle.is_cancel_requested and outcome.code is ErrorCode.SUCCESSFUL
        ):
            handle.canceled()
        elif outcome.code is ErrorCode.SUCCESSFUL:
            handle.succeed()
        else:
            handle.abort()
        return result

    def _publish_feedback(self, handle: Any, ticket: int) -> None:
        following = self._driver.following(ticket)
        if following is None:
            return
        feedback = self._type.Feedback(joint_names=list(self._driver.joint_names))
        feedback.header.stamp = self._node.now_msg()
        fill_points(feedback.desired, feedback.actual, feedback.error, following)
        handle.publish_feedback(feedback)


def _load_checks(finding: LoadFinding | None, stamp_ns: int) -> list[LoadCheck]:
    if finding is None:
        return []
    msg = LoadCheck()
    fill_load_check(msg, stamp_ns, finding)
    return [msg]


def _awaitable(future: Any) -> Awaitable[GoalOutcome]:
    awaitable: Awaitable[GoalOutcome] = future
    return awaitable
