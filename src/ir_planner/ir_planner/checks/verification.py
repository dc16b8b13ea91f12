"""What holds along a trajectory, for every instant of its interpolant: limits by exact extremes of
the polynomials, torque by guaranteed bounds, clearance by a certificate. The first violation of
every kind is named with place, limit and excess.
"""

from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks.clearance_checks import clearance_violation
from ir_planner.checks.limit_checks import (
    SLACK,
    Violation,
    jump_violation,
    position_violation,
    rest_violation,
    segment_at,
    share_violation,
)
from ir_planner.curves import extremes
from ir_planner.scene import PlanningScene, torque_use


@dataclass(frozen=True, eq=False)
class Verification:
    """violation: the first one, None: everything is proved; others: the first of every other kind,
    in the order of their times. Largest used shares of the limits, each (n,).
    """

    violation: Violation | None
    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray
    torque: FloatArray
    travel: FloatArray
    others: tuple[Violation, ...] = ()

    @property
    def certified(self) -> bool:
        """Clearance and limits proved for every instant."""
        return self.violation is None

    @property
    def keeps_clear(self) -> bool:
        """Every pair proved to keep its distance at every instant, whatever the limits."""
        found = (self.violation, *self.others)
        return all(violation is None or violation.what != "clearance" for violation in found)

    @property
    def status(self) -> Status:
        """SUCCESS, or INVALID_MOTION_PLAN with the first violation and, after "also:", the other
        kinds: a small one at the start hides no collision.
        """
        if self.violation is None:
            return Status.success()
        also = "; ".join(other.sentence for other in self.others)
        sentence = f"{self.violation.sentence}; also: {also}" if also else self.violation.sentence
        return Status(StatusCode.INVALID_MOTION_PLAN, sentence)


@dataclass(frozen=True, eq=False)
class TorqueProof:
    """upper (n,): guaranteed bound of the share of the torque envelope that is used; the violation
    where it exceeds what may be used.
    """

    upper: FloatArray
    violation: Violation | None


def verify(
    trajectory: JointTrajectory, scene: PlanningScene, safety_distance: float, station: str = ""
) -> Verification:
    """Check a trajectory against the robot's limits and S_m (or what `station` allows its
    pairs).
    """
    clearance = clearance_violation(trajectory, scene, safety_distance, station)
    return verified(trajectory, scene, clearance, torque_proof(trajectory, scene))


def verified(
    trajectory: JointTrajectory,
    scene: PlanningScene,
    clearance: Violation | None,
    torque: TorqueProof,
) -> Verification:
    """The verification of a trajectory whose clearance and torque have been examined."""
    largest = extremes(*trajectory.coefficients())
    robot = scene.cell.robot
    limits = scene.limits
    share = {
        "velocity": largest.velocity / limits.velocity,
        "acceleration": largest.acceleration / limits.acceleration,
        "jerk": largest.jerk / limits.jerk,
    }
    found = [
        position_violation(trajectory, largest, scene),
        rest_violation(trajectory, scene),
        jump_violation(trajectory, robot.joint_names),
        torque.violation,
        *(
            share_violation(name, values, trajectory, robot.joint_names)
            for name, values in share.items()
        ),
        clearance,
    ]
    violations = sorted((v for v in found if v is not None), key=lambda violation: violation.time)
    top = {name: values.max(axis=0, initial=0.0) for name, values in share.items()}
    return Verification(
        violations[0] if violations else None,
        top["velocity"],
        top["acceleration"],
        top["jerk"],
        torque.upper,
        largest.travel.sum(axis=0),
        tuple(violations[1:]),
    )


def torque_proof(
    trajectory: JointTrajectory, scene: PlanningScene, most: float = 1.0
) -> TorqueProof:
    """Bounds of the torque that a trajectory needs; `most`: the share of the envelope that it may
    use.
    """
    coefficients, durations = trajectory.coefficients()
    if len(durations) == 0:
        rest = np.zeros_like(trajectory.positions)
        return TorqueProof(
            torque_use(scene.dynamics, trajectory.positions, rest, rest).max(axis=0), None
        )
    bounds = scene.dynamics.torque_bounds(coefficients, durations)
    upper = np.asarray(bounds.upper)
    if upper.max() <= most + SLACK:
        return TorqueProof(upper, None)
    j = int(np.argmax(upper))
    time = float(trajectory.times[0]) + float(bounds.time[j])
    k = segment_at(trajectory, time)
    sentence = (
        f"{scene.cell.robot.joint_names[j]} needs {bounds.sampled[j]:.3f} (at most "
        f"{upper[j]:.3f}) times its torque limit after waypoint {k} at {time:.3f} s: it must be "
        f"at most {most:g} (excess {100.0 * (upper[j] - most):.1f} %)"
    )
    return TorqueProof(upper, Violation(time, k, "torque", float(upper[j] - most), sentence))
