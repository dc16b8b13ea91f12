"""What holds along a trajectory, for every instant of its interpolant: limits by exact extremes of the
polynomials, torque by guaranteed bounds, clearance by a certificate. The first violation is named with
place, limit and excess.
"""

from dataclasses import dataclass

import numpy as np
from ir_kernels.collision import FREE
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from numpy.typing import NDArray

from ir_planner.clearance import pair_value
from ir_planner.limit_checks import (
    SLACK,
    Violation,
    jump_violation,
    position_violation,
    rest_violation,
    share_violation,
)
from ir_planner.polynomials import extremes
from ir_planner.scene import PROOF_TOLERANCE, PlanningScene
from ir_planner.timing import torque_use

FloatArray = NDArray[np.float64]


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
    share = {
        "velocity": largest.velocity / limits.velocity,
        "acceleration": largest.acceleration / limits.acceleration,
        "jerk": largest.jerk / limits.jerk,
    }
    torque, torque_violation = _torque(trajectory, scene)
    found = [
        position_violation(trajectory, largest, scene),
        rest_violation(trajectory, scene),
        jump_violation(trajectory, robot.joint_names),
        torque_violation,
        *(share_violation(name, values, trajectory, robot.joint_names) for name, values in share.items()),
        clearance_violation(trajectory, scene, safety_distance, station),
    ]
    violations = [violation for violation in found if violation is not None]
    first = min(violations, key=lambda violation: violation.time) if violations else None
    top = {name: values.max(axis=0, initial=0.0) for name, values in share.items()}
    return Verification(
        first, top["velocity"], top["acceleration"], top["jerk"], torque, largest.travel.sum(axis=0)
    )


def _torque(trajectory: JointTrajectory, scene: PlanningScene) -> tuple[FloatArray, Violation | None]:
    """Guaranteed bound (n,) of the share of the torque envelope, and the violation where it exceeds 1."""
    coefficients, durations = trajectory.coefficients()
    if len(durations) == 0:
        rest = np.zeros_like(trajectory.positions)
        return torque_use(scene.dynamics, trajectory.positions, rest, rest).max(axis=0), None
    bounds = scene.dynamics.torque_bounds(coefficients, durations)
    upper = np.asarray(bounds.upper)
    if upper.max() <= 1.0 + SLACK:
        return upper, None
    j = int(np.argmax(upper))
    time = float(trajectory.times[0]) + float(bounds.time[j])
    k = _segment(trajectory, time)
    sentence = (
        f"{scene.cell.robot.joint_names[j]} needs {bounds.sampled[j]:.3f} (at most {upper[j]:.3f}) times its "
        f"torque limit after waypoint {k} at {time:.3f} s: it must be at most 1 "
        f"(excess {100.0 * (upper[j] - 1.0):.1f} %)"
    )
    return upper, Violation(time, k, "torque", float(upper[j] - 1.0), sentence)


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
