"""The actions: each goal is given to the driver, followed with feedback, canceled, and answered."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from typing import Any, Protocol

from ir_msgs.msg import LoadCheck
from ir_msgs_py.checks import one_line
from ir_msgs_py.ros.plan_conversions import contact_to_msg
from ir_sim_driver.controller import Driver
from ir_sim_driver.load_check import LoadFinding
from ir_sim_driver.motion import ErrorCode, Outcome
from ir_sim_driver.node.goal_clients import ClientWatch
from ir_sim_driver.node.messages import fill_load_check, fill_points, goal_from_action


class Executing(Protocol):
    """What the node lends to an action: futures, timers and its clock."""

    def future(self) -> Any:
        """A future of the node's executor."""

    def wake(self) -> None:
        """Let the executor look at its futures."""

    def every(self, seconds: float, callback: Callable[[], None]) -> Callable[[], None]:
        """Call back again and again until the returned function is called."""

    def subscribers(self, topic: str) -> Sequence[bytes]:
        """Identities of the subscriptions to a topic in the graph."""

    def now_msg(self) -> Any:
        """Present time of the node's clock, as a message."""


FEEDBACK_PERIOD = 0.05  # s: 20 Hz, enough for a person or a progress bar


class Executions:
    """Goals of one kind of action, ExecuteTrajectory or FollowJointTrajectory, called `name`, on
    `driver`.

    client_timeout [s]: how long a movement goes on when its client is gone; 0: to its end.
    """

    def __init__(
        self, driver: Driver, node: Executing, action_type: Any, name: str, client_timeout: float
    ) -> None:
        self._driver = driver
        self._node = node
        self._type = action_type
        self._feedback_topic = f"{name}/_action/feedback"  # every client subscribes to it
        self._client_timeout = client_timeout
        self._tickets: dict[bytes, int] = {}
        self._canceled: set[bytes] = set()
        self.points_of: Callable[[bytes], int] = lambda goal_id: 0  # that the server has left out
        self.client_of: Callable[[bytes], bytes] = lambda goal_id: b""  # its participant

    async def execute(self, handle: Any) -> Any:
        """Carry a goal out; the action's result."""
        key = bytes(handle.goal_id.uuid)
        request = handle.request
        limit = self._driver.max_points
        done = self._node.future()

        def ended(outcome: Outcome) -> None:
            done.set_result(outcome)
            self._node.wake()

        points = self.points_of(key) or len(request.trajectory.points)
        ticket = self._driver.submit(points, lambda: goal_from_action(request, limit), ended)
        self._tickets[key] = ticket
        if key in self._canceled:  # before it was submitted
            self._driver.cancel(ticket)
        watch = ClientWatch(self._client_timeout, self.client_of(key))

        def report() -> None:
            self._publish_feedback(handle, ticket)
            if watch.gone(self._node.subscribers(self._feedback_topic)):
                seconds = self._client_timeout
                self._driver.abandon(ticket, f"the goal has had no client for {seconds:g} s")

        end_feedback = self._node.every(FEEDBACK_PERIOD, report)
        outcome: Outcome = await _awaitable(done)
        end_feedback()
        self._tickets.pop(key, None)
        self._canceled.discard(key)
        request.trajectory.points = []  # the action keeps the request as long as the result
        return self._result(handle, outcome)

    def cancel(self, handle: Any) -> None:
        """Stop a goal along its path."""
        key = bytes(handle.goal_id.uuid)
        self._canceled.add(key)
        ticket = self._tickets.get(key)
        if ticket is not None:
            self._driver.cancel(ticket)

    def _result(self, handle: Any, outcome: Outcome) -> Any:
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


def _awaitable(future: Any) -> Awaitable[Outcome]:
    awaitable: Awaitable[Outcome] = future
    return awaitable
