"""Verification of a trajectory at every instant of its interpolant: limits by exact extremes of the
polynomials, torque by guaranteed bounds, clearance by a certificate. The first violation of
every kind is named with place, limit and excess.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ir_kernels import portable
from ir_kernels.collision import COLLIDES, FREE
from ir_msgs_py.report import DistancePair
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks.distances import pair_value
from ir_planner.checks.tool_motion import ToolUse
from ir_planner.curves import Extremes, extremes
from ir_planner.presentation import in_mm, told_apart
from ir_planner.scene import (
    PROOF_TOLERANCE,
    PlanningScene,
    Stops,
    ToolBounds,
    ToolCone,
    polynomials_between,
    spans_outside,
    tcp_inside,
    torque_use,
)
from ir_values.arrays import FloatArray

SLACK = 1e-6  # relative: what rounding of a limit that is reached exactly may cost
POSITION_SLACK = 1e-9  # rad
JUMP = 1e-4  # rad/s, rad/s^2: rounding of times and points
AT_REST = 1e-6  # rad/s and rad/s^2 that count as rest
TILT = "tilt"  # what a violation of the tool's cone is called


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
        low = trajectory.positions
        high = low
    excess = np.maximum(low * -1.0 + robot.position_min, high - robot.position_max)
    beyond = np.argwhere(excess > POSITION_SLACK)
    if len(beyond) == 0:
        return None
    k, j = (int(i) for i in beyond[0])
    reached = low[k, j] if robot.position_min[j] - low[k, j] > POSITION_SLACK else high[k, j]
    sentence = (
        f"{robot.joint_names[j]} reaches {robot.shown(j, reached)} after waypoint {k}: it must be "
        f"in {robot.shown_range(j)} (excess {robot.shown(j, excess[k, j], 3)})"
    )
    return Violation(float(trajectory.times[k]), k, "position", float(excess[k, j]), sentence)


AtRest = tuple[bool, bool]
"""Whether a movement must start and end at rest: not where it is a part of another."""


def rest_violation(
    trajectory: JointTrajectory, scene: PlanningScene, at_rest: AtRest = (True, True)
) -> Violation | None:
    """Where the movement does not start or end at rest."""
    ends = trajectory.sample(trajectory.times[[0, -1]])
    names = scene.cell.robot.joint_names
    coefficients, durations = trajectory.coefficients()
    if len(durations) == 0:
        return None
    first = (coefficients[0, :, 1], 2.0 * coefficients[0, :, 2])
    final = (ends.qd[-1], ends.qdd[-1])
    for (speed, acceleration), k, needed in (
        (first, 0, at_rest[0]),
        (final, len(durations), at_rest[1]),
    ):
        if not needed:
            continue
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


def tool_violation(use: ToolUse) -> Violation | None:
    """Where the tool is faster than it may be, or can't be proved to be slower."""
    first: Violation | None = None
    for name, value, bounds in use.asked:
        for what, most, sampled, limit, unit in (
            ("speed", value.speed, value.found_speed, bounds.speed, "m/s"),
            (
                "acceleration",
                value.acceleration,
                value.found_acceleration,
                bounds.acceleration,
                "m/s^2",
            ),
        ):
            beyond = np.flatnonzero(most > limit * (1.0 + SLACK))
            if len(beyond) == 0 or (first is not None and first.waypoint <= beyond[0]):
                continue
            k = int(beyond[0])
            sentence = (
                f"the {what} of {name} comes to {sampled[k]:.6g} {unit} (at most {most[k]:.6g}) "
                f"after waypoint {k}: it must be at most {limit:g} {unit} "
                f"(excess {100.0 * (most[k] / limit - 1.0):.2g} %)"
            )
            time = float(use.trajectory.times[k])
            first = Violation(time, k, f"tool {what}", float(most[k] - limit), sentence)
    return first


# The proof of clearance leaves out no instant between samples. At a station its allowed contacts
# hold while the tcp is in the machine's zone; outside every pair keeps S_m.


