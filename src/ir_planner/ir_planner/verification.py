"""What holds along a trajectory, for every instant of its interpolant: limits by exact extremes of the
polynomials, torque by guaranteed bounds, clearance by a certificate. The first violation is named with
place, limit and excess.
"""

from dataclasses import dataclass

import numpy as np
from ir_kernels.collision import FREE
from ir_msgs_py.report import DistancePair
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from numpy.typing import NDArray

from ir_planner.clearance import pair_value
from ir_planner.polynomials import Extremes, extremes
from ir_planner.scene import PROOF_TOLERANCE, PlanningScene

FloatArray = NDArray[np.float64]
SLACK = 1e-6  # relative: what rounding of a limit that is reached exactly may cost
POSITION_SLACK = 1e-9  # rad
AT_REST = 1e-6  # rad/s and rad/s^2 that count as rest


@dataclass(frozen=True)
class Violation:
    """The first one: time [s] and segment (waypoint index before it), what, value, limit and unit, and a
    sentence.
    """

    time: float
    waypoint: int
    what: str
    excess: float
    sentence: str
    pair: DistancePair | None = None


@dataclass(frozen=True, eq=False)
class Verification:
    """violation None: everything is proved. Largest used shares of the limits, each (n,)."""

    violation: Violation | None
    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray
    torque: FloatArray
    travel: FloatArray

    @property
    def certified(self) -> bool:
        """Clearance and limits proved for every instant."""
        return self.violation is None

    @property
    def status(self) -> Status:
        """SUCCESS or INVALID_MOTION_PLAN with the first violation."""
        if self.violation is None:
            return Status.success()
        return Status(StatusCode.INVALID_MOTION_PLAN, self.violation.sentence)


def verify(
    trajectory: JointTrajectory, scene: PlanningScene, safety_distance: float, station: str = ""
) -> Verification:
    """Check a trajectory against the robot's limits and S_m (or what `station` allows its pairs)."""
    coefficients, durations = trajectory.coefficients()
    largest = extremes(coefficients, durations)
    robot, limits = scene.cell.robot, scene.limits
    share = [
        largest.velocity / limits.velocity,
        largest.acceleration / limits.acceleration,
        largest.jerk / limits.jerk,
        torque_bounds(scene, coefficients, durations),
    ]
    names = ("velocity", "acceleration", "jerk", "torque")
    found = [_position_violation(trajectory, largest, scene), _rest_violation(trajectory, scene)]
    for name, values in zip(names, share, strict=True):
        found.append(_share_violation(name, values, trajectory, robot.joint_names))
    found.append(clearance_violation(trajectory, scene, safety_distance, station))
    violations = [violation for violation in found if violation is not None]
    first = min(violations, key=lambda violation: violation.time) if violations else None
    top = [values.max(axis=0, initial=0.0) for values in share]
    return Verification(first, top[0], top[1], top[2], top[3], largest.travel.sum(axis=0))


def torque_bounds(scene: PlanningScene, coefficients: FloatArray, durations: FloatArray) -> FloatArray:
    """Guaranteed bound (S, n) of the share of the torque envelope used in each segment."""
    return np.asarray(scene.dynamics.torque_bounds(coefficients, durations))


