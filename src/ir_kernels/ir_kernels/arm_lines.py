"""A 6R arm as the lines of its axes at q = 0, for arms whose axes 2 and 3 are parallel.

Turns about axes 2 and 3 leave the coordinate of every point along z2 as it is. That coordinate, of
one point and of one direction of the hand, gives two equations in which q2 and q3 do not occur;
`shoulder_wrist` solves them.
"""

from dataclasses import dataclass

import numpy as np

from ir_kernels import portable
from ir_kernels.chain import Chain
from ir_kernels.errors import InputError
from ir_kernels.reference.chain import axis_rotation
from ir_values.arrays import FloatArray

MEETING = 1e-9  # m: axes 5 and 6 that come so near meet
PARALLEL = 1e-9  # of |z2 x z3|


@dataclass(frozen=True)
class ArmLines:
    """z (6, 3): directions; o (6, 3): a point of each, those of axes 5 and 6 the nearest to each
    other; in the frame of link 0 at q = 0. hand (4, 4): pose of link 6 there. meet: whether axes 5
    and 6 meet.
    """

    z: FloatArray
    o: FloatArray
    hand: FloatArray
    meet: bool

    def turned(self, axis: int, angle: FloatArray) -> FloatArray:
        """(N, 4, 4): the turn of space by angles (N,) about an axis (from 0)."""
        result = np.zeros((len(angle), 4, 4))
        result[:, :3, :3] = axis_rotation(self.z[axis], angle)
        result[:, :3, 3] = self.o[axis] - portable.matmul(result[:, :3, :3], self.o[axis])
        result[:, 3, 3] = 1.0
        return result

    def parallel(self, axis: int) -> float:
        """+1 or -1 where an axis (from 0) is parallel to axis 2, by its sense; 0: it is not."""
        if float(portable.norm(np.cross(self.z[1], self.z[axis]))) > PARALLEL:
            return 0.0
        return float(np.sign(portable.matmul(self.z[1], self.z[axis])))


def arm_lines(chain: Chain) -> ArmLines:
    """The lines of a chain. InputError names what no method here solves."""
    if chain.n != 6:
        raise InputError(f"the arm has {chain.n} axes: inverse kinematics needs 6")
    frames = (
        portable.matmul(portable.inv(chain.base_pose), chain.link_poses(np.zeros((1, 6)))[0])
    )[1:]
    z = np.einsum("kij,kj->ki", frames[:, :3, :3], chain.joint_axis)
    o = frames[:, :3, 3].copy()
    o[4], o[5] = _feet(o[4], z[4], o[5], z[5])
    lines = ArmLines(z, o, frames[5], bool(portable.norm(o[5] - o[4]) < MEETING))
    if not lines.parallel(2):
        sine = float(portable.norm(np.cross(z[1], z[2])))
        raise InputError(
            f"axes 2 and 3 are not parallel (|z2 x z3| = {sine:.3g}, at most {PARALLEL:g}): "
            "no inverse kinematics for such an arm"
        )
    if float(portable.norm(np.cross(z[4], z[5]))) < PARALLEL:
        raise InputError("axes 5 and 6 are parallel: no inverse kinematics for such an arm")
    return lines


def _feet(
    a: FloatArray, u: FloatArray, b: FloatArray, v: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Nearest points of the lines a + s u and b + t v; a and b where these are parallel."""
    normal = np.cross(u, v)
    square = float(portable.matmul(normal, normal))
    if square < PARALLEL * PARALLEL:
        return a, b
    s = portable.matmul(np.cross(b - a, v), normal) / square
    t = portable.matmul(np.cross(b - a, u), normal) / square
    return a + s * u, b + t * v
