"""Goals of an action are executed one after the other: those that wait take no thread from anybody
else.
"""

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.action import CancelResponse
from rclpy.action.server import ServerGoalHandle

Execute = Callable[[ServerGoalHandle], Any]


class GoalQueue:
    """`accepted` and `cancel` are callbacks of an action server, `execute` what it calls for a
    goal.

    most: goals that may wait; one beyond is answered by `refuse`.
    """

    def __init__(self, execute: Execute, refuse: Execute, most: int) -> None:
        self._execute = execute
        self._refuse = refuse
        self._most = most
        self._lock = threading.Lock()
        self._running: ServerGoalHandle | None = None
        self._waiting: deque[ServerGoalHandle] = deque()

    def accepted(self, goal: ServerGoalHandle) -> None:
        """Start the goal, or let it wait."""
        with self._lock:
            full = self._running is not None and len(self._waiting) >= self._most
            if self._running is not None and not full:
                self._waiting.append(goal)
                return
            if not full:
                self._running = goal
        goal.execute(self._refuse if full else self.execute)

    def execute(self, goal: ServerGoalHandle) -> Any:
        """Execute a goal, then start the next."""
        try:
            return self._execute(goal)
        finally:
            self._start_next(goal)

    def cancel(self, goal: ServerGoalHandle) -> CancelResponse:
        """Every goal may be cancelled; one that waits is executed at once, to end as cancelled."""
        with self._lock:
            waits = goal in self._waiting
            if waits:
                self._waiting.remove(goal)
        if waits:
            goal.execute(self._execute)
        return CancelResponse.ACCEPT

    def _start_next(self, done: ServerGoalHandle) -> None:
        with self._lock:
            if self._running is not done:
                return
            self._running = self._waiting.popleft() if self._waiting else None
            following = self._running
        if following is not None:
            following.execute(self.execute)
