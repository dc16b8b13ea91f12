"""A way out for a robot that stands too near to something, in it, or beyond a limit.

It is driven slowly, in straight steps of the joints with a stop after each. On every step no pair
gets nearer than it was where the step begins, no pair that keeps its distance loses it, and no
joint goes farther beyond its limit; that is proved for every instant of what is sent. So a pair in
penetration never goes deeper, whatever the others do. The steps follow the direction in which all
pairs that are too near gain distance at once, as far as it is one.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from ir_description.robot import OUTSIDE_MAX
from ir_kernels.collision import FREE
from ir_msgs_py.report import DistancePair, PlanningInfo, TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import measured, movement_energy, pair_value, torque_proof, verified
from ir_planner.curves import extremes
from ir_planner.errors import RequestError, TimingError
from ir_planner.presentation import plot_trajectory, result_text
from ir_planner.request import Context, joint_values
from ir_planner.scene import END_TOLERANCE, PROOF_TOLERANCE, PlanningScene, polynomials_between
from ir_planner.timing import StepLaws, TimedPath, blended, fastest, slowed_for_tool
from ir_values.arrays import FloatArray

DEEPER = 1e-5  # m that a pair may get nearer within a step: what the proof of it needs
_SLOW = 0.1  # of the speeds and accelerations that the request allows
_STEPS = 80
_LENGTHS = (0.3, 0.15, 0.06, 0.02, 0.006, 0.002)  # rad of the joint that turns most
_NEAR = 0.03  # m beyond its distance that a pair counts for a direction
_SURE = 1e-4  # m more than they must keep that pairs end with
_PER_RAD = 0.5  # m that a joint's excess counts
_DRAWN = 12  # directions besides those that gradients give
_NEARING = 300  # rounds to the shortest vector between gradients
_POSITION = 1e-9  # rad
_TORQUE_SHARES = (0.95, 0.98)


@dataclass(frozen=True, eq=False)
class EscapePlan:
    """trajectory and waypoints (M, n) None unless the status is SUCCESS and there is a way to go.

    pairs: those that are too near at the start, as they are there; left (K,) m: their distances at
    the end. The report's `certified` is that of every other movement, with the safety distance at
    every instant: False here.
    """

    status: Status
    info: PlanningInfo
    report: TrajectoryReport
    trajectory: JointTrajectory | None = None
    waypoints: FloatArray | None = None
    pairs: tuple[DistancePair, ...] = ()
    left: tuple[float, ...] = ()

    def __repr__(self) -> str:
        identity = "" if self.trajectory is None else self.trajectory.trajectory_id
        return result_text("EscapePlan", self.status, self.report, identity)

    def plot(self) -> Any:
        """Angles and speeds of the joints over time; a matplotlib figure."""
        return plot_trajectory(self.trajectory, repr(self))


def plan_escape(start: FloatArray, context: Context) -> EscapePlan:
    """The way from start (n,) to where every pair keeps its distance and every joint its limits.

    Raises RequestError for a start that is no configuration, or farther than OUTSIDE_MAX beyond a
    limit; CancelledError when asked to stop.
    """
    context.journal.planner_id = "escape"
    context.journal.timing = "synchronous"
    start = _start_within(start, context.scene)
    way = _Way(context, start)
    with context.journal.stage("way out") as notes:
        points = way.found()
        notes.append(f"{len(points) - 1} steps")
    info = context.journal.info(start, context.joint_names)
    if len(points) == 1 and way.free:
        return EscapePlan(
            Status.success("the start is free and within the limits"), info, TrajectoryReport()
        )
    if way.lack(points[-1:])[0] > 0.0:
        sentence = f"no way out was found on which nothing gets nearer: {way.remaining(points[-1])}"
        return EscapePlan(Status(StatusCode.PLANNING_FAILED, sentence), info, TrajectoryReport())
    try:
        trajectory, report, wrong = _sent_steps(points, way, context)
    except TimingError as error:
        wrong = str(error)
    if wrong:
        return EscapePlan(Status(StatusCode.INVALID_MOTION_PLAN, wrong), info, TrajectoryReport())
    near = np.flatnonzero(way.distances(start[None])[0] <= way.kept)
    pairs = tuple(pair_value(context.scene, start, int(z)) for z in near)
    left = tuple(way.distances(points[-1:])[0][near].tolist())
    info = context.journal.info(start, context.joint_names)
    return EscapePlan(Status.success(), info, report, trajectory, points, pairs, left)


def _start_within(start: FloatArray, scene: PlanningScene) -> FloatArray:
    """A configuration (n,) at most OUTSIDE_MAX beyond its limits. Raises RequestError."""
    robot = scene.cell.robot
    q = joint_values(start, (robot.n,), "start", StatusCode.START_STATE_INVALID)
    excess = np.maximum(q - robot.position_max, robot.position_min - q)
    if not np.isfinite(q).all() or excess.max() > OUTSIDE_MAX:
        j = int(np.argmax(np.where(np.isfinite(excess), excess, np.inf)))
        raise RequestError(
            StatusCode.START_STATE_INVALID,
            f"start: {robot.joint_names[j]} is {robot.shown(j, q[j])}: a way out begins at most "
            f"{robot.shown(j, OUTSIDE_MAX, 2)} beyond {robot.shown_range(j)}",
        )
    return q


class _Way:
    """The search for steps: distances that have been reached are kept."""

    def __init__(self, context: Context, start: FloatArray) -> None:
        self.context = context
        self.scene = context.scene
        self.start = start
        robot = self.scene.cell.robot
        self.low = robot.position_min
        self.high = robot.position_max
        self.kept = context.thresholds()
        self._random = np.random.default_rng(context.options.seed)

    def distances(self, q: FloatArray) -> FloatArray:
        """(N, Z) m of all pairs at q (N, n)."""
        return self.scene.collision.distances(q)

    def at_least(self, reached: FloatArray) -> FloatArray:
        """Distances (Z,) m that pairs which have reached (Z,) m must not fall below any more."""
        return np.minimum(self.kept - 0.5 * PROOF_TOLERANCE, reached - DEEPER)

    def lack(self, q: FloatArray) -> FloatArray:
        """What lacks (N,) m in all at q (N, n), a joint's excess counted like a distance."""
        short = np.maximum(self.kept + _SURE - self.distances(q), 0.0)
        excess = np.maximum(np.maximum(q - self.high, self.low - q), 0.0)
        return np.asarray(short.sum(axis=1) + _PER_RAD * excess.sum(axis=1))

    def found(self) -> FloatArray:
        """Waypoints (M, n) from the start on, as far as steps lead."""
        if self.free:
            return self.start[None]
        points = [self.start]
        reached = [self.distances(self.start[None])[0]]
        lack = float(self.lack(self.start[None])[0])
        for _ in range(_STEPS):
            if lack <= 0.0 or self.context.work.exhausted:
                break
            step = self._step(points[-1], reached[-1], lack)
            if step is None:
                break
            points.append(step)
            reached.append(np.maximum(reached[-1], self.distances(step[None])[0]))
            lack = float(self.lack(step[None])[0])
        return self._fewer(np.array(points), reached)

    @property
    def free(self) -> bool:
        """Whether nothing lacks at the start."""
        within = (self.start >= self.low) & (self.start <= self.high)
        kept = self.distances(self.start[None])[0] > self.kept - END_TOLERANCE
        return bool(within.all() and kept.all())

    def _step(self, q: FloatArray, reached: FloatArray, lack: float) -> FloatArray | None:
        """The step (n,) after which least lacks, of those that are proved; None: none helps."""
        low = np.minimum(self.low, q)
        high = np.maximum(self.high, q)
        inside = np.clip(q, self.low, self.high)
        ends = [inside]
        for direction in self._directions(q):
            size = np.abs(direction).max()
            if size > 0.0:
                ends += [np.clip(q + h / size * direction, low, high) for h in _LENGTHS]
                ends += [np.clip(q + h / size * direction, self.low, self.high) for h in _LENGTHS]
        every = np.array(ends)
        bound = self.at_least(reached)
        every = every[(self.distances(every) > bound).all(axis=1)]
        if len(every) == 0:
            return None
        left = self.lack(every)
        moved = np.abs(every - q).max(axis=1)
        for k in np.lexsort((moved, left)):
            if left[k] >= lack:
                break
            if self.proved(q, every[k], bound):
                return np.asarray(every[k])
        return None

    def proved(self, q0: FloatArray, q1: FloatArray, bound: FloatArray) -> bool:
        """Whether no pair falls below its bound (Z,) m on the straight step from q0 to q1 (n,)."""
        self.context.work.spend(1)
        found = self.scene.collision.certify_edges(q0[None], q1[None], bound)
        return bool(found.verdict[0] == FREE)

    def _directions(self, q: FloatArray) -> Iterator[FloatArray]:
        """Directions (n,) in which pairs that are too near gain distance: all at once, one by one,
        drawn.
        """
        distance = self.distances(q[None])[0]
        for beyond in (0.0, _NEAR):
            near = np.flatnonzero(distance <= self.kept + _SURE + beyond)
            if len(near) == 0:
                continue
            slopes = self.scene.collision.gradients(np.tile(q, (len(near), 1)), near)
            size = np.sqrt((slopes * slopes).sum(axis=1))
            slopes = slopes[size > 1e-6] / size[size > 1e-6, None]
            if len(slopes) == 0:
                continue
            yield shortest_between(slopes)
            yield slopes.sum(axis=0)
            if beyond == 0.0:
                yield from slopes
        yield np.clip(np.array(self.scene.cell.machine_home) - q, -1.0, 1.0)
        for _ in range(_DRAWN):
            yield self._random.uniform(-1.0, 1.0, len(q))

    def _fewer(self, points: FloatArray, reached: list[FloatArray]) -> FloatArray:
        """The waypoints (M, n) without those that a proved step passes by."""
        kept = [0]
        while kept[-1] < len(points) - 1:
            here = kept[-1]
            bound = self.at_least(reached[here])
            ahead = range(len(points) - 1, here, -1)
            kept.append(
                next(
                    k for k in ahead if k == here + 1 or self.proved(points[here], points[k], bound)
                )
            )
        return points[kept]

    def remaining(self, q: FloatArray) -> str:
        """What lacks most at q (n,)."""
        distance = self.distances(q[None])[0]
        z = int(np.argmin(distance - self.kept))
        pair = self.scene.collision.pairs[z]
        return (
            f"{pair.body_a} and {pair.body_b} come to {1e3 * distance[z]:.6g} mm, they must keep "
            f"{1e3 * self.kept[z]:g} mm; move what stands there, or the robot by hand"
        )


