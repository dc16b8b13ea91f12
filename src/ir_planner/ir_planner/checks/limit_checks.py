"""Limits along a trajectory: where position, rest, continuity or a joint's limit is first
violated.
"""

from dataclasses import dataclass

import numpy as np

from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import DistancePair
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import Extremes
from ir_planner.scene import PlanningScene

SLACK = 1e-6  # relative: what rounding of a limit that is reached exactly may cost
POSITION_SLACK = 1e-9  # rad
JUMP = 1e-4  # rad/s, rad/s^2: rounding of times and points
AT_REST = 1e-6  # rad/s and rad/s^2 that count as rest


@dataclass(frozen=True)
class Violation:
    """The first one: time [s] and segment (waypoint index before it), what, value, limit and unit,
    and a sentence.
    """

    time: float
    waypoint: int
    what: str
    excess: float
    sentence: str
    pair: DistancePair | None = None


def segment_at(trajectory: JointTrajectory, time: float) -> int:
    """Index of the segment at an instant [s], which is that of the waypoint before it."""
    last = max(len(trajectory.times_ns) - 2, 0)
    return int(np.clip(np.searchsorted(trajectory.times, time, side="right") - 1, 0, last))


def position_violation(
    trajectory: JointTrajectory, largest: Extremes, scene: PlanningScene
) -> Violation | None:
    """Where a joint leaves its range."""
    robot = scene.cell.robot
    low = largest.lowest
    high = largest.highest
    if len(low) == 0:
        low = high = trajectory.positions
    excess = np.maximum(low * -1.0 + robot.position_min, high - robot.position_max)
    beyond = np.argwhere(excess > POSITION_SLACK)
    if len(beyond) == 0:
        return None
    k, j = (int(i) for i in beyond[0])
    reached = low[k, j] if robot.position_min[j] - low[k, j] > POSITION_SLACK else high[k, j]
    sentence = (
        f"{robot.joint_names[j]} reaches {np.degrees(reached):.6g} deg after waypoint {k}: it "
        f"must be in [{np.degrees(robot.position_min[j]):g}, "
        f"{np.degrees(robot.position_max[j]):g}] deg (excess {np.degrees(excess[k, j]):.3g} deg)"
    )
    return Violation(float(trajectory.times[k]), k, "position", float(excess[k, j]), sentence)


def rest_violation(trajectory: JointTrajectory, scene: PlanningScene) -> Violation | None:
    """Where the movement does not start or end at rest."""
    ends = trajectory.sample(trajectory.times[[0, -1]])
    names = scene.cell.robot.joint_names
    coefficients, durations = trajectory.coefficients()
    if len(durations) == 0:
        return None
    first = (coefficients[0, :, 1], 2.0 * coefficients[0, :, 2])
    final = (ends.qd[-1], ends.qdd[-1])
    for (speed, acceleration), k in ((first, 0), (final, len(durations))):
        for what, values, unit in (
            ("velocity", speed, "rad/s"),
            ("acceleration", acceleration, "rad/s^2"),
        ):
            j = int(np.argmax(np.abs(values)))
            if abs(values[j]) > AT_REST:
                where = "starts" if k == 0 else "ends"
                sentence = (
                    f"the movement {where} with {what} {values[j]:.4g} {unit} of {names[j]} at "
                    f"waypoint {k}: it must be 0 {unit} within {AT_REST:g}"
                )
                return Violation(
                    float(trajectory.times[k]),
                    k,
                    f"{what} at rest",
                    abs(float(values[j])),
                    sentence,
                )
    return None


def jump_violation(trajectory: JointTrajectory, joint_names: tuple[str, ...]) -> Violation | None:
    """Where the interpolant's velocity or acceleration jumps: the next derivative has no bound
    there.
    """
    coefficients, durations = trajectory.coefficients()
    if len(durations) < 2:
        return None
    powers = portable.power(durations[:-1, None, None], np.arange(6))
    order = np.arange(6)
    before = coefficients[:-1] * powers
    ends = (
        (
            "velocity",
            "rad/s",
            (before * order).sum(axis=2) / durations[:-1, None],
            coefficients[1:, :, 1],
        ),
        (
            "acceleration",
            "rad/s^2",
            (before * order * (order - 1)).sum(axis=2) / durations[:-1, None] ** 2,
            2.0 * coefficients[1:, :, 2],
        ),
    )
    for what, unit, end, begin in ends:
        jump = np.abs(end - begin)
        beyond = np.argwhere(jump > JUMP)
        if len(beyond):
            k, j = (int(i) for i in beyond[0])
            sentence = (
                f"{what} of {joint_names[j]} jumps by {jump[k, j]:.4g} {unit} at waypoint {k + 1}: "
                "it must be continuous"
            )
            return Violation(
                float(trajectory.times[k + 1]), k + 1, what, float(jump[k, j]), sentence
            )
    return None


def share_violation(
    name: str, share: FloatArray, trajectory: JointTrajectory, joint_names: tuple[str, ...]
) -> Violation | None:
    """Where more than a limit is used; `share` (S, n) of it in each segment."""
    beyond = np.argwhere(share > 1.0 + SLACK)
    if len(beyond) == 0:
        return None
    k, j = (int(i) for i in beyond[0])
    sentence = (
        f"{joint_names[j]} needs {share[k, j]:.3f} times its {name} limit after waypoint {k}: it "
        f"must be at most 1 (excess {100.0 * (share[k, j] - 1.0):.1f} %)"
    )
    return Violation(float(trajectory.times[k]), k, name, float(share[k, j] - 1.0), sentence)