def clearance_violation(
    trajectory: JointTrajectory, scene: PlanningScene, safety_distance: float, station: str = ""
) -> Violation | None:
    """The first instant at which a pair is too near, or not proved to be far enough; None: proved."""
    threshold = scene.thresholds(safety_distance, station) - PROOF_TOLERANCE
    coefficients, durations = trajectory.coefficients()
    if len(durations) == 0:
        free = bool(scene.collision.is_free(trajectory.positions, threshold).all())
        near = scene.collision.min_distance(trajectory.positions, threshold)
        verdict, begin, end, z = (FREE if free else 1), 0.0, 0.0, int(near.pair[0])
    else:
        certificate = scene.collision.certify_trajectory(coefficients, durations, threshold)
        verdict, (begin, end), z = certificate.verdict, certificate.interval, certificate.pair
    if verdict == FREE:
        return None
    start = float(trajectory.times[0])
    time = start + end
    q = trajectory.sample([time]).q
    pair = pair_value(scene, q[0], z, bool(scene.allowed(station)[z]))
    allowed = float(threshold[z]) + PROOF_TOLERANCE
    k = _segment(trajectory, time)
    excess = allowed - pair.distance
    sentence = (
        f"{pair.body_a} and {pair.body_b} ({pair.kind}) come to {pair.distance * 1e3:.1f} mm "
        f"after waypoint {k} at "
        f"{time:.3f} s: they must stay {allowed * 1e3:.1f} mm apart (excess {excess * 1e3:.1f} mm)"
    )
    return Violation(start + begin, k, "clearance", excess, sentence, pair)


def _segment(trajectory: JointTrajectory, time: float) -> int:
    last = max(len(trajectory.times_ns) - 2, 0)
    return int(np.clip(np.searchsorted(trajectory.times, time, side="right") - 1, 0, last))


def _position_violation(
    trajectory: JointTrajectory, largest: Extremes, scene: PlanningScene
) -> Violation | None:
    robot = scene.cell.robot
    low, high = largest.lowest, largest.highest
    if len(low) == 0:
        low = high = trajectory.positions
    excess = np.maximum(low * -1.0 + robot.position_min, high - robot.position_max)
    beyond = np.argwhere(excess > POSITION_SLACK)
    if len(beyond) == 0:
        return None
    k, j = (int(i) for i in beyond[0])
    reached = low[k, j] if robot.position_min[j] - low[k, j] > POSITION_SLACK else high[k, j]
    sentence = (
        f"{robot.joint_names[j]} reaches {np.degrees(reached):.6g} deg after waypoint {k}: it must be in "
        f"[{np.degrees(robot.position_min[j]):g}, {np.degrees(robot.position_max[j]):g}] deg "
        f"(excess {excess[k, j]:.3g} rad)"
    )
    return Violation(float(trajectory.times[k]), k, "position", float(excess[k, j]), sentence)


def _rest_violation(trajectory: JointTrajectory, scene: PlanningScene) -> Violation | None:
    ends = trajectory.sample(trajectory.times[[0, -1]])
    names = scene.cell.robot.joint_names
    coefficients, durations = trajectory.coefficients()
    if len(durations) == 0:
        return None
    first = (coefficients[0, :, 1], 2.0 * coefficients[0, :, 2])
    final = (ends.qd[-1], ends.qdd[-1])
    for (speed, acceleration), k in ((first, 0), (final, len(durations))):
        for what, values, unit in (("velocity", speed, "rad/s"), ("acceleration", acceleration, "rad/s^2")):
            j = int(np.argmax(np.abs(values)))
            if abs(values[j]) > AT_REST:
                where = "starts" if k == 0 else "ends"
                sentence = (
                    f"the movement {where} with {what} {values[j]:.4g} {unit} of {names[j]} "
                    f"at waypoint {k}: it must "
                    f"be 0 {unit} within {AT_REST:g}"
                )
                return Violation(
                    float(trajectory.times[k]), k, f"{what} at rest", abs(float(values[j])), sentence
                )
    return None


def _share_violation(
    name: str, share: FloatArray, trajectory: JointTrajectory, joint_names: tuple[str, ...]
) -> Violation | None:
    beyond = np.argwhere(share > 1.0 + SLACK)
    if len(beyond) == 0:
        return None
    k, j = (int(i) for i in beyond[0])
    sentence = (
        f"{joint_names[j]} needs {share[k, j]:.3f} times its {name} limit after waypoint {k}: "
        "it must be at most 1 "
        f"(excess {100.0 * (share[k, j] - 1.0):.1f} %)"
    )
    return Violation(float(trajectory.times[k]), k, name, float(share[k, j] - 1.0), sentence)
