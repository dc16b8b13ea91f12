"""Closed-form inverse kinematics of a 6R arm with a spherical wrist: all branches, all turns
(Pieper 1968).

Branch numbers 0..7: +4 where the arm reaches backwards over its base, +2 for the other elbow, +1
for the other wrist.
"""

from itertools import product

import numpy as np

from ir_kernels.reference.chain import axis_rotation
from ir_kernels.wrist_geometry import WristGeometry
from ir_values.arrays import BoolArray, FloatArray, IntArray

REACH_TOLERANCE = 1e-10  # m: how far out of reach still counts as stretched
LIMIT_TOLERANCE = 1e-10  # rad: how far beyond a limit still counts as on it
SINGULAR_WRIST = 1e-10  # sine of the wrist angle below which only q4 +- q6 is determined


def arm_branches(geometry: WristGeometry, centre: FloatArray) -> tuple[FloatArray, BoolArray]:
    """q1, q2, q3 (N, 4, 3) [rad] for wrist centres (N, 3) [m] in the frame of link 0, and which
    exist (N, 4); branches 00 01 10 11.

    Where the arm is stretched both elbows are the same: only the first exists. On axis 1 any q1
    serves: 0 is taken.
    """
    # The arm lies in a plane through axis 1, `lateral` m beside it: points of that plane are
    # complex numbers z + i reach, and upper arm and forearm are two of them.
    x, y, z = geometry.plane @ (centre - geometry.axis_point).T
    N = len(centre)
    q = np.empty((N, 4, 3))
    exists = np.empty((N, 4), bool)
    radius = np.hypot(x, y)
    d = geometry.lateral
    beyond = radius < abs(d) - REACH_TOLERANCE
    forward = np.sqrt(np.maximum(radius**2 - d**2, 0.0))
    heading = np.where(radius > 0.0, np.arctan2(y, x), 0.0)
    upper = abs(geometry.upper_arm)
    fore = abs(geometry.forearm)
    longest = upper + fore
    shortest = abs(upper - fore)
    opening = np.angle(np.conj(geometry.upper_arm) * geometry.forearm)
    for back in (0, 1):
        reach = geometry.forward * (-forward if back else forward)
        # q1 turns the plane to the wrist centre, over the base for `back`
        q1 = heading - np.arctan2(d, reach)
        target = (z + 1j * reach) - geometry.shoulder

        # the triangle of upper arm, forearm and target: law of cosines for the bend of the elbow
        distance = np.abs(target)
        cosine = (distance**2 - upper**2 - fore**2) / (2.0 * upper * fore)
        stretched = (distance > longest) | (distance < shortest)
        not_too_far = distance <= longest + REACH_TOLERANCE
        not_too_near = distance >= shortest - REACH_TOLERANCE
        straight = np.where(cosine > 0.0, 0.0, np.pi)
        bent = np.arccos(np.clip(cosine, -1.0, 1.0))
        bend = np.where(stretched, straight, bent)

        for low in (0, 1):
            # q2 turns upper arm and bent forearm together onto the target
            turn = (-bend if low else bend) - opening
            elbow = geometry.upper_arm + geometry.forearm * np.exp(1j * turn)
            branch = 2 * back + low
            q[:, branch, 0] = q1
            q[:, branch, 1] = np.angle(target * np.conj(elbow))
            q[:, branch, 2] = geometry.elbow_sign * turn
            same_as_first = stretched & bool(low)
            exists[:, branch] = not_too_far & not_too_near & ~beyond & ~same_as_first
    return q, exists


