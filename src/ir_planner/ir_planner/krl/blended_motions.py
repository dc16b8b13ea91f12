"""Motions as curves of the axes with their time laws, one by one or blended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ir_kernels import portable
from ir_krl import KrlMotionError, Motion, SourcePlace
from ir_krl.run import Blend, Effect, Note, Speeds, Target
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.cartesian import Arc, Line, arc_through
from ir_planner.curves import turn_of, turned_evenly
from ir_planner.krl.geometry import Arm
from ir_planner.scene import STILL, MotionLimits, PlanningScene, torque_use
from ir_planner.timing import GRID_NS, GRID_S, TimeLaw, free_law
from ir_values.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

# What motions draw: straight lines of the axes, and lines, arcs and splines of the tool as joint
# curves.

_STEP_M = 4e-3  # between samples of a tool path
_STEP_RAD = np.radians(1.0)
_SAMPLES_MIN = 17
_SAMPLES_MAX = 20_001
_JUMP = np.radians(20.0)  # of an axis between samples: the path passes a singularity
_DEGREE = 5
_RAIL_SAME = 1e-3  # m


class AxisPath(Protocol):
    """A path of the axes over s in [0, 1]."""

    @property
    def length(self) -> float:
        """Of the tool's path [m]; 0 where nothing bounds the tool."""

    @property
    def turning(self) -> float:
        """Of the tool along the path [rad]."""

    @property
    def marks(self) -> FloatArray:
        """s (P - 1,) at which the parts of a spline end, but for the last."""

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """q and its first three derivatives by s, (M, n) each, at s (M,)."""


@dataclass(frozen=True, eq=False)
class AxisLine:
    """A PTP: from start to end (n,) [rad]."""

    start: FloatArray
    end: FloatArray
    length: float = 0.0
    turning: float = 0.0
    marks: FloatArray = field(default_factory=lambda: np.zeros(0))

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """q and its first three derivatives by s, (M, n) each, at s (M,)."""
        step = np.broadcast_to(self.end - self.start, (len(s), len(self.start)))
        none = np.zeros_like(step)
        return self.start + s[:, None] * step, step, none, none


@dataclass(frozen=True, eq=False)
class AxisCurve:
    """Axes as a spline over s."""

    spline: BSpline
    length: float
    turning: float
    marks: FloatArray = field(default_factory=lambda: np.zeros(0))

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """q and its first three derivatives by s, (M, n) each, at s (M,)."""
        q, first, second, third = (np.asarray(self.spline(s, nu=k)) for k in range(4))
        return q, first, second, third


def through_axes(points: FloatArray) -> AxisCurve:
    """The spline of the axes through points (M, n), spaced by their distance."""
    steps = np.abs(np.diff(points, axis=0)).max(axis=1)
    u = np.concatenate([[0.0], np.cumsum(np.maximum(steps, 1e-9))])
    u /= u[-1]
    spline = portable.interpolating_spline(u, points, min(_DEGREE, len(points) - 1))
    return AxisCurve(spline, 0.0, 0.0, u[1:-1])


def tool_ends(
    motion: Motion, start: FloatArray, arm: Arm
) -> tuple[FloatArray, FloatArray, Arc | Line]:
    """Where a LIN or CIRC from the configuration `start` (n,) begins and ends, poses (4, 4) of its
    tool in its base, and the places between. Raises KrlMotionError.
    """
    first = arm.tool_pose(motion.target, start)
    last, path = drawn_from(motion, first, arm)
    return first, last, path


