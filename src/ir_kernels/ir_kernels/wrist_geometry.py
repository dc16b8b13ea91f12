"""The axes of a 6R arm as lines, and the constants of one with a spherical wrist, derived from its
chain; anything else is refused with the reason.

At q = 0 and in the frame of link 0 the joints are lines: points o_i, directions z_i. The closed
form (Pieper 1968) needs z1 _|_ z2, z2 || z3 (a planar arm behind a turning base), z4 _|_ z5 _|_ z6
and axes 4, 5, 6 meeting in one point, the wrist centre. Arm quantities are complex numbers in the
plane normal to z2: z + i x, with z along z1 and x = z2 x z1, because a turn by q about z2
multiplies them by exp(i q).
"""

from typing import NamedTuple

import numpy as np

from ir_kernels import portable
from ir_kernels.chain import Chain
from ir_kernels.errors import KernelError
from ir_kernels.reference.chain import axis_rotation
from ir_values.arrays import FloatArray

# A 6R arm as the lines of its axes at q = 0, for arms whose axes 2 and 3 are parallel.
#
# Turns about axes 2 and 3 leave the coordinate of every point along z2 as it is. That coordinate,
# of one point and of one direction of the hand, gives two equations in which q2 and q3 do not
# occur; `shoulder_wrist` solves them.

MEETING = 1e-9  # m: axes 5 and 6 that come so near meet
PARALLEL = 1e-9  # of |z2 x z3|


class ArmLines(NamedTuple):
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
    """The lines of a chain. KernelError names what no method here solves."""
    if chain.n != 6 or chain.first_slides:
        raise KernelError(f"the arm has {chain.n} axes: inverse kinematics needs 6 that turn")
    frames = (
        portable.matmul(portable.inv(chain.base_pose), chain.link_poses(np.zeros((1, 6)))[0])
    )[1:]
    z = np.einsum("kij,kj->ki", frames[:, :3, :3], chain.joint_axis)
    o = frames[:, :3, 3].copy()
    o[4], o[5] = _feet(o[4], z[4], o[5], z[5])
    lines = ArmLines(z, o, frames[5], bool(portable.norm(o[5] - o[4]) < MEETING))
    if not lines.parallel(2):
        sine = float(portable.norm(np.cross(z[1], z[2])))
        raise KernelError(
            f"axes 2 and 3 are not parallel (|z2 x z3| = {sine:.3g}, at most {PARALLEL:g}): "
            "no inverse kinematics for such an arm"
        )
    if float(portable.norm(np.cross(z[4], z[5]))) < PARALLEL:
        raise KernelError("axes 5 and 6 are parallel: no inverse kinematics for such an arm")
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


POINT_TOLERANCE = 1e-9  # m: by how much axes 4, 5, 6 may miss each other
ANGLE_TOLERANCE = 1e-9  # of the scalar products that have to vanish


class WristGeometry(NamedTuple):
    """See the module. All in the frame of link 0 at q = 0; arrays are read-only."""

    axis: FloatArray  # (6, 3) z_i
    plane: FloatArray  # (3, 3) rows x, y = z2, z = z1
    axis_point: FloatArray  # (3,) foot of axis 1: a point on it
    lateral: float  # m, distance of the wrist centre from axis 1 along z2
    forward: (
        float  # +1 or -1: the side of axis 1, along x, to which the arm reaches forwards at q1 = 0
    )
    shoulder: complex  # axis 2 seen from axis_point
    upper_arm: complex  # from axis 2 to axis 3
    forearm: complex  # from axis 3 to the wrist centre
    elbow_sign: float  # +1 where z3 = z2, -1 where z3 = -z2
    wrist_zero: float  # rad, angle from z4 to z6 about z5
    hand: FloatArray  # (4, 4) pose of link 6 at q = 0
    wrist_in_hand: FloatArray  # (3,) wrist centre in the frame of link 6


