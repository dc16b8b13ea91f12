"""Where a running program is, and how long it still takes by plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ir_msgs_py.report import PlannedMovement


@dataclass
class Progress:
    """State of one run; times of a steady clock [s]."""

    program_id: str
    movements: Sequence[PlannedMovement]
    started: float
    index: int = 0
    phase: str = ""
    step_started: float | None = None

    @property
    def total(self) -> int:
        """Number of steps."""
        return len(self.movements)

    def begin(self, index: int) -> None:
        """Step `index` is the next one; it may still wait for its signals."""
        self.index = index
        self.step_started = None

    def remaining(self, now: float) -> float:
        """Planned seconds until the program ends; a step that takes longer counts as nothing
        more.
        """
        elapsed = 0.0 if self.step_started is None else now - self.step_started
        step = max(0.0, self.movements[self.index].duration - elapsed)
        return step + sum(movement.duration for movement in self.movements[self.index + 1 :])
