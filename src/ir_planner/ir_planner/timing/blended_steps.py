"""Several straight movements in one: each has its law, and the next starts before the last has
stopped.

q(t) = q_0 + sum_k d_k s_k(t - o_k). While two laws overlap the arm cuts the corner inside the
triangle of the two movements, as a controller's approximate positioning does; without overlap it
stops at the corner. All terms are cubics between switches on the 1 ms grid, so their sum is one
exact trajectory with a point per switch.
"""

import itertools
from typing import NamedTuple

import numpy as np

from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.timing.jerk_limited_laws import GRID_NS, StepLaws
from ir_values.arrays import FloatArray, IntArray


class TimedPath(NamedTuple):
    """Waypoints (M, n) rad, the laws of each of the M-1 steps, and how long neighbours overlap
    [grid steps] (M-2).
    """

    waypoints: FloatArray
    laws: tuple[StepLaws, ...]
    overlaps: tuple[int, ...]

    @property
    def starts(self) -> IntArray:
        """Grid steps (M-1,) at which each movement begins."""
        lasting = np.array([law.total for law in self.laws[:-1]], dtype=np.int64)
        return np.concatenate(
            [[0], np.cumsum(lasting - np.array(self.overlaps, dtype=np.int64))]
        ).astype(np.int64)

    @property
    def total(self) -> int:
        """Duration in grid steps."""
        return int(self.starts[-1]) + self.laws[-1].total

    def corner_window(self, corner: int) -> tuple[int, int]:
        """Grid steps between which the movements before and after inner waypoint `corner` (0-based)
        overlap.
        """
        begin = int(self.starts[corner + 1])
        return begin, begin + self.overlaps[corner]


def largest_overlaps(laws: tuple[StepLaws, ...]) -> tuple[int, ...]:
    """Overlap in which one movement brakes while the next speeds up; never more than two laws at a
    time.
    """
    return tuple(min(before.ramp_down, after.ramp_up) for before, after in itertools.pairwise(laws))


def blended(path: TimedPath, joint_names: tuple[str, ...]) -> JointTrajectory:
    """The trajectory of the path: one point per switch of any law, at rest at both ends."""
    starts = path.starts
    knots = np.unique(
        np.concatenate(
            [law.switches() + begin for law, begin in zip(path.laws, starts, strict=True)]
        )
    )
    n = path.waypoints.shape[1]
    q = np.broadcast_to(path.waypoints[0], (len(knots), n)).copy()
    qd, qdd = np.zeros((2, len(knots), n))
    for k, (law, begin) in enumerate(zip(path.laws, starts, strict=True)):
        s, sd, sdd = law.at(knots - begin)
        delta = path.waypoints[k + 1] - path.waypoints[k]
        q += s * delta
        qd += sd * delta
        qdd += sdd * delta
    q[0] = path.waypoints[0]
    q[-1] = path.waypoints[-1]
    qd[0] = 0.0
    qd[-1] = 0.0
    qdd[0] = 0.0
    qdd[-1] = 0.0
    return JointTrajectory(joint_names, knots * GRID_NS, q, qd, qdd)


def stretched(trajectory: JointTrajectory, factor: float) -> JointTrajectory:
    """The same path, slower (or faster) by `factor`, which is rounded up to six decimals.

    Times on the 1 ms grid stay whole nanoseconds, so that the interpolant is the stretched one
    exactly.
    """
    millionths = int(np.ceil(factor * 1e6 - 1e-6))
    exact = millionths / 1e6
    # milliseconds apart from the rest: the product of nanoseconds and millionths leaves 64 bits
    # within hours
    milliseconds, rest = np.divmod(trajectory.times_ns, GRID_NS)
    whole = milliseconds * millionths + (rest * millionths + 500_000) // 1_000_000
    velocities = trajectory.velocities
    accelerations = trajectory.accelerations
    return JointTrajectory(
        trajectory.joint_names,
        whole,
        trajectory.positions,
        None if velocities is None else velocities / exact,
        None if accelerations is None else accelerations / (exact * exact),
    )


def standing(
    position: FloatArray, joint_names: tuple[str, ...], duration: float = 0.0
) -> JointTrajectory:
    """Rest at `position` (n,) for `duration` s, at least 1 ms: the shortest trajectory there is."""
    rest = np.zeros((2, len(position)))
    end = max(round(duration * 1e9), GRID_NS)
    return JointTrajectory(
        joint_names, np.array([0, end]), np.stack([position, position]), rest, rest
    )
