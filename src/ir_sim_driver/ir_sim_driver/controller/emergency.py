"""The emergency stop (STOP 0): motors off, then brakes with all they have, off the path if need be.

Between the two lies the brakes' reaction time, in which the arm rolls on and sags. Nobody follows
the command any more; afterwards it is where the robot stands, so nothing can jump or resume.
"""

from __future__ import annotations

import numpy as np

from ir_sim_driver.controller.excursion import Excursion
from ir_sim_driver.motion import Executor, ToolPoint
from ir_sim_driver.notices import Level, Notices
from ir_sim_driver.plant import Backend

_STANDS = 1e-9  # rad/s; the brakes bring the speed to zero within a step


class EmergencyStop:
    """Stops `backend` and drops what `executor` does; reaction: steps until the brakes act.

    excursion [m]: how far the tool left its path, or its place, in the last stop.
    """

    def __init__(
        self, backend: Backend, executor: Executor, tool: ToolPoint, notices: Notices, reaction: int
    ) -> None:
        self._backend = backend
        self._executor = executor
        self._tool = tool
        self._notices = notices
        self._reaction = reaction
        self._open = 0
        self._powered = False
        self._running: Excursion | None = None
        self.excursion = 0.0

    @property
    def stopping(self) -> bool:
        """Whether the robot still rolls on or slows down."""
        return self._running is not None

    def start(self, sentence: str, braked: bool, powered: bool = False) -> None:
        """Stop; the goal ends with this sentence. braked: the brakes are closed; powered: the
        motors stop the robot until the brakes act, else they are off.
        """
        executor = self._executor
        q = self._backend.q
        self._running = (
            None if braked else Excursion(self._tool, executor.path, executor.path_parameter, q)
        )
        self._open = 0 if braked else self._reaction
        self._powered = powered
        executor.drop(sentence)
        executor.hold(q)

    def step(self) -> None:
        """Make a step of dt: coast, or halt, while the brakes react; brake, then rest."""
        backend = self._backend
        if self._open > 0:
            self._open -= 1
            if self._powered:
                backend.halt()
            else:
                backend.coast()
            self._visit()
        elif backend.qd.any():
            backend.brake()
            self._visit()
            if np.abs(backend.qd).max() < _STANDS:
                self._stopped()
        else:
            backend.rest()
            if self._running is not None:
                self._stopped()

    def _visit(self) -> None:
        if self._running is not None:
            self._running.add(self._backend.q)

    def _stopped(self) -> None:
        self._backend.reset(self._backend.q)
        self._executor.hold(self._backend.q)
        if self._running is not None:
            self.excursion = self._running.distance()
            self._running = None
            off = f"the tool left its path by {self.excursion * 1e3:.1f} mm"
            self._notices.add(Level.WARN, f"emergency stop: {off}; recover to go on")
