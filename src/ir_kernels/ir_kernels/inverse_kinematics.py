"""Inverse kinematics of 6R arms: in closed form where axes allow it, else by a search over q4."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import data, portable
from ir_kernels.arguments import shaped
from ir_kernels.chain import Chain
from ir_kernels.errors import KernelError
from ir_kernels.ik_set import Found, IkSet, InverseKinematics, limits, newton, polished, with_turns
from ir_kernels.shoulder_wrist import shoulder_and_wrist
from ir_kernels.spherical_wrist import SphericalWristIk
from ir_kernels.wrist_geometry import ArmLines, arm_lines, wrist_geometry
from ir_values.arrays import BoolArray, FloatArray, IntArray

# Closed-form inverse kinematics of 6R arms whose axes 2, 3 and 4 are parallel (UR and its kind).
#
# q1 and q5 first (shoulder_wrist), then q6 from where z2 points in the hand, the sum of q2, q3 and
# q4 from the hand's rotation, and q2, q3 as a planar arm of two links.
#
# Branch numbers 0..7: +4 for the second shoulder, +2 for the other elbow, +1 for the other wrist.

STRETCHED = 1e-9  # m: how far out of reach still counts as stretched
FREE = np.linspace(-np.pi, np.pi, 25)  # rad: of a free q6, the nearest to 0 first
# sine between axis 6 and z2 below which only the sum of the wrist's angles is determined
SINGULAR = 1e-7


class ThreeParallelIk:
    """All configurations within position_min, position_max (6,) rad that bring `chain`'s tcp to a
    pose.

    Where axis 6 is parallel to axes 2 to 4 one parameter is free: the representative with q6 = 0
    (or the limit nearest to 0) is given, or where the arm does not reach so the next in steps of 15
    deg. Raises KernelError where axes 2, 3 and 4 are not parallel (1e-9).
    """

    def __init__(self, chain: Chain, position_min: ArrayLike, position_max: ArrayLike) -> None:
        self.chain = chain
        self.lines = arm_lines(chain)
        if not self.lines.parallel(3):
            raise KernelError("axes 2, 3 and 4 are not parallel")
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

        X (N, 4, 4): displacements of the hand. total (N,): sum of the angles of the three parallel
        axes. other: the second elbow. Upper arm and forearm are two bars in the plane across the
        parallel axes: the law of cosines gives the bend between them.
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

        upper_x, upper_y, upper = planar(o[2] - o[1])
        fore_x, fore_y, fore = planar(o[3] - o[2])
        aim_x, aim_y, distance = planar(target)
        cosine = (distance * distance - upper * upper - fore * fore) / (2.0 * upper * fore)
        side = -1.0 if other else 1.0
        bend = portable.arccos(np.clip(cosine, -1.0, 1.0)) * side

        # q3 is the bend, less the angle between the two bars at q = 0
        opening_sine = upper_x * fore_y - upper_y * fore_x
        opening_cosine = upper_x * fore_x + upper_y * fore_y
        turn = bend - portable.arctan2(opening_sine, opening_cosine)
        cos = portable.cos(turn)
        sin = portable.sin(turn)

        # q2 turns the bent arm onto the target
        arm_x = upper_x + fore_x * cos - fore_y * sin
        arm_y = upper_y + fore_x * sin + fore_y * cos
        aim_sine = aim_y * arm_x - aim_x * arm_y
        aim_cosine = aim_x * arm_x + aim_y * arm_y
        q2 = portable.arctan2(aim_sine, aim_cosine)
        q3 = lines.parallel(2) * turn
        q4 = lines.parallel(3) * (total - q2 - turn)

        longest = upper + fore + STRETCHED
        shortest = abs(upper - fore) - STRETCHED
        reached = (distance <= longest) & (distance >= shortest)
        stretched = np.abs(cosine) >= 1.0
        return np.stack([q1, q2, q3, q4, q5, q6], axis=1), reached & ~(other & stretched)


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


# Inverse kinematics of 6R arms whose axes 2 and 3 are parallel, whatever their wrist: a search
# over q4.
#
# With q4 known, q1 and q5 follow in closed form (shoulder_wrist), then q6, the sum of q2 and q3,
# and q2; what remains is one equation, that axis 3 is as far from axis 2 as it is built. It is
# evaluated on a grid of q4, and Newton's steps start wherever it is smallest along a branch.
# Solutions are the real roots of a polynomial, which come in pairs: where an odd number is found,
# one is missing, and the grid gets finer. Every answer is exact; that none is missed is measured
# (benchmarks/robots.py).

# values of q4: half a degree; a pair of solutions nearer than that is found by Newton's steps
GRID = 720
FINER = (4, 16)  # times the grid, in turn, where a solution is missing
CHUNK = 64  # poses at once: 64 x 720 x 4 candidates fit into the cache
# how far beyond a tangent a guess may lie: solutions between two values of q4 are near it
SLACK = 0.05
_LEVELS = 3  # the grid, and finer ones
_PARTS = 12  # of a step of the grid, where a branch ends or a solution is near
_STEPS = 8
_MORE_STEPS = 40
_HOPEFUL = 0.02  # m and rad
_EXACT = 1e-9  # m and rad: what counts as a solution
_SAME = 1e-6  # rad


class SearchedIk:
    """All configurations within position_min, position_max (6,) rad that bring `chain`'s tcp to a
    pose.

    branch: 0, 1, .. in the order of q. Raises KernelError where axes 2 and 3 are not parallel
    (1e-9).
    """

    def __init__(self, chain: Chain, position_min: ArrayLike, position_max: ArrayLike) -> None:
        self.chain = chain
        self.lines = arm_lines(chain)
        self.position_min, self.position_max = limits(position_min, position_max)

    def solve(self, poses: ArrayLike) -> IkSet:
        """All solutions for poses (N, 4, 4) of the tcp in the world; tcp(q) meets the pose to 1e-9
        m and 1e-9 rad.
        """
        targets = shaped("poses", poses, None, 4, 4)
        data.poses(targets, "poses")
        found: list[Found] = []
        for first in range(0, len(targets), CHUNK):
            chunk = targets[first : first + CHUNK]
            found += [(first + pose, branch, q) for pose, branch, q in self._all_of(chunk)]
        return with_turns(found, self.position_min, self.position_max)

    def _all_of(self, targets: FloatArray) -> list[Found]:
        """Solutions on the grid, and on finer ones for poses that lack one of a pair."""
        found = self._of(targets, GRID)
        for times in FINER:
            count = np.bincount([pose for pose, _, _ in found], minlength=len(targets))
            for k in np.flatnonzero(count % 2):
                again = self._of(targets[k : k + 1], times * GRID)
                if len(again) > count[k]:
                    found = [each for each in found if each[0] != k]
                    found += [(int(k), branch, q) for _, branch, q in again]
        return found

    def _of(self, targets: FloatArray, grid: int) -> list[Found]:
        pose, starts = self._guesses(targets, grid)
        best, error = newton(self.chain, targets[pose], starts, _STEPS)
        # beside a tangent, where each step gains one bit
        slow = (error >= _EXACT) & (error < _HOPEFUL)
        best[slow], error[slow] = newton(self.chain, targets[pose[slow]], best[slow], _MORE_STEPS)
        exact = error < _EXACT
        return _distinct(pose[exact], best[exact])

    def _guesses(self, targets: FloatArray, grid: int) -> tuple[IntArray, FloatArray]:
        """Where Newton's steps start for targets (N, 4, 4): poses (M,) and q (M, 6), on the grid,
        and on finer ones beside values of q4 where a solution is near, a branch ends, or one may
        lie between two values.
        """
        step = 2.0 * np.pi / grid
        poses = []
        starts = []
        even = np.linspace(-np.pi, np.pi, grid, endpoint=False)
        q4 = np.tile(even, (len(targets), 1))
        X_of_targets = displacements(self.chain, self.lines, targets)
        for level in range(_LEVELS):
            count = q4.shape[1]
            shape = (len(targets), count, -1)
            every_q4 = q4.ravel()
            X = np.repeat(X_of_targets, count, axis=0)
            q, miss, beyond = self._candidates(X, self.lines.turned(3, every_q4), every_q4)
            is_start = _starts(miss.reshape(shape))
            pose, k, branch = np.nonzero(is_start)
            poses.append(pose)
            starts.append(q.reshape(*shape, 6)[pose, k, branch])
            refined = _narrow(beyond.reshape(shape).min(axis=2))
            if level == 0:
                refined = refined | is_start.any(axis=2)
            if not refined.any():
                break
            q4 = _finer(q4, refined, step)
            step /= _PARTS
        return np.concatenate(poses), np.concatenate(starts)

    def _candidates(
        self, X: FloatArray, E4: FloatArray, q4: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """For displacements (N, 4, 4) of the hand and of axis 4, and q4 (N,) rad: q (N, 4, 6), by
        how much axis 3 misses its place [m] (N, 4), inf where there is nothing, how far beyond a
        tangent q1 or q5 is (N, 4).
        """
        lines = self.lines
        z2 = lines.z[1]
        turned = lines.turned
        q1s, q5s, exists, beyond = shoulder_and_wrist(lines, X, E4, SLACK)
        upper = lines.o[2] - lines.o[1]
        length = portable.norm(upper - portable.matmul(upper, z2) * z2)
        configurations = []
        misses = []
        for pair in range(4):
            q1 = q1s[:, pair]
            q5 = q5s[:, pair]
            q6, total, _ = wrist_and_sum(lines, X, E4, q1, q5, 0.0)
            back = portable.matmul(turned(0, -q1), X, turned(5, -q6), turned(4, -q5))
            back = portable.matmul(back, turned(3, -q4))  # = E2 E3
            elbow = portable.matmul(back[:, :3, :3], lines.o[2]) + back[:, :3, 3] - lines.o[1]
            q2 = angle_about(z2, np.broadcast_to(upper, elbow.shape), elbow)
            q3 = lines.parallel(2) * (total - q2)
            configurations.append(np.stack([q1, q2, q3, q4, q5, q6], axis=1))
            across = elbow - portable.matmul(elbow, z2)[:, None] * z2
            apart = np.linalg.norm(across, axis=1)
            misses.append(np.where(exists[:, pair], apart - length, np.inf))
        return np.stack(configurations, axis=1), np.stack(misses, axis=1), beyond


def _starts(lack: FloatArray) -> BoolArray:
    """Where Newton's steps start (n, grid, 4): on both sides of a change of sign and of the end of
    a branch, and around each smallest value (two solutions near each other change no sign).
    """
    there = np.isfinite(lack)
    size = np.abs(lack)
    least = there & (size <= np.roll(size, 1, axis=1)) & (size <= np.roll(size, -1, axis=1))
    least |= np.roll(least, 1, axis=1) | np.roll(least, -1, axis=1)
    ends = np.zeros_like(there)
    for step in (1, -1):
        beside = np.roll(lack, step, axis=1)
        ends |= ~np.isfinite(beside) | (np.sign(beside) != np.sign(lack))
    return np.asarray(there & (least | ends))


def _narrow(beyond: FloatArray) -> BoolArray:
    """Where (n, count) a branch may lie between two values: nothing exists, and it is nearest to
    existing.
    """
    least = (beyond <= np.roll(beyond, 1, axis=1)) & (beyond <= np.roll(beyond, -1, axis=1))
    return np.asarray((beyond > 0.0) & least)


def _finer(q4: FloatArray, rows: BoolArray, step: float) -> FloatArray:
    """Values (n, more) in order, within a step of those in `rows` (n, count); the last one
    repeated.
    """
    steps = step * np.arange(-_PARTS, _PARTS + 1) / _PARTS
    near = (own[row][:, None] + steps for own, row in zip(q4, rows, strict=True))
    fine = [np.unique(np.round(values.ravel(), 12)) for values in near]
    most = max(len(each) for each in fine)
    last = [each[-1:] if len(each) else np.zeros(1) for each in fine]
    return np.stack(
        [
            np.append(each, np.repeat(end, most - len(each)))
            for each, end in zip(fine, last, strict=True)
        ]
    )


def _distinct(pose: IntArray, q: FloatArray) -> list[Found]:
    """Each solution once, its angles in (-pi, pi], numbered in the order of q."""
    q = np.pi - np.mod(np.pi - q, 2.0 * np.pi)
    found: list[Found] = []
    for k in np.unique(pose):
        own = q[pose == k]
        own = own[np.lexsort(own.T[::-1])]
        kept: list[FloatArray] = []
        for row in own:
            if all(
                np.abs(np.mod(row - other + np.pi, 2.0 * np.pi) - np.pi).max() > _SAME
                for other in kept
            ):
                kept.append(row)
        found += [(int(k), branch, row) for branch, row in enumerate(kept)]
    return found


# An arm on a rail: six axes at each of some places of the rail.

RAIL_STEP = 0.25  # m between places of a rail
RAIL_PLACES = 41  # and how many they are at most


class RailIk:
    """Configurations within position_min, position_max (7,) [m, rad] that bring `chain`'s tcp to a
    pose with the rail at one of `places` (P,) m: all of the arm's there. None: places that divide
    the travel evenly, RAIL_STEP apart or RAIL_PLACES of them.

    branch: of the arm. Raises KernelError as `inverse_kinematics` of the arm does.
    """

    def __init__(
        self,
        chain: Chain,
        position_min: ArrayLike,
        position_max: ArrayLike,
        places: ArrayLike | None = None,
    ) -> None:
        low = np.array(position_min, np.float64)
        high = np.array(position_max, np.float64)
        if places is None:
            count = int(np.ceil((high[0] - low[0]) / RAIL_STEP)) + 1
            count = min(max(count, 2), RAIL_PLACES)
            places = np.linspace(low[0], high[0], count)
        listed = np.atleast_1d(np.asarray(places, np.float64))
        self.places = data.array(listed, "places", (None,))
        if (self.places < low[0]).any() or (self.places > high[0]).any():
            raise KernelError(f"places must be in [{low[0]:g}, {high[0]:g}] m")
        self._along = portable.matmul(chain.joint_origin[0][:3, :3], chain.joint_axis[0])
        self._along = portable.matmul(chain.base_pose[:3, :3], self._along)

        # the arm alone, as it stands with the rail at 0
        standing = portable.matmul(chain.base_pose, chain.joint_origin[0])
        own_joints = _Arm(chain.joint_origin[1:], chain.joint_axis[1:])
        arm = Chain(own_joints, standing, chain.tcp)
        self._arm = inverse_kinematics(arm, low[1:], high[1:])

    def with_places(self, places: ArrayLike) -> "RailIk":
        """The same for other places (P,) [m]."""
        other: RailIk = object.__new__(RailIk)
        other.__dict__.update(self.__dict__)
        other.places = np.atleast_1d(np.asarray(places, np.float64))
        return other

    def solve(self, poses: ArrayLike) -> IkSet:
        """All solutions for poses (N, 4, 4) of the tcp in the world; tcp(q) meets the pose to 1e-9
        m and 1e-9 rad.
        """
        targets = shaped("poses", poses, None, 4, 4)
        data.poses(targets, "poses")
        count = len(self.places)
        moved = np.repeat(targets, count, axis=0)
        return self._solved(moved, np.tile(self.places, len(targets)), count)

    def solve_each(self, poses: ArrayLike, places: ArrayLike) -> IkSet:
        """The same for poses (N, 4, 4), each with the rail at a place of its own (N,) [m]."""
        targets = shaped("poses", poses, None, 4, 4)
        data.poses(targets, "poses")
        return self._solved(np.array(targets), data.array(places, "places", (len(targets),)), 1)

    def _solved(self, poses: FloatArray, places: FloatArray, count: int) -> IkSet:
        """Of poses (N * count, 4, 4) with the rail at places (N * count,) [m], `count` of each."""
        poses[:, :3, 3] -= places[:, None] * self._along
        found = self._arm.solve(np.ascontiguousarray(poses))
        q = np.column_stack([places[found.pose_index], found.q])
        arrays = np.ascontiguousarray(q), found.pose_index // count, found.branch
        return IkSet(*(data.read_only(np.array(array)) for array in arrays))


class _Arm(NamedTuple):
    """The joints of an arm without its rail."""

    joint_origin: FloatArray
    joint_axis: FloatArray


def inverse_kinematics(
    chain: Chain, position_min: ArrayLike, position_max: ArrayLike
) -> InverseKinematics:
    """All configurations within the limits (6,) rad that bring `chain`'s tcp to a pose; on a rail
    (7,), at places that divide its travel evenly (`RailIk`).

    Raises KernelError for an arm that has not six axes, or whose axes 2 and 3 are not parallel.
    """
    if chain.first_slides:
        return RailIk(chain, position_min, position_max)
    lines = arm_lines(chain)
    if has_spherical_wrist(chain):
        return SphericalWristIk(chain, position_min, position_max)
    if lines.parallel(3):
        return ThreeParallelIk(chain, position_min, position_max)
    return SearchedIk(chain, position_min, position_max)


def has_spherical_wrist(chain: Chain) -> bool:
    """Whether the closed form for a spherical wrist serves."""
    try:
        wrist_geometry(chain)
    except KernelError:
        return False
    return True
