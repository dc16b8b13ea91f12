"""Proof of clearance along a trajectory: no instant between samples is left out.

At a station its allowed contacts hold while the tcp is in the machine's zone; outside every pair
keeps S_m.
"""

from ir_kernels.collision import COLLIDES, FREE
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks.clearance import pair_value
from ir_planner.checks.limit_checks import Violation, segment_at
from ir_planner.scene import (
    PROOF_TOLERANCE,
    PlanningScene,
    polynomials_between,
    spans_outside,
    tcp_inside,
)


def clearance_violation(
    trajectory: JointTrajectory, scene: PlanningScene, safety_distance: float, station: str = ""
) -> Violation | None:
    """The first instant at which a pair is too near, or not proved to be far enough; None:
    proved.
    """
    plain = scene.thresholds(safety_distance) - PROOF_TOLERANCE
    if len(trajectory.times_ns) == 1:
        return _of_point(trajectory, scene, safety_distance, station)
    begin = float(trajectory.times[0])
    end = float(trajectory.times[-1])
    if not station or not scene.allowed(station).any():
        return _of_part(trajectory, (begin, end), plain, scene, "")
    relaxed = scene.thresholds(safety_distance, station) - PROOF_TOLERANCE
    outside = spans_outside(trajectory, scene, station, safety_distance)
    found = [
        _of_part(trajectory, (begin, end), relaxed, scene, station),
        *(_of_part(trajectory, span, plain, scene, "") for span in outside),
    ]
    violations = [violation for violation in found if violation is not None]
    return min(violations, key=lambda violation: violation.time) if violations else None


def _of_part(
    trajectory: JointTrajectory,
    span: tuple[float, float],
    threshold: FloatArray,
    scene: PlanningScene,
    station: str,
) -> Violation | None:
    coefficients, durations = polynomials_between(trajectory, *span)
    if len(durations) == 0:
        return None
    found = scene.collision.certify_trajectory(coefficients, durations, threshold)
    if found.verdict == FREE:
        return None
    first, last = (span[0] + t for t in found.interval)
    q = trajectory.sample([last]).q[0]
    return _violation(
        trajectory, q, (first, last), found.verdict, found.pair, threshold, scene, station
    )


def _of_point(
    trajectory: JointTrajectory, scene: PlanningScene, safety_distance: float, station: str
) -> Violation | None:
    q = trajectory.positions
    inside = bool(station) and bool(tcp_inside(q, scene, station, safety_distance)[0])
    where = station if inside else ""
    threshold = scene.thresholds(safety_distance, where) - PROOF_TOLERANCE
    near = scene.collision.min_distance(q, threshold)
    z = int(near.pair[0])
    if z < 0 or near.distance[0] > threshold[z]:
        return None
    time = float(trajectory.times[0])
    return _violation(trajectory, q[0], (time, time), COLLIDES, z, threshold, scene, where)


def _violation(
    trajectory: JointTrajectory,
    q: FloatArray,
    interval: tuple[float, float],
    verdict: int,
    z: int,
    threshold: FloatArray,
    scene: PlanningScene,
    station: str,
) -> Violation:
    pair = pair_value(scene, q, z, bool(scene.allowed(station)[z]))
    kept = float(threshold[z]) + PROOF_TOLERANCE
    excess = kept - pair.distance
    k = segment_at(trajectory, interval[1])
    come = "come to" if verdict == COLLIDES else "can't be proved to stay apart, they are at"
    sentence = (
        f"{pair.body_a} and {pair.body_b} ({pair.kind}) {come} {pair.distance * 1e3:.1f} mm "
        f"after waypoint {k} at {interval[1]:.3f} s: they must stay {kept * 1e3:.1f} mm apart "
        f"(excess {excess * 1e3:.1f} mm)"
    )
    return Violation(interval[0], k, "clearance", excess, sentence, pair)
