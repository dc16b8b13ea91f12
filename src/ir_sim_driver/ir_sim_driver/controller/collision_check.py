"""Would this movement touch anything? Proved for every instant before it starts, not looked at in samples."""

from __future__ import annotations

import time

import numpy as np

from ir_kernels.collision import COLLIDES, FREE
from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.controller.contact_scene import ContactScene
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion import ErrorCode, Path

CHECK_TIME = 20.0  # s of processor time: 20 000 points take some 0.02 s
_PIECES = 200  # segments that are proved together


def check_collision(
    path: Path, segments: slice, offset: float, scene: ContactScene, threshold: FloatArray
) -> None:
    """Prove that every pair keeps its distance (Z,) along some segments of a path; offset [s]: of its
    trajectory's time 0. Raises TrajectoryRefusedError.
    """
    coefficients, durations = path.coefficients[segments], path.durations[segments]
    begin = float(np.sum(path.durations[: segments.start or 0]))
    started = time.thread_time()
    if len(durations) == 0:
        _check_point(path.start, scene, threshold)
    for first in range(0, len(durations), _PIECES):
        piece = slice(first, first + _PIECES)
        found = scene.model.certify_trajectory(coefficients[piece], durations[piece], threshold)
        if found.verdict != FREE:
            at = begin + found.interval[1]
            raise _refused(path.position(at), at - offset, found.verdict, found.pair, scene)
        if time.thread_time() - started > CHECK_TIME:
            raise TrajectoryRefusedError(
                ErrorCode.INVALID_GOAL,
                f"the trajectory could not be proved free of collisions within {CHECK_TIME:g} s of processor "
                f"time: it was up to {begin + float(durations[piece].sum()) - offset:.3f} s",
            )
        begin += float(durations[piece].sum())


def _check_point(q: FloatArray, scene: ContactScene, threshold: FloatArray) -> None:
    near = scene.model.min_distance(q[None], threshold)
    z = int(near.pair[0])
    if z >= 0 and near.distance[0] <= threshold[z]:
        raise _refused(q, 0.0, COLLIDES, z, scene)


def _refused(q: FloatArray, at: float, verdict: int, z: int, scene: ContactScene) -> TrajectoryRefusedError:
    kind, body_a, body_b = scene.model.pairs[z]
    distance = float(scene.model.witnesses(q[None], [z]).distance[0])
    does = "collides" if verdict == COLLIDES else "can't be proved free of collisions"
    return TrajectoryRefusedError(
        ErrorCode.INVALID_GOAL,
        f"the trajectory {does}: {body_a} and {body_b} ({kind.lower()}) come to {distance * 1e3:.1f} mm at "
        f"{at:.3f} s; plan it again, or allow_collision",
    )