def clearance_violation(
    trajectory: JointTrajectory, scene: PlanningScene, safety_distance: float, station: Stops = ""
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
    if not isinstance(station, str):
        return _earliest_violation(_of_hop(trajectory, scene, safety_distance, station))
    relaxed = scene.thresholds(safety_distance, station) - PROOF_TOLERANCE
    outside = spans_outside(trajectory, scene, station, safety_distance)
    found = [
        _of_part(trajectory, (begin, end), relaxed, scene, station),
        *(_of_part(trajectory, span, plain, scene, "") for span in outside),
    ]
    return _earliest_violation(found)


def _of_hop(
    trajectory: JointTrajectory, scene: PlanningScene, margin: float, stations: tuple[str, ...]
) -> list[Violation | None]:
    """What is wrong between several stations: the trajectory is cut where the tcp leaves or enters
    a zone; between two cuts the contacts of those stations hold whose zone it is in.
    """
    outside = {station: spans_outside(trajectory, scene, station, margin) for station in stations}
    cuts = {float(trajectory.times[0]), float(trajectory.times[-1])}
    cuts |= {at for spans in outside.values() for span in spans for at in span}
    spans_of_hop = []
    for begin, end in pairwise(sorted(cuts)):
        there = tuple(
            station
            for station, spans in outside.items()
            if not any(left <= begin and end <= right for left, right in spans)
        )
        threshold = scene.thresholds(margin, there) - PROOF_TOLERANCE
        spans_of_hop.append(_of_part(trajectory, (begin, end), threshold, scene, there))
    return spans_of_hop


def _earliest_violation(found: Sequence[Violation | None]) -> Violation | None:
    violations = [violation for violation in found if violation is not None]
    return min(violations, key=lambda violation: violation.time) if violations else None


def _of_part(
    trajectory: JointTrajectory,
    span: tuple[float, float],
    threshold: FloatArray,
    scene: PlanningScene,
    station: Stops,
) -> Violation | None:
    """The first pair that is not proved free within a span [s] of the trajectory; None: all are."""
    coefficients, durations = polynomials_between(trajectory, *span)
    if len(durations) == 0:
        return None
    certificate = scene.collision.certify_trajectory(coefficients, durations, threshold)
    if certificate.verdict == FREE:
        return None
    first, last = (span[0] + t for t in certificate.interval)
    q = trajectory.sample([last]).q[0]
    return _violation(
        trajectory,
        q,
        (first, last),
        certificate.verdict,
        certificate.pair,
        threshold,
        scene,
        station,
    )


def _of_point(
    trajectory: JointTrajectory, scene: PlanningScene, safety_distance: float, station: Stops
) -> Violation | None:
    q = trajectory.positions
    named = (station,) if isinstance(station, str) else station
    where = tuple(
        one for one in named if one and bool(tcp_inside(q, scene, one, safety_distance)[0])
    )
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
    station: Stops,
) -> Violation:
    """A pair that comes too near within an interval [s], measured at configuration q (n,) at its
    end; z: number of the pair, threshold (Z,) m.
    """
    pair = pair_value(scene, q, z, bool(scene.own_distance(station)[z]))
    needed = float(threshold[z]) + PROOF_TOLERANCE
    excess = needed - pair.distance
    k = segment_at(trajectory, interval[1])
    distance, bound = in_mm(pair.distance, needed)
    come = "come to" if verdict == COLLIDES else "can't be proved to stay apart, they are at"
    sentence = (
        f"{pair.body_a} and {pair.body_b} ({pair.kind}) {come} {distance} mm "
        f"after waypoint {k} at {interval[1]:.3f} s: they must stay {bound} mm apart "
        f"(excess {in_mm(excess, 0.0)[0]} mm)"
    )
    return Violation(interval[0], k, "clearance", excess, sentence, pair)


def tilt_violation(trajectory: JointTrajectory, cone: ToolCone | None) -> Violation | None:
    """The first part of a trajectory on which the tool leans too far, or isn't proved not to; None:
    proved, or nothing is asked.
    """
    if cone is None:
        return None
    coefficients, durations = polynomials_between(
        trajectory, float(trajectory.times[0]), float(trajectory.times[-1])
    )
    if len(durations) == 0:
        coefficients = trajectory.positions[:, :, None]
        durations = np.zeros(1)
    proof = cone.proof(coefficients, durations)
    if proof.ok.all():
        return None
    k = int(np.argmin(proof.ok))
    time = float(trajectory.times[0] + durations[:k].sum() + proof.time[k])
    tilt = float(cone.tilts(trajectory.sample([time]).q)[0])
    sentence = leans(tilt, cone, f"at {time:.3f} s")
    return Violation(time, segment_at(trajectory, time), TILT, tilt - cone.most, sentence)


