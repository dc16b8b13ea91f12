"""The emergency stop: brakes with all they have, off the path if need be, and how far off it was.

Nobody follows the command any more; afterwards it is where the robot stands, so nothing can jump or resume.
"""

from __future__ import annotations

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.motion.executor import Executor
from ir_sim_driver.motion.path import Path
from ir_sim_driver.motion.tool_point import ToolPoint
from ir_sim_driver.notices import Level, Notices
from ir_sim_driver.plant.backend import Backend

_AHEAD = 2.0  # s of path that a stop can cover at most
_SAMPLES = 400
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


class Excursion:
    """Collects configurations while the robot stops; `distance` is the farthest the tool was from the path
    ahead.
    """

    def __init__(self, tool: ToolPoint, path: Path | None, s: float, q: FloatArray) -> None:
        self._tool = tool
        instants = np.linspace(s, s + _AHEAD, _SAMPLES) if path is not None else np.empty(0)
        points = [path.position(float(t)) for t in instants] if path is not None else [q]
        self._path = tool.positions(np.array(points))
        self._visited = [q]

    def add(self, q: FloatArray) -> None:
        """Count a configuration (n,)."""
        self._visited.append(q)

    def distance(self) -> float:
        """Largest distance [m] of the visited tool points from the path, which is taken as a polyline."""
        points = self._tool.positions(np.array(self._visited))
        start, step = self._path[:-1], np.diff(self._path, axis=0)
        if len(start) == 0:
            return float(np.linalg.norm(points - self._path[0], axis=1).max())
        length = np.maximum((step**2).sum(axis=1), 1e-18)
        along = np.clip(((points[:, None] - start) * step).sum(axis=2) / length, 0.0, 1.0)
        nearest = start + along[:, :, None] * step
        return float(np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1).max())
