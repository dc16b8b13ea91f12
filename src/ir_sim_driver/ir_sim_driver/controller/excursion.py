"""How far the tool leaves its path while the brakes stop the robot."""

from __future__ import annotations

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.motion import Path, ToolPoint

_AHEAD = 2.0  # s of path that a stop can cover at most
_SAMPLES = (
    400  # one every 5 ms: a chord of them leaves the path by less than 0.1 mm at working speed
)


class Excursion:
    """Collects configurations (n,) while the robot stops; `distance` is the farthest the tool was
    from the path ahead.
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
        """Largest distance [m] of the visited tool points from the path, which is taken as a
        polyline.
        """
        points = self._tool.positions(np.array(self._visited))
        start = self._path[:-1]
        step = np.diff(self._path, axis=0)
        if len(start) == 0:
            return float(np.linalg.norm(points - self._path[0], axis=1).max())
        length = np.maximum((step**2).sum(axis=1), 1e-18)
        along = np.clip(((points[:, None] - start) * step).sum(axis=2) / length, 0.0, 1.0)
        nearest = start + along[:, :, None] * step
        return float(np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1).max())
