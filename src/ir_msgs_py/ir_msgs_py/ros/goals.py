"""Goals sent from the spinning thread: an ActionClient races with its executor when used from
another one.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.task import Future

from ir_msgs_py.errors import CallTimedOutError, RequestRefusedError, ServiceUnavailableError
from ir_msgs_py.ros.background import BackgroundExecutor
from ir_msgs_py.ros.quality import ACTION_SERVICES
from ir_msgs_py.ros.types import owner_of
from ir_msgs_py.status import StatusCode

GONE = 10.0
"""s without anybody who offers an action before its goal is given up. The middleware forgets a
process that died, or was stopped, after 5 s.
"""


class GoalSender:
    """Sends goals of one node and waits for their results."""

    def __init__(self, node: Node, executor: BackgroundExecutor) -> None:
        self._node = node
        self._executor = executor
        self._clients: dict[tuple[str, Any], ActionClient] = {}

    def send(
        self,
        action: str,
        goal: Any,
        feedback: Callable[[Any], object] | None,
        response_timeout: float,
        result_timeout: float,
        cancel_grace: float,
    ) -> Any:
        """Send the goal and return its result; cancel it on timeout [s] and on an exception while
        waiting.
        """
        action_type = owner_of(goal, "Goal", "action")
        client = self._executor.run(lambda: self._client(action, action_type))
        if not self._executor.wait_until(client.server_is_ready, response_timeout):
            raise ServiceUnavailableError(
                f"no node offers the action {action} (waited {response_timeout:g} s)"
            )
        on_feedback = None if feedback is None else lambda message: feedback(message.feedback)
        sent: Future = self._executor.run(
            lambda: client.send_goal_async(goal, feedback_callback=on_feedback)
        )
        if not self._executor.wait(sent, response_timeout):
            raise CallTimedOutError(f"{action} did not take the goal within {response_timeout:g} s")
        handle = sent.result()
        if not handle.accepted:
            raise RequestRefusedError(f"{action} rejected the goal", int(StatusCode.FAILURE))
        result: Future = self._executor.run(handle.get_result_async)
        try:
            if self._ended(action, client, result, result_timeout):
                self._executor.run(
                    _nothing
                )  # feedback that came with the result is called back after it
                return result.result().result
        except ServiceUnavailableError:  # nobody is there to cancel it
            raise
        except BaseException:  # Ctrl-C in a script must not leave the robot moving
            self._cancel(handle, result, cancel_grace)
            raise
        ended = self._cancel(handle, result, cancel_grace)
        since = (
            "the goal was canceled"
            if ended
            else f"canceled, it has not ended within {cancel_grace:g} s"
        )
        raise CallTimedOutError(f"{action} had no result within {result_timeout:g} s: {since}")

    def destroy(self) -> None:
        """Let go of the action clients; call it on the spinning thread."""
        for client in self._clients.values():
            client.destroy()
        self._clients.clear()

    def _ended(self, action: str, client: ActionClient, result: Future, timeout: float) -> bool:
        """Whether the goal's result has come within `timeout` [s]; raises where its node has
        gone.
        """
        now = time.monotonic()
        deadline = now + timeout
        seen = now
        while not self._executor.wait(result, min(0.1 * GONE, deadline - now)):
            now = time.monotonic()
            if client.server_is_ready():
                seen = now
            elif now - seen >= GONE:
                raise ServiceUnavailableError(
                    f"the node that ran {action} has gone: no result will come"
                )
            if now >= deadline:
                return False
        return True

    def _cancel(self, handle: Any, result: Future, grace: float) -> bool:
        """Whether the goal has ended within `grace` [s]."""
        self._executor.run(handle.cancel_goal_async)
        return self._executor.wait(result, grace)

    def _client(self, action: str, action_type: Any) -> ActionClient:
        key = (action, action_type)
        if key not in self._clients:
            self._clients[key] = ActionClient(self._node, action_type, action, **ACTION_SERVICES)
        return self._clients[key]


def _nothing() -> None:
    """A turn of the spinning thread."""
