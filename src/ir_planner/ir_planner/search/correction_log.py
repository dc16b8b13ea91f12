"""What a genetic correction did, as it travels with an answer."""

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.search_log import CorrectionLog
from ir_planner.scene import PlanningScene, path_cost
from ir_planner.search.correction import Correction

_SAMPLES = 25  # positions of the tool along a straight step
_STRETCHES = 4  # that a picture shows


def correction_log(
    correction: Correction, path: FloatArray, start: FloatArray, scene: PlanningScene
) -> CorrectionLog:
    """The correction of the straight movement from start (n,), which became `path` (M, n); without the names
    of its ends.
    """
    straight = np.stack([start, path[-1]])
    return CorrectionLog(
        start="",
        goal="",
        generations=correction.generations,
        fitness=tuple(stretch.fitness for stretch in correction.stretches[:_STRETCHES]),
        costs=(float(path_cost(scene.weights, straight)), float(path_cost(scene.weights, path))),
        straight=_tool_along(straight, scene),
        stretches=tuple(
            _tool_along(np.stack([stretch.begin, stretch.end]), scene)
            for stretch in correction.stretches[:_STRETCHES]
        ),
        path=_tool_along(path, scene),
    )


def _tool_along(path: FloatArray, scene: PlanningScene) -> FloatArray:
    """Positions (K, 3) of the tcp along a path (M, n), M >= 2, of straight joint steps."""
    share = np.linspace(0.0, 1.0, _SAMPLES)[:, None, None]
    q = (path[:-1] + share * np.diff(path, axis=0)).transpose(1, 0, 2).reshape(-1, path.shape[1])
    return scene.chain.tcp_poses(np.ascontiguousarray(q))[:, :3, 3]
