"""Services that answer every request: what comes while too many wait is refused, nothing is
dropped.

The middleware keeps only so many requests and drops the oldest without a word. Here each turn of
the executor takes all that have come into a queue of its own, refuses what exceeds it with a
sentence, and answers one. What was answered is published for recordings (calls.py).
"""

from __future__ import annotations

import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rclpy.action import ActionServer
from rclpy.callback_groups import CallbackGroup
from rclpy.executors import await_or_execute
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.waitable import NumberOfEntities, Waitable

from ir_msgs_py.ros.calls import Calls, type_text
from ir_msgs_py.ros.conversions import status_to_msg
from ir_msgs_py.ros.polled import PolledGroup
from ir_msgs_py.ros.quality import REQUESTS_WAITING, SERVICE
from ir_msgs_py.ros.refusals import ANY, unexpected
from ir_msgs_py.status import Status, StatusCode

Handler = Callable[[Any, Any], Any]

UNDISCOVERED = 0.09
"""Seconds that the middleware waits, less a tenth, for a client that it has not discovered (0.1
s).
"""

SENDS = 10
"""A second: more than a busy machine takes to discover a client, and no longer than a dead one may
hold up the others.
"""


class BoundedService(Waitable):
    """A service of `node` whose responses have a `status`; at most `waiting` requests wait in it.

    handler: from request and response to the response; requests are answered in the order in which
    they came. What it raises, and a response that can't be sent, is answered as a failure and
    logged.
    """

    def __init__(
        self,
        node: Node,
        service_type: Any,
        name: str,
        handler: Handler,
        group: CallbackGroup | None = None,
        waiting: int = REQUESTS_WAITING,
    ) -> None:
        super().__init__(group or node.default_callback_group)
        self._type = service_type
        self._handler = handler
        self._most = waiting
        self._source = node.get_name()
        self._log = node.get_logger().error
        untouched = PolledGroup()  # the executor does not take from the service, this does
        self._service = node.create_service(
            service_type, name, handler, qos_profile=SERVICE, callback_group=untouched
        )
        self._calls = Calls.of(node)
        self._more = node.create_guard_condition(_nothing, callback_group=untouched)
        self._sender = PatientSender(self._service.send_response)
        self._waiting: deque[tuple[Any, Any]] = deque()
        self._index = 0
        node.add_waitable(self)

    def __enter__(self) -> None:
        self._service.handle.__enter__()
        self._more.handle.__enter__()

    def __exit__(self, *exception: object) -> None:
        self._more.handle.__exit__(*exception)
        self._service.handle.__exit__(*exception)

    def get_num_entities(self) -> NumberOfEntities:
        """A service, and what ends the wait while requests are in the queue."""
        return NumberOfEntities(num_services=1, num_gcs=1)

    def add_to_wait_set(self, wait_set: Any) -> None:
        """Wait for a request."""
        self._index = wait_set.add_service(self._service.handle)
        wait_set.add_guard_condition(self._more.handle)
        if self._waiting:
            self._more.trigger()

    def is_ready(self, wait_set: Any) -> bool:
        """Whether a request has come or waits."""
        return bool(self._waiting) or bool(wait_set.is_ready("service", self._index))

    def take_data(self) -> tuple[Any, Any] | None:
        """Take all that have come; the one to be answered now."""
        while True:
            with self._service.handle:
                taken = self._service.handle.service_take_request(self._type.Request)
            if taken is None or taken[1] is None:
                return self._waiting.popleft() if self._waiting else None
            if len(self._waiting) < self._most:
                self._waiting.append(taken)
            else:
                self._refuse(taken[1])

    async def execute(self, taken_data: tuple[Any, Any] | None) -> None:
        """Answer it."""
        if taken_data is None:
            return
        request, header = taken_data
        try:
            answered = self._calls.taken(self._service.service_name, type_text(self._type), request)
            response = self._handler(request, self._type.Response())
            answered(response)
            self._sender.send(response, header)
        except ANY as error:
            self._log(traceback.format_exc())
            self._say(unexpected(error), header)

    def _refuse(self, header: Any) -> None:
        sentence = (
            f"{self._most} requests of {self._service.service_name} are waiting: send fewer at once"
        )
        self._say(Status(StatusCode.FAILURE, sentence), header)

    def _say(self, status: Status, header: Any) -> None:
        response = self._type.Response()
        response.status = status_to_msg(Status(status.code, status.message, self._source))
        self._sender.send(response, header)


class _PatientHandle(_rclpy.ActionServer):
    """rclpy's handle of an action server, whose responses reach a client that is discovered late.

    A goal whose client does not hear that it was accepted would not even be executed.
    """

    def send_goal_response(self, header: Any, response: Any) -> None:
        """That a goal is taken or not."""
        self._patiently(super().send_goal_response, header, response)

    def send_cancel_response(self, header: Any, response: Any) -> None:
        """Which goals will end."""
        self._patiently(super().send_cancel_response, header, response)

    def send_result_response(self, header: Any, response: Any) -> None:
        """What became of a goal."""
        self._patiently(super().send_result_response, header, response)

    def _patiently(self, send: Callable[[Any, Any], None], header: Any, response: Any) -> None:
        failures: list[Exception] = []

        def attempt(response: Any, header: Any) -> None:
            failures.clear()
            try:
                send(header, response)
            except _rclpy.RCLError as error:
                failures.append(error)

        if not hasattr(self, "_sender"):
            self._sender = PatientSender(lambda response, attempt: attempt(response))
        self._sender.send(response, lambda response: attempt(response, header))
        if failures:
            raise failures[0]


_MAKING = threading.Lock()


class RecordedActionServer(ActionServer):
    """An ActionServer whose goals and results are published for recordings."""

    def __init__(
        self, node: Node, action_type: Any, name: str, *arguments: Any, **options: Any
    ) -> None:
        self._calls = Calls.of(node)
        self._type_text = type_text(action_type)
        self._full_name = node.resolve_topic_name(name)
        with _MAKING, _made_of(_PatientHandle):
            super().__init__(node, action_type, name, *arguments, **options)

    async def _execute_goal(self, execute_callback: Any, goal_handle: Any) -> None:
        async def execute(goal: Any) -> Any:
            answered = self._calls.taken(self._full_name, self._type_text, goal.request)
            result = await await_or_execute(execute_callback, goal)
            answered(result)
            goal._goal_request = type(goal.request)()  # rclpy keeps the goal as long as its result
            return result

        await super()._execute_goal(execute, goal_handle)


class PatientSender:
    """Sends a response again where the server has not discovered its client yet.

    A client may see the server before the server sees it. The middleware then waits UNDISCOVERED,
    drops the response and warns; only the time it took shows it. A client ignores an answer that it
    has already. One
    that is never discovered has died: what follows is sent once, until a client takes its answer at
    once.
    """

    def __init__(
        self, send: Callable[[Any, Any], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._send = send
        self._clock = clock
        self._patient = True

    def send(self, response: Any, header: Any) -> None:
        """Send it, for about a second at most."""
        for _ in range(SENDS if self._patient else 1):
            begun = self._clock()
            self._send(response, header)
            if self._clock() - begun < UNDISCOVERED:
                self._patient = True
                return
        self._patient = False


@contextmanager
def _made_of(handle: type) -> Iterator[None]:
    """rclpy makes its action servers of this class meanwhile."""
    plain = _rclpy.ActionServer
    _rclpy.ActionServer = handle
    try:
        yield
    finally:
        _rclpy.ActionServer = plain


def _nothing() -> None:
    """What the guard's callback does: ending the wait is all."""