def drawn_from(motion: Motion, first: FloatArray, arm: Arm) -> tuple[FloatArray, Arc | Line]:
    """The same from a pose (4, 4) of its tool in its base: where it ends, and the places
    between.
    """
    last = arm.pose(motion.target, first)
    if motion.keeps_orientation:
        last[:3, :3] = first[:3, :3]
    if motion.via is None:
        return last, Line(first[:3, 3], last[:3, 3])
    places = (first[:3, 3], arm.pose(motion.via, first)[:3, 3], last[:3, 3])
    arc = arc_through(*places, motion.angle)
    if arc is None:
        raise KrlMotionError("CIRC: start, auxiliary point and end lie on a line", motion.place)
    if motion.spline and motion.angle is not None:  # the programmed end has its orientation there
        programmed = arc_through(*places)
        assert programmed is not None  # as the arc to the angle
        last[:3, :3] = _turned_on(first, last, motion.angle / programmed.angle, motion)
    return last, arc


def _turned_on(first: FloatArray, last: FloatArray, share: float, motion: Motion) -> FloatArray:
    """The rotation (3, 3) at a share of the turn between two poses (4, 4). Raises KrlMotionError
    where that is no shortest turn.
    """
    turning = abs(share) * float(turn_of(portable.matmul(first[:3, :3].T, last[:3, :3])))
    if turning > np.pi:
        raise KrlMotionError(
            f"{_name(motion)}: up to its angle the tool turns by {np.degrees(turning):.0f} deg; at "
            "most 180 are read, write two circles",
            motion.place,
        )
    return np.asarray(turned_evenly(first[:3, :3], last[:3, :3], np.array([share]))[0])


def tool_curve(motion: Motion, start: FloatArray, arm: Arm) -> AxisCurve:
    """A LIN or CIRC from the configuration `start` (n,). Raises KrlMotionError."""
    first, last, path = tool_ends(motion, start, arm)
    turning = float(turn_of(portable.matmul(first[:3, :3].T, last[:3, :3])))
    slid = arm.rail_at(motion.target, start, motion.place) - start[: arm.scene.cell.robot.base]
    _note_auxiliary(motion, start[: len(slid)], slid, arm)
    longest = max(path.length, float(np.abs(slid).max(initial=0.0)))
    fine = np.ceil(max(longest / _STEP_M, turning / _STEP_RAD)) + 1
    u = np.linspace(0.0, 1.0, int(np.clip(fine, _SAMPLES_MIN, _SAMPLES_MAX)))
    poses = np.tile(np.eye(4), (len(u), 1, 1))
    poses[:, :3, 3] = path.at(u * path.length)
    poses[:, :3, :3] = turned_evenly(first[:3, :3], last[:3, :3], u)
    rails = start[: len(slid)] + u[:, None] * slid  # E1 moves evenly with the tool
    q = followed(poses, rails, motion, start, arm)
    return AxisCurve(portable.interpolating_spline(u, q, _DEGREE), path.length, turning)


def _note_auxiliary(motion: Motion, rail: FloatArray, slid: FloatArray, arm: Arm) -> None:
    """Note a place of the rail that only the auxiliary point of an SCIRC names: CIRC ignores it."""
    if motion.via is None or not motion.spline:
        return
    beside = motion.via.rail_after(rail) - rail
    low = np.minimum(slid, 0.0) - _RAIL_SAME
    high = np.maximum(slid, 0.0) + _RAIL_SAME
    if ((beside < low) | (beside > high)).any():
        text = "E1 of the auxiliary point isn't passed: it moves evenly to that of the end"
        arm.noted(Note(motion.place, text, Effect.PLACES))


def followed(
    poses: FloatArray, rails: FloatArray, motion: Motion, start: FloatArray, arm: Arm
) -> FloatArray:
    """Configurations (N, n) along tool poses (N, 4, 4) with the rail at (N, 1) [m], (N, 0) without
    one, each the nearest to the one before; the first is `start`. Raises KrlMotionError where the
    path leaves the reach or an axis jumps.
    """
    q = np.empty((len(poses), len(start)))
    q[0] = start
    found_along = arm.configurations(poses[1:], rails[1:], motion.target)
    for k, found in enumerate(found_along, start=1):
        where = f"{100.0 * k / (len(poses) - 1):.0f} % along"
        if len(found) == 0:
            raise KrlMotionError(
                f"{_name(motion)}: the path leaves the reach or an axis limit {where}", motion.place
            )
        nearest = arm.nearest(found, q[k - 1])
        jump = np.abs(nearest - q[k - 1])[rails.shape[1] :]
        if jump.max() > _JUMP:
            j = int(jump.argmax())
            raise KrlMotionError(
                f"{_name(motion)}: A{j + 1} would have to jump by {np.degrees(jump[j]):.0f} deg "
                f"{where}: a singularity, or an axis limit that asks for another configuration",
                motion.place,
            )
        q[k] = nearest
    return q


