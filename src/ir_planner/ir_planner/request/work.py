"""How much work a request may cost: counted in certified edges, with time only as a ceiling, and
how to stop it.

Counting work keeps answers reproducible; a clock that cuts an answer short makes it say
`truncated`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from ir_planner.errors import CancelledError

Clock = Callable[[], float]


@dataclass
class Work:
    """Work left for one request.

    `max_iterations`: edges that searches may certify; the evaluations of a descent count as edges
    too. `deadline` [s] on `clock`. `cancelled` is asked at every step. `improvement`: how much of
    the work may go into better answers once there is one. `threads`: that may share it, 0: one per
    core; no answer depends on it.
    """

    max_iterations: int
    deadline: float
    clock: Clock
    cancelled: Callable[[], bool] = lambda: False
    improvement: int = 2_500
    threads: int = 0
    iterations: int = field(default=0, init=False)
    truncated: bool = field(default=False, init=False)

    def spend(self, edges: int) -> None:
        """Count work. Raises CancelledError when the caller asked to stop."""
        self.iterations += edges
        self.check()

    def check(self) -> None:
        """Raise CancelledError when the caller asked to stop."""
        if self.cancelled():
            raise CancelledError("stopped on request")

    @property
    def left(self) -> int:
        """Edges that may still be certified."""
        return max(self.max_iterations - self.iterations, 0)

    @property
    def exhausted(self) -> bool:
        """Whether searches must end: by work, or cut by time (then `truncated`)."""
        if self.clock() >= self.deadline:
            self.truncated = True
        return self.truncated or self.iterations >= self.max_iterations
