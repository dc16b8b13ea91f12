"""Closed-form inverse kinematics of 6R arms whose axes 2, 3 and 4 are parallel (UR and its kind).

q1 and q5 first (shoulder_wrist), then q6 from where z2 points in the hand, the sum of q2, q3 and q4
from the hand's rotation, and q2, q3 as a planar arm of two links.

Branch numbers 0..7: +4 for the second shoulder, +2 for the other elbow, +1 for the other wrist.
"""

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import data, portable
from ir_kernels.arguments import shaped
from ir_kernels.arm_lines import ArmLines, arm_lines
from ir_kernels.chain import Chain
from ir_kernels.errors import InputError
from ir_kernels.ik_set import Found, IkSet, limits, with_turns
from ir_kernels.polish import polished
from ir_kernels.shoulder_wrist import shoulder_and_wrist
from ir_values.arrays import BoolArray, FloatArray, IntArray

STRETCHED = 1e-9  # m: how far out of reach still counts as stretched
FREE = np.linspace(-np.pi, np.pi, 25)  # rad: of a free q6, the nearest to 0 first
SINGULAR = (
    1e-7  # sine between axis 6 and z2 below which only the sum of the wrist's angles is determined
)


class ThreeParallelIk:
    """All configurations within position_min, position_max (6,) rad that bring `chain`'s tcp to a
    pose.

    Where axis 6 is parallel to axes 2 to 4 one parameter is free: the representative with q6 = 0
    (or the limit nearest to 0) is given, or where the arm does not reach so the next in steps of 15
    deg. Raises InputError where axes 2, 3 and 4 are not parallel (1e-9).
    """

    def __init__(self, chain: Chain, position_min: ArrayLike, position_max: ArrayLike) -> None:
        self.chain = chain
        self.lines = arm_lines(chain)
        if not self.lines.parallel(3):
            raise InputError("axes 2, 3 and 4 are not parallel")
        self.position_min, self.position_max = limits(position_min, position_max)

    def solve(self, poses: ArrayLike) -> IkSet:
        """All solutions for poses (N, 4, 4) of the tcp in the world; tcp(q) meets the pose to 1e-9
        m and 1e-9 rad.
        """
        targets = shaped("poses", poses, None, 4, 4)
        data.poses(targets, "poses")
        X = displacements(self.chain, self.lines, targets)
        still = np.broadcast_to(np.eye(4), X.shape)
        q1, q5, exists, _ = shoulder_and_wrist(self.lines, X, still)
        pair, rows = np.nonzero(exists.T)
        found = self._elbows(
            X[rows], rows, q1[rows, pair], q5[rows, pair], 4 * (pair // 2) + pair % 2
        )
        return with_turns(
            polished(self.chain, targets, found), self.position_min, self.position_max
        )

    def _elbows(
        self, X: FloatArray, rows: IntArray, q1: FloatArray, q5: FloatArray, branch: IntArray
    ) -> list[Found]:
        """Both elbows of q1, q5 (M,) with branch numbers (M,), for displacements (M, 4, 4) that
        belong to the poses `rows` (M,).
        """
        found: list[Found] = []
        still = np.broadcast_to(np.eye(4), X.shape)
        open_ = np.ones(len(rows), dtype=bool)
        low = self.position_min[5]
        high = self.position_max[5]
        for free in sorted(np.clip(FREE, low, high), key=abs):
            q6, total, singular = wrist_and_sum(self.lines, X, still, q1, q5, float(free))
            done = np.zeros(len(rows), dtype=bool)
            for elbow in (0, 1):
                q, reached = self._planar(X, q1, q5, q6, total, bool(elbow))
                found += [
                    (int(rows[k]), int(branch[k]) + 2 * elbow, q[k])
                    for k in np.flatnonzero(reached & open_)
                ]
                done |= reached
            open_ &= singular & ~done  # a free angle: the next one may be in reach
            if not open_.any():
                break
        return found

    def _planar(
        self,
        X: FloatArray,
        q1: FloatArray,
        q5: FloatArray,
        q6: FloatArray,
        total: FloatArray,
        other: bool,
    ) -> tuple[FloatArray, BoolArray]:
        """q (N, 6) of one elbow, and whether it is in reach; where the arm is stretched both are
        the same.
        """
        lines = self.lines
        z = lines.z
        o = lines.o
        turned = lines.turned
        back = portable.matmul(turned(0, -q1), X, turned(5, -q6), turned(4, -q5))  # = E2 E3 E4
        target = portable.matmul(back[:, :3, :3], o[3]) + back[:, :3, 3] - o[1]
        normal = _normal(z[1])
        across = np.cross(z[1], normal)

        def planar(vector: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            x = portable.matmul(vector, normal)
            y = portable.matmul(vector, across)
            return x, y, portable.hypot(x, y)

        upper_x, upper_y, a = planar(o[2] - o[1])
        fore_x, fore_y, b = planar(o[3] - o[2])
        aim_x, aim_y, distance = planar(target)
        cosine = (distance * distance - a * a - b * b) / (2.0 * a * b)
        bend = portable.arccos(np.clip(cosine, -1.0, 1.0)) * (-1.0 if other else 1.0)
        opening = (upper_x * fore_y - upper_y * fore_x, upper_x * fore_x + upper_y * fore_y)
        turn = bend - portable.arctan2(*opening)
        cos = portable.cos(turn)
        sin = portable.sin(turn)
        arm_x = upper_x + fore_x * cos - fore_y * sin
        arm_y = upper_y + fore_x * sin + fore_y * cos
        q2 = portable.arctan2(aim_y * arm_x - aim_x * arm_y, aim_x * arm_x + aim_y * arm_y)
        reached = (distance <= a + b + STRETCHED) & (distance >= abs(a - b) - STRETCHED)
        twice = other & (np.abs(cosine) >= 1.0)
        q4 = lines.parallel(3) * (total - q2 - turn)
        return np.stack([q1, q2, lines.parallel(2) * turn, q4, q5, q6], axis=1), reached & ~twice


def displacements(chain: Chain, lines: ArmLines, targets: FloatArray) -> FloatArray:
    """(N, 4, 4): how the hand is displaced from q = 0 in link 0, for poses of the tcp in the
    world.
    """
    hand = portable.matmul(portable.inv(chain.base_pose), targets, portable.inv(chain.tcp))
    return np.asarray(portable.matmul(hand, portable.inv(lines.hand)))


def wrist_and_sum(
    lines: ArmLines, X: FloatArray, E4: FloatArray, q1: FloatArray, q5: FloatArray, free: float
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """q6 (N,), the angle (N,) about z2 that is left for axes 2, 3 and those parallel to them, and
    where q6 is free and taken as `free`.
    """
    z = lines.z
    turned = lines.turned
    R1 = turned(0, q1)[:, :3, :3]
    R5 = turned(4, q5)[:, :3, :3]
    R4 = E4[:, :3, :3]
    R = X[:, :3, :3]
    before = portable.matmul(np.swapaxes(portable.matmul(R4, R5), 1, 2), z[1])  # = R6 (R^T R1 z2)
    after = portable.matmul(np.swapaxes(R, 1, 2), R1, z[1])
    singular = np.linalg.norm(np.cross(before, z[5]), axis=1) < SINGULAR
    q6 = np.where(singular, free, angle_about(z[5], after, before))
    left = portable.matmul(
        np.swapaxes(R1, 1, 2),
        R,
        np.swapaxes(portable.matmul(R4, R5, turned(5, q6)[:, :3, :3]), 1, 2),
    )
    normal = _normal(z[1])
    return (
        q6,
        angle_about(z[1], np.broadcast_to(normal, after.shape), portable.matmul(left, normal)),
        singular,
    )


def angle_about(axis: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Angles (N,) by which a turn about an axis (3,) brings vectors (N, 3) into the planes of
    others.
    """
    u = start - (portable.matmul(start, axis))[:, None] * axis
    v = end - (portable.matmul(end, axis))[:, None] * axis
    return np.asarray(portable.arctan2(portable.matmul(np.cross(u, v), axis), (u * v).sum(axis=1)))


def _normal(z: FloatArray) -> FloatArray:
    """A unit vector perpendicular to z (3,)."""
    helper = np.eye(3)[int(np.argmin(np.abs(z)))]
    across = np.cross(z, helper)
    return np.asarray(across / portable.norm(across))