def shortest_between(vectors: FloatArray) -> FloatArray:
    """The shortest vector (n,) of the convex hull of vectors (K, n): along it all of them gain, if
    they can. By Gilbert's steps to the vertex that lies farthest back.
    """
    point = vectors.mean(axis=0)
    for _ in range(_NEARING):
        along = (vectors * point).sum(axis=1)
        vertex = vectors[int(np.argmin(along))]
        step = vertex - point
        size = float((step * step).sum())
        if size < 1e-16:
            break
        share = float(np.clip(-(point * step).sum() / size, 0.0, 1.0))
        if share == 0.0:
            break
        point = point + share * step
    return np.asarray(point)


def _sent_steps(
    points: FloatArray, way: _Way, context: Context
) -> tuple[JointTrajectory, TrajectoryReport, str]:
    """The waypoints (M, n) in straight steps, as they are sent, and what isn't proved of them, "":
    all is. Raises TimingError where a torque doesn't suffice.
    """
    scene = context.scene
    most = 1.0 - scene.drives.torque_reserve
    for share in _TORQUE_SHARES:
        limits = context.limits.scaled(_SLOW, _SLOW).with_torque_share(share)
        laws = tuple(
            StepLaws((fastest(a, b, limits, scene.dynamics),)) for a, b in pairwise(points)
        )
        path = TimedPath(points, laws, (0,) * (len(laws) - 1))
        trajectory = slowed_for_tool(blended(path, context.joint_names), context)
        torque = torque_proof(trajectory, scene, most)
        if torque.violation is None:
            break
    lasting = np.cumsum([law.total for law in laws])
    ends = trajectory.duration * np.concatenate([[0.0], lasting / lasting[-1]])
    verification = verified(trajectory, scene, None, torque, tool=context.tool_bounds)
    found = [one for one in (verification.violation, *verification.others) if one is not None]
    wrong = [one.sentence for one in found if one.what != "position"]
    wrong += _worse(trajectory, points, ends, way)
    evaluation = measured(
        trajectory,
        scene,
        context.safety_distance,
        context.station,
        verification,
        movement_energy(trajectory, scene),
    )
    return trajectory, replace(evaluation.report, certified=False), wrong[0] if wrong else ""


def _worse(
    trajectory: JointTrajectory, points: FloatArray, ends: FloatArray, way: _Way
) -> list[str]:
    """Steps of what is sent, from ends (M,) s to the next, that aren't proved to keep what was
    reached.
    """
    found = []
    reached = np.full(len(way.kept), -np.inf)
    for k, (begin, end) in enumerate(pairwise(ends)):
        reached = np.maximum(reached, way.distances(points[k : k + 1])[0])
        part = polynomials_between(trajectory, float(begin), float(end))
        bound = way.at_least(reached) - 0.5 * PROOF_TOLERANCE
        if way.scene.collision.certify_trajectory(*part, bound).verdict != FREE:
            found.append(f"step {k} of the way out can't be proved as it is sent")
        largest = extremes(*part)
        low = np.minimum(points[k], points[k + 1]) - _POSITION
        high = np.maximum(points[k], points[k + 1]) + _POSITION
        if (largest.lowest < low).any() or (largest.highest > high).any():
            found.append(f"step {k} of the way out overshoots its ends")
    return found
