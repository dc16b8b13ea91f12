"""What a genetic correction did, as it travels with an answer."""

import numpy as np

from ir_kernels.collision import FREE
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.search_log import CorrectionLog
from ir_planner.checks import FreeSpace, first_too_near
from ir_planner.scene import PlanningScene, path_cost
from ir_planner.search.correction import Correction

_SAMPLES = 25  # positions of the tool along a straight step
_SPACING = 0.01  # rad between configurations of the straight movement that are asked
_MOST = 24  # stretches whose fitness is kept: more than a picture shows


def correction_log(
    correction: Correction, path: FloatArray, start: FloatArray, space: FreeSpace
) -> CorrectionLog:
    """The correction of the straight movement from start (n,), which became `path` (M, n); without
    the names of its ends. It is no work: what it asks is not counted.
    """
    scene = space.scene
    straight = np.stack([start, path[-1]])
    parts = _colliding_parts(straight, space)
    return CorrectionLog(
        start="",
        goal="",
        generations=correction.generations,
        fitness=tuple(stretch.fitness for stretch in correction.stretches[:_MOST]),
        costs=(float(path_cost(scene.weights, straight)), float(path_cost(scene.weights, path))),
        straight=_tool_along(straight, scene),
        stretches=tuple(_tool_along(part, scene) for part in parts),
        path=_tool_along(path, scene),
        met=first_too_near(straight, space) if parts else "",
    )


def _colliding_parts(straight: FloatArray, space: FreeSpace) -> list[FloatArray]:
    """Ends (2, n) of the parts of a straight movement (2, n) on which something is nearer than it
    may be, or of those that can't be proved free.
    """
    begin = straight[0]
    step = straight[1] - straight[0]
    count = max(int(np.ceil(np.abs(step).max() / _SPACING)), 1)
    share = np.linspace(0.0, 1.0, count + 1)
    blocked = ~space.states_free(begin + share[:, None] * step)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], blocked, [False]]).astype(np.int8)))
    shares = [
        (share[first], share[last - 1]) for first, last in zip(edges[::2], edges[1::2], strict=True)
    ]
    if not shares:
        proof = space.scene.collision.certify_edges(straight[:1], straight[1:], space.threshold)
        shares = [(float(proof.t0[0]), float(proof.t1[0]))] if proof.verdict[0] != FREE else []
    return [begin + np.array(ends)[:, None] * step for ends in shares]


def _tool_along(path: FloatArray, scene: PlanningScene) -> FloatArray:
    """Positions (K, 3) of the tcp along a path (M, n), M >= 2, of straight joint steps."""
    share = np.linspace(0.0, 1.0, _SAMPLES)[:, None, None]
    q = (path[:-1] + share * np.diff(path, axis=0)).transpose(1, 0, 2).reshape(-1, path.shape[1])
    return scene.chain.tcp_poses(np.ascontiguousarray(q))[:, :3, 3]