def _name(motion: Motion) -> str:
    return motion.kind.upper() + (f" {motion.target.name}" if motion.target.name else "")


# One motion with its law: how a controller drives a curve of the axes.
#
# Assumptions, where a data sheet says nothing: all axes follow one seven-phase law (synchronous
# PTP); axes keep their shares of the data's speed, acceleration and jerk; the tool keeps $VEL and
# $ACC, whose acceleration builds up within `RAMP` seconds; where an axis or its torque can't
# follow, the whole motion is slowed. A TIME_BLOCK slows a motion to the time it asks for.

RAMP = 0.1  # s
_KNOTS_PER_S = 125  # of a tool path, so that points between them lie on it within micrometres
_SAMPLES = 400  # of a law, where limits are looked at
_ROUNDS = 30
_CLOSE = 1.0005  # slower than asked for, so that few rounds are needed
_HUGE = 1e9
TORQUE = 0.98  # of the envelope: between samples it needs a little more


@dataclass(frozen=True, eq=False)
class Move:
    """A curve and the law that drives it; target: where it leads what."""

    curve: AxisPath
    law: TimeLaw
    target: Target

    def passing(self) -> IntArray:
        """Grid steps (P,) at which the ends of its parts are passed; the last is its end."""
        inner = np.searchsorted(self.law.at(np.arange(self.law.total + 1))[0], self.curve.marks)
        return np.append(inner, self.law.total).astype(np.int64)

    def switches(self) -> IntArray:
        """Grid steps (M,) at which a trajectory needs points, ascending."""
        if isinstance(self.curve, AxisLine):
            return self.law.switches()
        count = max(round(self.law.total * GRID_S * _KNOTS_PER_S), 2)
        spread = np.rint(np.linspace(0, self.law.total, count + 1)).astype(np.int64)
        return np.unique(np.concatenate([spread, self.law.switches()]))

    def at(self, steps: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """q, qd, qdd (M, n) at grid steps (M,); at rest before 0 and after the end."""
        q, qd, qdd, _ = self.states(steps)
        return q, qd, qdd

    def states(self, steps: IntArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """q, qd, qdd and the jerk but for the law's own, (M, n) each, at grid steps (M,)."""
        s, sd, sdd = self.law.at(steps)
        q, first, second, third = self.curve.at(s)
        sd = sd[:, None]
        sdd = sdd[:, None]
        qd = first * sd
        qdd = second * (sd * sd) + first * sdd
        return q, qd, qdd, third * portable.power(sd, 3) + 3.0 * second * sd * sdd


def move(
    curve: AxisPath,
    speeds: Speeds,
    scene: PlanningScene,
    target: Target,
    place: SourcePlace,
    *,
    least: float = 0.0,
    jerk_share: float = 1.0,
) -> Move:
    """The quickest law of a curve that keeps the speeds, lasts at least `least` s and uses
    `jerk_share` of the axes' jerk. Raises KrlMotionError.
    """
    limits = _axis_limits(speeds, scene.limits)
    limits = replace(limits, jerk=limits.jerk * jerk_share)
    bounds = _law_bounds(curve, speeds, limits)
    slower = 1.0
    for _ in range(_ROUNDS):
        v, a, j = bounds
        law = free_law((v / slower, a / (slower * slower), j / ((slower * slower) * slower)))
        made = Move(curve, law, target)
        needed = max(_excess(made, limits, scene), least / max(made.law.total * GRID_S, GRID_S))
        if needed <= 1.0 + 1e-9:
            return made
        slower *= needed * _CLOSE
    raise KrlMotionError("the drives can't carry the load along this path, however slowly", place)


def _axis_limits(speeds: Speeds, limits: MotionLimits) -> MotionLimits:
    """What the program leaves of the axes' limits."""
    rails = len(limits.velocity) - len(speeds.axis_velocity)
    share = np.array([*[speeds.external_acceleration] * rails, *speeds.axis_acceleration])
    kept = replace(
        limits,
        velocity=limits.velocity
        * np.array([*[speeds.external_velocity] * rails, *speeds.axis_velocity]),
        acceleration=limits.acceleration * share,
        jerk=limits.jerk * np.minimum(share, np.array([*[1.0] * rails, *speeds.axis_jerk])),
    )
    return kept.for_speed(speeds.override)


def _law_bounds(
    curve: AxisPath, speeds: Speeds, limits: MotionLimits
) -> tuple[float, float, float]:
    """Bounds of s' [1/s], s'' and s''' before the axes are looked at along the path."""
    _, first, _, _ = curve.at(np.linspace(0.0, 1.0, 65))
    rate = np.maximum(np.abs(first).max(axis=0), STILL)
    v, a, j = (
        float(np.min(bound / rate)) for bound in (limits.velocity, limits.acceleration, limits.jerk)
    )
    for size, speed, acceleration, jerk in (
        (curve.length, speeds.velocity, speeds.acceleration, speeds.jerk),
        (curve.turning, speeds.turning, speeds.turning_acceleration, speeds.turning_jerk),
    ):
        if size > STILL:
            v = min(v, speed * speeds.override / size)
            a = min(a, acceleration * (speeds.override * speeds.override) / size)
            j = min(
                j,
                min(acceleration / RAMP, jerk)
                * (speeds.override * speeds.override)
                * speeds.override
                / size,
            )
    return min(v, _HUGE), min(a, _HUGE), min(j, _HUGE)


def _excess(made: Move, limits: MotionLimits, scene: PlanningScene) -> float:
    """By how much the motion must last longer, at least: 1 where it keeps all limits."""
    steps = np.unique(np.rint(np.linspace(0, made.law.total, _SAMPLES)).astype(np.int64))
    q, qd, qdd, qddd = made.states(steps)
    torque = float(torque_use(scene.dynamics, q, qd, qdd).max())
    factors = [
        float((np.abs(qd) / limits.velocity).max()),
        float(np.sqrt((np.abs(qdd) / limits.acceleration).max())),
        float(portable.cbrt((np.abs(qddd) / limits.jerk).max())),
        float(np.sqrt(torque / TORQUE)),
    ]
    return max(factors)


# Moves that follow each other without a stop: the next begins while the last one brakes.
#
# As `timing.blended_steps` does for straight steps: q(t) is the sum of what the moves have covered,
# so that the arm cuts the corner. Moves that are blended have half the jerk each, so that both
# together keep the limit. How early the next may begin follows from the approximation distance:
# what is left of the one and what the other has covered stay within it, and within half of each
# move.

_HALF = 0.5
_TRIALS = 12
_NEAR_SAMPLES = 129
_SAMPLES_PER_S = 500
_ROUNDING = 1.0 + 1e-9


def overlap(before: Move, after: Move, blend: Blend, arm: Arm) -> int:
    """Grid steps that `after` may begin before `before` has ended; 0: it stops at the corner."""
    onto = blend.onto if blend.onto is not None and after.curve.length > 0.0 else blend
    left = np.arange(before.law.ramp_down + 1)
    covered = 1.0 - before.law.at(before.law.total - left)[0]
    begun = np.arange(after.law.ramp_up + 1)
    reached = after.law.at(begun)[0]
    steps = min(
        int(np.searchsorted(covered, _share(before, blend, arm, ends=True), side="right")) - 1,
        int(np.searchsorted(reached, _share(after, onto, arm, ends=False), side="right")) - 1,
    )
    scene = arm.scene
    names = scene.cell.robot.joint_names
    for _ in range(_TRIALS):
        if steps <= 0:
            return 0
        if _is_within_limits(trajectory([before, after], [steps], names), scene):
            return steps
        steps = steps * 3 // 4
    return 0


def _share(move: Move, blend: Blend, arm: Arm, *, ends: bool) -> float:
    """Of a move's s, that may lie in the blend at its end or at its beginning."""
    by_share = _HALF * blend.share
    if not blend.distance < np.inf or by_share <= 0.0:
        return by_share
    if move.curve.length > 0.0:
        return min(blend.distance / move.curve.length, by_share)
    return min(_near(move, blend.distance, arm, ends=ends), by_share)


def _near(move: Move, distance: float, arm: Arm, *, ends: bool) -> float:
    """Share of the s of an axis motion in which its tool stays within `distance` [m] of its end, or
    of its beginning.
    """
    share = np.linspace(0.0, _HALF, _NEAR_SAMPLES)
    q = move.curve.at(1.0 - share if ends else share)[0]
    places = arm.tool_poses(move.target, q)[:, :3, 3]
    away = np.linalg.norm(places - places[0], axis=1)
    beyond = np.flatnonzero(away > distance)
    if not len(beyond):
        return _HALF
    k = int(beyond[0])
    if k == 0:
        return 0.0
    part = (distance - away[k - 1]) / (away[k] - away[k - 1])
    return float(share[k - 1] + part * (share[k] - share[k - 1]))


def _is_within_limits(corner: JointTrajectory, scene: PlanningScene) -> bool:
    """Whether two moves that overlap keep the limits and the torque."""
    limits = scene.limits
    motion = corner.sample(
        np.linspace(0.0, corner.duration, max(round(corner.duration * _SAMPLES_PER_S), 2))
    )
    return bool(
        (np.abs(motion.qd) <= limits.velocity).all()
        and (np.abs(motion.qdd) <= limits.acceleration).all()
        and (np.abs(motion.qddd) <= limits.jerk * _ROUNDING).all()
        and (torque_use(scene.dynamics, motion.q, motion.qd, motion.qdd) <= TORQUE).all()
    )


def joined(
    moves: Sequence[Move], overlaps: Sequence[int]
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Grid steps (M,), and q, qd, qdd (M, n) there, of moves of which each overlaps the one
    before by some grid steps: where two overlap, their motions add up.
    """
    lasting = [move.law.total for move in moves]
    begins = [0]
    for before, overlap in zip(lasting[:-1], overlaps, strict=True):
        begins.append(begins[-1] + before - overlap)
    switches = []
    for move, begin in zip(moves, begins, strict=True):
        switches.append(move.switches() + begin)
    knots = np.unique(np.concatenate(switches))

    first_step = np.zeros(1, np.int64)
    shape = (len(knots), len(moves[0].at(first_step)[0][0]))
    q = np.zeros(shape)
    qd = np.zeros(shape)
    qdd = np.zeros(shape)
    for k, (move, begin) in enumerate(zip(moves, begins, strict=True)):
        own_q, own_qd, own_qdd = move.at(knots - begin)
        # every move but the first adds what it changes
        q += own_q - move.at(first_step)[0][0] if k else own_q
        qd += own_qd
        qdd += own_qdd
    qd[[0, -1]] = qdd[[0, -1]] = 0.0
    return knots, q, qd, qdd


def trajectory(
    moves: Sequence[Move], overlaps: Sequence[int], names: tuple[str, ...]
) -> JointTrajectory:
    """The trajectory of moves that are driven through, at rest at both ends."""
    knots, q, qd, qdd = joined(moves, overlaps)
    return JointTrajectory(names, knots * GRID_NS, q, qd, qdd)