def _meeting_point(o: FloatArray, z: FloatArray) -> FloatArray:
    """Point nearest to the three lines, or KernelError when it isn't on each of them."""
    normal = np.eye(3) - z[:, :, None] * z[:, None, :]
    feet = np.einsum("kij,kj->ki", normal, o)
    point = portable.least_squares(normal.reshape(-1, 3), feet.reshape(-1, 1))[:, 0]
    miss = float(np.linalg.norm(np.einsum("kij,kj->ki", normal, point - o), axis=1).max())
    if miss > POINT_TOLERANCE:
        raise KernelError(
            f"chain: the wrist is not spherical, its axes miss a common point by {miss:.3g} m "
            f"(at most {POINT_TOLERANCE} m)"
        )
    return np.asarray(point)


def _check_axes(z: FloatArray) -> None:
    """KernelError where the directions (6, 3) of the axes are not those of the closed form."""
    conditions: dict[str, float] = {
        "axes 1 and 2 are not perpendicular: z1.z2": float(portable.matmul(z[0], z[1])),
        "axes 2 and 3 are not parallel: |z2 x z3|": portable.norm(np.cross(z[1], z[2])),
        "axes 4 and 5 are not perpendicular: z4.z5": float(portable.matmul(z[3], z[4])),
        "axes 5 and 6 are not perpendicular: z5.z6": float(portable.matmul(z[4], z[5])),
    }
    for sentence, value in conditions.items():
        if abs(value) > ANGLE_TOLERANCE:
            raise KernelError(f"chain: {sentence} = {value:.3g} (at most {ANGLE_TOLERANCE})")


def wrist_geometry(chain: Chain) -> WristGeometry:
    """Derive the constants of `chain`; KernelError names the condition that it breaks, with the
    value.
    """
    if chain.n != 6 or chain.first_slides:
        raise KernelError(f"chain has {chain.n} joints, the closed form needs 6 that turn")
    to_base = portable.inv(chain.base_pose)
    links = portable.matmul(to_base, chain.link_poses(np.zeros((1, 6)))[0])
    frames = links[1:]
    z = np.einsum("kij,kj->ki", frames[:, :3, :3], chain.joint_axis)
    o = frames[:, :3, 3]
    _check_axes(z)
    centre = _meeting_point(o[3:], z[3:])
    plane = np.stack([np.cross(z[1], z[0]), z[1], z[0]])
    foot = o[0] + z[0] * (portable.matmul(z[0], o[1] - o[0]))

    def planar(vector: FloatArray) -> complex:
        """A vector of the arm's plane: along axis 1, and i times what is across."""
        along = portable.matmul(plane[2], vector)
        across = portable.matmul(plane[0], vector)
        return complex(along, across)

    for array in (z, plane, foot):
        array.setflags(write=False)
    shoulder = planar(o[1] - foot)
    upper_arm = planar(o[2] - o[1])
    forearm = planar(centre - o[2])
    if abs(upper_arm) < POINT_TOLERANCE or abs(forearm) < POINT_TOLERANCE:
        raise KernelError(
            f"chain: upper arm of {abs(upper_arm):.3g} m or forearm of {abs(forearm):.3g} m "
            "vanishes"
        )

    # how far axis 6 is turned out of axis 4 about axis 5, where all joints are at 0
    sine = portable.matmul(z[4], np.cross(z[3], z[5]))
    cosine = portable.matmul(z[3], z[5])
    hand = frames[5]
    return WristGeometry(
        axis=z,
        plane=plane,
        axis_point=foot,
        lateral=float(portable.matmul(z[1], centre - foot)),
        forward=-1.0 if shoulder.imag < -POINT_TOLERANCE else 1.0,
        shoulder=shoulder,
        upper_arm=upper_arm,
        forearm=forearm,
        elbow_sign=float(np.sign(portable.matmul(z[1], z[2]))),
        wrist_zero=float(portable.arctan2(sine, cosine)),
        hand=hand,
        wrist_in_hand=portable.matmul(hand[:3, :3].T, centre - hand[:3, 3]),
    )