def leans(tilt: float, cone: ToolCone, where: str) -> str:
    """The sentence for a tilt [rad] that is too large, or isn't proved not to be."""
    value, bound = told_apart(np.degrees(tilt), np.degrees(cone.most))
    axis, direction = (", ".join(f"{x:.4g}" for x in of) for of in (cone.axis, cone.direction))
    what = "leans" if tilt > cone.most else "can't be proved to lean less than it may, it leans"
    return (
        f"the tool's axis ({axis}) {what} {value} deg from ({direction}) {where}: it must be at "
        f"most {bound} deg"
    )


@dataclass(frozen=True, eq=False)
class Verification:
    """violation: the first one, None: everything is proved; others: the first of every other kind,
    in the order of their times. Largest used shares of the limits, each (n,). use: how fast the
    tool is.
    """

    violation: Violation | None
    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray
    torque: FloatArray
    travel: FloatArray
    others: tuple[Violation, ...]
    use: ToolUse

    @cached_property
    def tool_motion(self) -> tuple[float, float]:
        """Bounds of speed [m/s] and acceleration [m/s^2] at the tcp; of every point of tool and
        part where those are limited. Found when they are asked for: of most movements nobody does.
        """
        return (self.use.whole if self.use.bounds.whole.asked else self.use.tcp).most()

    @property
    def certified(self) -> bool:
        """Clearance and limits proved for every instant."""
        return self.violation is None

    @property
    def keeps_clear(self) -> bool:
        """Every pair proved to keep its distance at every instant, whatever the limits."""
        return not self.breaks("clearance")

    def breaks(self, what: str) -> bool:
        """Whether one of the violations is of this kind."""
        found = (self.violation, *self.others)
        return any(violation is not None and violation.what == what for violation in found)

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


class TorqueProof(NamedTuple):
    """upper (n,): guaranteed bound of the share of the torque envelope that is used; the violation
    where it exceeds what may be used.
    """

    upper: FloatArray
    violation: Violation | None


def verify(
    trajectory: JointTrajectory,
    scene: PlanningScene,
    safety_distance: float,
    station: Stops = "",
    at_rest: AtRest = (True, True),
    cone: ToolCone | None = None,
    tool: ToolBounds | None = None,
) -> Verification:
    """Check a trajectory against the robot's limits, those of the tool, S_m (or what `station`
    allows its pairs), and the cone in which the tool has to stay.
    """
    clearance = clearance_violation(trajectory, scene, safety_distance, station)
    torque = torque_proof(trajectory, scene)
    tilt = tilt_violation(trajectory, cone)
    return verified(trajectory, scene, clearance, torque, at_rest, tilt, tool)


def verified(
    trajectory: JointTrajectory,
    scene: PlanningScene,
    clearance: Violation | None,
    torque: TorqueProof,
    at_rest: AtRest = (True, True),
    tilt: Violation | None = None,
    tool: ToolBounds | None = None,
) -> Verification:
    """The verification of a trajectory whose clearance, torque and tilt have been examined; tool:
    None: what the loads let it do.
    """
    largest = extremes(*trajectory.coefficients())
    robot = scene.cell.robot
    limits = scene.limits
    use = ToolUse(trajectory, scene, limits.tool if tool is None else tool, largest)
    share = {
        "velocity": largest.velocity / limits.velocity,
        "acceleration": largest.acceleration / limits.acceleration,
        "jerk": largest.jerk / limits.jerk,
    }
    found = [
        position_violation(trajectory, largest, scene),
        rest_violation(trajectory, scene, at_rest),
        jump_violation(trajectory, robot.joint_names),
        torque.violation,
        tool_violation(use),
        *(
            share_violation(name, values, trajectory, robot.joint_names)
            for name, values in share.items()
        ),
        clearance,
        tilt,
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
        use,
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
