"""Status and turn, S and T: which of the configurations that reach a pose a position means.

S: bit 0 the wrist centre lies behind axis 1, bit 1 the elbow is bent towards positive angles of A3,
bit 2 A5 is negative. T: bit n is set where the angle of axis n + 1 is negative. Bits of an angle
that is 0 mean
nothing: a position that was taught there may carry either.
"""

import numpy as np

from ir_kernels import Chain, portable
from ir_msgs_py.arrays import BoolArray, FloatArray, IntArray

_UNDECIDED = 1e-4  # rad or m: nearer to 0 than this, either bit is taken


def _signs(chain: Chain, q: FloatArray) -> FloatArray:
    """(N, 9): what the bits are signs of, a set bit is negative: three of the status, six of the
    turn.
    """
    poses = chain.link_poses(q)
    shoulder, elbow, wrist = (poses[:, k, :3, 3] for k in (2, 3, 5))
    foot = chain.base_pose
    seen = portable.matmul(wrist - foot[:3, 3], foot[:3, :3])  # in the robot's foot
    turned = q[:, 0] * chain.robot.joint_axis[0, 2]
    before = portable.cos(turned) * seen[:, 0] + portable.sin(turned) * seen[:, 1]
    axis = portable.matmul(poses[:, 3, :3, :3], chain.robot.joint_axis[2])
    bent = np.einsum("ni,ni->n", np.cross(elbow - shoulder, wrist - elbow), axis)
    return np.column_stack([before, -bent, q[:, 4], q])


def status_turn(chain: Chain, q: FloatArray) -> tuple[int, int]:
    """S and T of a configuration q (n,) [rad]."""
    negative = _signs(chain, q[None])[0] < 0.0
    status = negative[:3] * (1 << np.arange(3))
    turn = negative[3:] * (1 << np.arange(q.size))
    return int(status.sum()), int(turn.sum())


def meeting(chain: Chain, q: FloatArray, status: int | None, turn: int | None) -> BoolArray:
    """Which configurations q (N, n) [rad] have this status and turn; None: any."""
    signs = _signs(chain, q)
    wanted = np.concatenate([_bits(status, 3), _bits(turn, q.shape[1])])
    agrees = (signs < 0.0) == (wanted == 1)
    return np.asarray((agrees | (np.abs(signs) < _UNDECIDED) | (wanted < 0)).all(axis=1))


def _bits(value: int | None, count: int) -> IntArray:
    """Bits of a value, lowest first; -1 where there is none."""
    if value is None:
        return np.full(count, -1, dtype=np.int64)
    return (value >> np.arange(count)) & 1
