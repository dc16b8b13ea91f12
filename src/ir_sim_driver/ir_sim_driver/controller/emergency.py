"""The emergency stop: brakes with all they have, off the path if need be, and how far off it was.

Nobody follows the command any more; afterwards it is where the robot stands, so nothing can jump or resume.
"""

from __future__ import annotations

import numpy as np

from ir_sim_driver.controller.excursion import Excursion
from ir_sim_driver.motion import Executor, ToolPoint
from ir_sim_driver.notices import Level, Notices
from ir_sim_driver.plant import Backend

_STANDS = 1e-9  # rad/s; the brakes bring the speed to zero within a step


class EmergencyStop:
    """Stops `backend` and drops what `executor` does. excursion [m]: how far the last stop left its path."""

    def __init__(self, backend: Backend, executor: Executor, tool: ToolPoint, notices: Notices) -> None:
        self._backend, self._executor, self._tool, self._notices = backend, executor, tool, notices
        self._running: Excursion | None = None
        self.excursion = 0.0

    def start(self, sentence: str, standing: bool) -> None:
        """Close the brakes; the goal that runs ends with this sentence."""
        executor, q = self._executor, self._backend.q
        self._running = None if standing else Excursion(self._tool, executor.path, executor.path_parameter, q)
        executor.drop(sentence)
        if standing:
            executor.hold(q)

    def step(self) -> None:
        """Make a step of dt with the brakes."""
        backend = self._backend
        if not backend.qd.any():
            backend.rest()
            return
        backend.brake()
        if self._running is not None:
            self._running.add(backend.q)
        if np.abs(backend.qd).max() < _STANDS:
            self._stopped()

    def _stopped(self) -> None:
        self._backend.reset(self._backend.q)
        self._executor.hold(self._backend.q)
        if self._running is not None:
            self.excursion = self._running.distance()
            self._running = None
            off = f"the tool left its path by {self.excursion * 1e3:.1f} mm"
            self._notices.add(Level.WARN, f"emergency stop: {off}; recover to go on")