def wrist_branches(
    geometry: WristGeometry, arm: FloatArray, hand: FloatArray, free_q4: float
) -> tuple[FloatArray, BoolArray]:
    """q4, q5, q6 (N, 2, 3) [rad] for arm angles (N, 3) and the hand's rotation (N, 3, 3) in link 0,
    and which exist (N, 2).

    Where axes 4 and 6 are parallel only their sum is determined: one representative with q4 =
    `free_q4` exists.
    """
    z = geometry.axis
    before = (
        axis_rotation(z[0], arm[:, 0])
        @ axis_rotation(z[1], arm[:, 1])
        @ axis_rotation(z[2], arm[:, 2])
    )
    # = exp(z4 q4) exp(z5 q5) exp(z6 q6)
    W = np.swapaxes(before, 1, 2) @ hand @ geometry.hand[:3, :3].T

    # Axis 6 is turned by q4 and q5 only: its components along axes 4 and 5 and across give both.
    across = np.cross(z[3], z[4])
    axis6 = W @ z[5]
    along4 = axis6 @ z[3]
    along5 = axis6 @ z[4]
    along_across = axis6 @ across
    beside4 = np.hypot(along5, along_across)
    singular = beside4 < SINGULAR_WRIST
    q = np.empty((len(arm), 2, 3))
    exists = np.empty((len(arm), 2), bool)
    for flip in (0, 1):
        sign = -1.0 if flip else 1.0
        q4 = np.where(singular, free_q4, np.arctan2(sign * along5, -sign * along_across))
        q5 = np.arctan2(sign * beside4, along4) - geometry.wrist_zero
        # = exp(z6 q6), which turns axis 5 by q6
        outer = axis_rotation(z[3], q4) @ axis_rotation(z[4], q5)
        rest = np.swapaxes(outer, 1, 2) @ W
        axis5 = rest @ z[4]
        q6 = np.arctan2(axis5 @ np.cross(z[5], z[4]), axis5 @ z[4])
        q[:, flip] = np.stack([q4, q5, q6], axis=1)
        exists[:, flip] = ~(singular & bool(flip))
    return q, exists


def turns(angle: float, low: float, high: float) -> list[float]:
    """All values angle + 2 pi k within [low, high], ascending; within LIMIT_TOLERANCE of a limit
    counts as on it.
    """
    first = int(np.ceil((low - LIMIT_TOLERANCE - angle) / (2.0 * np.pi)))
    last = int(np.floor((high + LIMIT_TOLERANCE - angle) / (2.0 * np.pi)))
    return [min(max(angle + 2.0 * np.pi * k, low), high) for k in range(first, last + 1)]


def solve(
    geometry: WristGeometry, hand: FloatArray, position_min: FloatArray, position_max: FloatArray
) -> tuple[FloatArray, IntArray, IntArray]:
    """All q (M, 6) for poses of link 6 (N, 4, 4) in link 0, with pose index (M,) and branch (M,),
    sorted by pose, branch, q. Limits (6,) [rad]: every full turn within them is a solution.
    """
    centre = hand[:, :3, 3] + hand[:, :3, :3] @ geometry.wrist_in_hand
    arm, arm_exists = arm_branches(geometry, centre)
    free_q4 = float(np.clip(0.0, position_min[3], position_max[3]))
    found: list[tuple[int, int, tuple[float, ...]]] = []
    for arm_branch in range(4):
        wrist, wrist_exists = wrist_branches(geometry, arm[:, arm_branch], hand[:, :3, :3], free_q4)
        for flip in (0, 1):
            both_exist = arm_exists[:, arm_branch] & wrist_exists[:, flip]
            for pose in np.flatnonzero(both_exist):
                angles = [*arm[pose, arm_branch], *wrist[pose, flip]]
                choices = []
                for angle, low, high in zip(angles, position_min, position_max, strict=True):
                    choices.append(turns(float(angle), float(low), float(high)))
                found.extend((int(pose), 2 * arm_branch + flip, q) for q in product(*choices))
    found.sort()
    poses = np.array([pose for pose, _, _ in found], np.int64)
    branches = np.array([branch for _, branch, _ in found], np.int64)
    configurations = np.array([q for _, _, q in found]).reshape(-1, 6)
    return configurations, poses, branches
