"""Moves that follow each other without a stop: the next begins while the last one brakes.

As `timing.blending` does for straight steps: q(t) is the sum of what the moves have covered, so
that the arm cuts the corner. Moves that are blended have half the jerk each, so that both together
keep the limit.
How early the next may begin follows from the approximation distance: what is left of the one and
what the other has covered stay within it, and within half of each move.
"""

import itertools
from collections.abc import Sequence

import numpy as np

from ir_krl import Blend
from ir_msgs_py.arrays import FloatArray, IntArray
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.krl.moves import TORQUE, Move
from ir_planner.scene import PlanningScene, torque_use
from ir_planner.timing import GRID_NS

_HALF = 0.5
_TRIALS = 12
_SAMPLES_PER_S = 500
_ROUNDING = 1.0 + 1e-9


def overlap(before: Move, after: Move, blend: Blend, scene: PlanningScene) -> int:
    """Grid steps that `after` may begin before `before` has ended; 0: it stops at the corner."""
    left = np.arange(before.law.ramp_down + 1)
    covered = 1.0 - before.law.at(before.law.total - left)[0]
    begun = np.arange(after.law.ramp_up + 1)
    reached = after.law.at(begun)[0]
    steps = min(
        int(np.searchsorted(covered, _share(before, blend), side="right")) - 1,
        int(np.searchsorted(reached, _share(after, blend), side="right")) - 1,
    )
    names = scene.cell.robot.joint_names
    for _ in range(_TRIALS):
        if steps <= 0:
            return 0
        if _within(trajectory([before, after], [steps], names), scene):
            return steps
        steps = steps * 3 // 4
    return 0


def _share(move: Move, blend: Blend) -> float:
    """Of a move's s, that may lie in the blend."""
    by_distance = blend.distance / move.curve.length if move.curve.length > 0.0 else 1.0
    return _HALF * blend.share if blend.distance <= 0.0 else min(by_distance, _HALF)


def _within(corner: JointTrajectory, scene: PlanningScene) -> bool:
    """Whether two moves that overlap keep the limits and the torque."""
    limits = scene.limits
    motion = corner.sample(
        np.linspace(0.0, corner.duration, max(round(corner.duration * _SAMPLES_PER_S), 2))
    )
    return bool(
        (np.abs(motion.qd) <= limits.velocity).all()
        and (np.abs(motion.qdd) <= limits.acceleration).all()
        and (np.abs(motion.qddd) <= limits.jerk * _ROUNDING).all()
        and (torque_use(scene.dynamics, motion.q, motion.qd, motion.qdd) <= TORQUE).all()
    )


def joined(
    moves: Sequence[Move], overlaps: Sequence[int]
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Grid steps (M,), and q, qd, qdd (M, n) there, of moves of which each overlaps the one
    before.
    """
    lasting = [move.law.total for move in moves]
    begins = [0, *itertools.accumulate(a - b for a, b in zip(lasting[:-1], overlaps, strict=True))]
    knots = np.unique(
        np.concatenate([move.switches() + at for move, at in zip(moves, begins, strict=True)])
    )
    total = [
        np.zeros((len(knots), len(moves[0].at(np.zeros(1, np.int64))[0][0]))) for _ in range(3)
    ]
    for k, (move, at) in enumerate(zip(moves, begins, strict=True)):
        q, qd, qdd = move.at(knots - at)
        start = q[0] if k == 0 else move.at(np.zeros(1, np.int64))[0][0]
        for held, part in zip(total, (q - start if k else q, qd, qdd), strict=True):
            held += part
    q, qd, qdd = total
    qd[[0, -1]] = qdd[[0, -1]] = 0.0
    return knots, q, qd, qdd


def trajectory(
    moves: Sequence[Move], overlaps: Sequence[int], names: tuple[str, ...]
) -> JointTrajectory:
    """The trajectory of moves that are driven through, at rest at both ends."""
    knots, q, qd, qdd = joined(moves, overlaps)
    return JointTrajectory(names, knots * GRID_NS, q, qd, qdd)
