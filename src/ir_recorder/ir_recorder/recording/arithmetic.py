"""The arithmetic of this process, as a digest.

Every x86-64 processor has the same (law 26); another architecture, compiler or the NumPy reference
may have another. So a few numbers are computed with the functions that decide answers, and the
result is compared bit by bit.
"""

from __future__ import annotations

from functools import cache
from hashlib import sha256

import numpy as np

from ir_description import load_robot
from ir_kernels import Chain, DynamicsModel, portable

_CHARACTERS = 12  # of the digest: for people to compare
_N = 37  # no multiple of what a processor adds at once


@cache
def arithmetic() -> str:
    """Digest of numbers that another architecture or compiler may compute otherwise in the last
    bit.
    """
    x = np.linspace(-3.0, 3.0, _N * _N)
    A = portable.sin(np.add.outer(np.arange(_N), np.square(np.arange(_N, dtype=float))))
    regular = A + _N * np.eye(_N)
    robot = load_robot()
    joints = np.arange(len(robot.joint_names))
    q = np.ascontiguousarray(portable.sin(np.add.outer(np.arange(_N), joints)))
    poses = Chain(robot).tcp_poses(q)
    torques = DynamicsModel(robot).inverse_dynamics(q, 2.0 * q, q[::-1].copy())
    computed = [
        *(portable.sin(x), portable.cos(x), portable.exp(x), portable.log(np.abs(x))),
        *(portable.arctan2(x, x[::-1]), portable.power(np.abs(x), 1.7)),
        *(
            np.cumsum(x),
            np.array(x.sum()),
            np.linalg.norm(A, axis=1),
            np.einsum("ij,j->i", A, A[0]),
        ),
        *(portable.matmul(A, A), portable.solve(regular, x[:_N]), portable.singular_values(A)),
        *(poses, torques),
    ]
    return sha256(b"".join(each.tobytes() for each in computed)).hexdigest()[:_CHARACTERS]
