"""Splines: blocks of several parts driven without a stop, and their motions of the tool."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ir_kernels import portable
from ir_krl import KrlMotionError, Motion
from ir_krl.run import Blend, Speeds, SplineBlock, Target, TimeBlock
from ir_msgs_py.cartesian import (
    CIRCLE,
    LINE,
    POSES_MAX,
    SPEED_MAX,
    SPEED_MIN,
    SPLINE,
    CartesianSegment,
)
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.cartesian import Line
from ir_planner.curves import RotationSpline, turn_of, turned_evenly
from ir_planner.krl.blended_motions import AxisCurve, drawn_from, followed, through_axes, tool_ends
from ir_planner.krl.geometry import Arm, tool_in_flange
from ir_planner.scene import PlanningScene, torque_use
from ir_planner.timing import GRID_NS, GRID_S
from ir_values.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

# When a PTP_SPLINE passes its points: near the planned times as far as the limits allow.
#
# A spline through points of a planned movement overshoots where the plan's jerk steps from one
# limit to the other, so that at the planned times it exceeds them. A sequence of linear programs
# changes the times between points, by a piecewise linear slowness over the movement: within the
# limits, not longer than planned where that can be, with the least changes.

_DEGREE = 5
_KNOTS_MAX = 32  # of the slowness
_PER_INTERVAL = 6  # samples between two points, where limits are looked at
_ROUNDS = 12
_TRUST = (0.1, 0.002)  # of the logarithm of the slowness in one round: at first, at least
_NEAR = 0.7  # of a limit: samples below take no part in a linear program
_USED = 0.996  # of a limit at samples: between them a little more is needed
_STEP = 1e-5  # of a difference quotient
_MISSED = 100.0  # cost of what exceeds a limit, in durations: far above what it could save
_CHANGED = 0.01  # cost of a slowness on average: small, so that durations decide


def resting_spline(times: FloatArray, points: FloatArray) -> BSpline:
    """The spline of degree five through points (M, n) at times (M,) s, at rest at both ends."""
    still = np.zeros(points.shape[1])
    rest = (still, still)
    return portable.interpolating_spline(times, points, _DEGREE, ends=(rest, rest))


@dataclass(frozen=True, eq=False)
class _Problem:
    """points (M + 1, n) at times that follow from steps (M,) s and what basis (M, K) makes of a
    slowness.
    """

    points: FloatArray
    steps: FloatArray
    basis: FloatArray
    scene: PlanningScene

    def lasting(self, slowness: FloatArray) -> FloatArray:
        """Seconds (M,) between points, with a logarithm of the slowness (K,)."""
        return np.asarray(self.steps * portable.exp(portable.matmul(self.basis, slowness)))

    def used(self, slowness: FloatArray) -> FloatArray:
        """Shares (R,) of the limits at samples."""
        lasting = self.lasting(slowness)
        times = np.concatenate([[0.0], np.cumsum(lasting)])
        spline = resting_spline(times, self.points)
        inner = (np.arange(_PER_INTERVAL) / _PER_INTERVAL)[None, :] * lasting[:, None]
        at = np.append((times[:-1, None] + inner).ravel(), times[-1])
        q, qd, qdd, qddd = (np.asarray(spline(at, nu=k)) for k in range(4))
        limits = self.scene.limits
        torque = torque_use(self.scene.dynamics, q, qd, qdd) / limits.torque_share
        shares = (qd / limits.velocity, qdd / limits.acceleration, qddd / limits.jerk, torque)
        return np.concatenate([np.abs(share).ravel() for share in shares])


def passing_times(points: FloatArray, times: FloatArray, scene: PlanningScene) -> FloatArray:
    """Times (M,) s at which points (M, n) are passed within the limits, from those that were
    planned.
    """
    steps = np.diff(times)
    problem = _Problem(points, steps, _hats(len(steps)), scene)
    slowness = np.zeros(problem.basis.shape[1])
    used = problem.used(slowness)
    trust = _TRUST[0]
    for _ in range(_ROUNDS):
        change = _change(problem, slowness, used, trust)
        trial = problem.used(slowness + change)
        if _cost(problem, slowness + change, trial) < _cost(problem, slowness, used):
            slowness = slowness + change
            used = trial
            if np.abs(change).max() < _TRUST[1]:
                break
        else:
            trust *= 0.3
            if trust < _TRUST[1]:
                break
    return np.concatenate([times[:1], times[0] + np.cumsum(problem.lasting(slowness))])


def _cost(problem: _Problem, slowness: FloatArray, used: FloatArray) -> float:
    longer = problem.lasting(slowness).sum() / problem.steps.sum() - 1.0
    changed = _CHANGED * float(np.abs(slowness).mean())
    return float(max(longer, 0.0) + changed + _MISSED * max(used.max() - _USED, 0.0))


def _change(problem: _Problem, slowness: FloatArray, used: FloatArray, trust: float) -> FloatArray:
    """The change (K,) of the slowness that a linear program finds, at most `trust` each.

    Its variables are the change, the sizes of the slowness, what limits are exceeded by, and by
    what share the movement is longer than planned.
    """
    from scipy.optimize import linprog  # half a second of imports, for who needs a schedule

    rows = np.flatnonzero(used > _NEAR)
    count = len(slowness)
    slopes = np.empty((len(rows), count))
    for k, beside in enumerate(slowness + _STEP * np.eye(count)):
        slopes[:, k] = (problem.used(beside)[rows] - used[rows]) / _STEP
    planned = problem.steps.sum()
    lasting = problem.lasting(slowness)

    # limits are kept to first order, or exceeded by what costs most
    limits = np.column_stack(
        [slopes, np.zeros_like(slopes), -np.ones(len(rows)), np.zeros(len(rows))]
    )
    by_change = portable.matmul(lasting, problem.basis) / planned
    longer = np.concatenate([by_change, np.zeros(count), [0.0, -1.0]])
    # the size of the slowness is at least itself and its negative
    one = np.eye(count)
    none = np.zeros((count, 1))
    above = np.column_stack([1.0 * one, -one, none, none])
    below = np.column_stack([-1.0 * one, -one, none, none])
    costs = np.concatenate([np.zeros(count), np.full(count, _CHANGED / count), [_MISSED, 1.0]])
    exceeded = [1.0 - lasting.sum() / planned]
    found = linprog(
        costs,
        A_ub=np.vstack([limits, longer, above, below]),
        b_ub=np.concatenate([_USED - used[rows], exceeded, -slowness, slowness]),
        bounds=[*[(-trust, trust)] * count, *[(0.0, None)] * (count + 2)],
        method="highs",
    )
    return np.zeros(count) if found.x is None else np.asarray(found.x[:count])


def _hats(intervals: int) -> FloatArray:
    """What each of at most _KNOTS_MAX knots contributes to each interval (M, K)."""
    knots = np.linspace(0.0, 1.0, min(intervals, _KNOTS_MAX))
    middle = (np.arange(intervals) + 0.5) / intervals
    if len(knots) == intervals:
        return np.eye(intervals)
    return np.column_stack([np.interp(middle, knots, one) for one in np.eye(len(knots))])


# Spline blocks: several parts driven through without a stop.
#
# Assumptions, where KUKA publishes no formula: a PTP_SPLINE is the interpolating spline of degree
# five through its points; with one TIME_BLOCK over all of its parts it passes them at the marked
# times, at rest at both ends. A SPLINE is the same of the tool, straight between the ends of its
# SLIN parts and round along its SCIRC parts as far as a spline through their points is, at the
# speeds of its first part.

_LINE_POINTS = 9  # of an SLIN part, so that the spline through them is straight
# between points of an SCIRC part: the spline leaves the arc by 1e-6 of its radius
_ARC_STEP = np.radians(5.0)
_STEP_M = 4e-3
_SAMPLES_MIN = 33
_SAMPLES_MAX = 20_001
_KNOTS_PER_S = 125
_NEWTON = 4  # steps from a first guess between samples
_ROUNDING = 1e-6  # grid steps


def block_curve(block: SplineBlock, start: FloatArray, arm: Arm) -> AxisCurve:
    """The curve of a block from the configuration `start` (n,). Raises KrlMotionError."""
    if block.axis:
        return through_axes(_axis_points(block, start, arm))
    return _tool_spline(block, start, arm)


def timed_block(
    block: SplineBlock, start: FloatArray, arm: Arm
) -> tuple[JointTrajectory, FloatArray] | None:
    """The trajectory from `start` (n,) of a PTP_SPLINE whose TIME_BLOCK times all its parts, at an
    override of 100 %, and when it passes its points (parts + 1,) [s]; else None.
    """
    whole = [one for one in block.times if one.first == 0 and one.last == len(block.parts)]
    if not block.axis or len(block.times) != 1 or not whole:
        return None
    points = _axis_points(block, start, arm)
    times = _passing_times(whole[0], len(block.parts))
    if times is None:
        return None
    times = times / block.parts[0].speeds.override
    # at rest where the last point lies: the end is on the grid
    times = times * (round(times[-1] / GRID_S) * GRID_S / times[-1])
    spline = resting_spline(times, points)

    # instants of the trajectory: on the grid, evenly between two points
    counts = np.ceil(np.diff(times) * _KNOTS_PER_S).astype(int)
    between = []
    for first, last, count in zip(times[:-1], times[1:], counts, strict=True):
        between.append(np.linspace(first, last, count + 1))
    fine = np.concatenate(between)
    steps = np.unique(np.rint(fine / GRID_S)).astype(np.int64)
    seconds = steps * GRID_S
    q = np.asarray(spline(seconds, nu=0))
    qd = np.asarray(spline(seconds, nu=1))
    qdd = np.asarray(spline(seconds, nu=2))
    qd[[0, -1]] = 0.0
    qdd[[0, -1]] = 0.0
    q[0] = points[0]
    q[-1] = points[-1]
    driven = JointTrajectory(arm.scene.cell.robot.joint_names, steps * GRID_NS, q, qd, qdd)
    return driven, times


# A TIME_BLOCK over some parts, or that leaves times of points open: the spline is driven as
# without one, and each stretch between two marks is then slowed so that it lasts as long as is
# asked; at the marks it is as fast as before. Nothing gets faster, so that all limits hold.


@dataclass(frozen=True)
class TimeBlockSpan:
    """What lies between two marks of a TIME_BLOCK lasts from `begin` to `end` [s] by itself, and
    `longer` [s] than that by what is asked.
    """

    begin: float
    end: float
    longer: float


def stretches(block: SplineBlock, passed: FloatArray, override: float) -> list[TimeBlockSpan]:
    """Of all TIME_BLOCKs, where parts end at `passed` (parts + 1,) [s], 0 first, without them; what
    would have to be faster has a `longer` below 0. Raises KrlMotionError.
    """
    found = []
    for one in block.times:
        seconds = one.seconds / override
        marks = [one.first, *_marks(one)]
        for (a, b), share in zip(itertools.pairwise(marks), _shares(one), strict=True):
            own = passed[b] - passed[a]
            longer = share * seconds - own
            found.append(TimeBlockSpan(float(passed[a]), float(passed[b]), float(longer)))
    return found


def stretched(
    driven: JointTrajectory, slowed: Sequence[TimeBlockSpan], passed: FloatArray
) -> tuple[JointTrajectory, FloatArray]:
    """A movement that lasts longer in each stretch, and when it passes what it passed at `passed`
    (P,) [s].
    """
    own = np.linspace(0.0, driven.duration, max(len(driven.times_ns), 2) * _PER_INTERVAL)
    slow_own, _, _ = _slow(own, slowed)
    total = slow_own[-1]
    steps = int(np.ceil(total / GRID_S - _ROUNDING))
    scale = steps * GRID_S / total  # less than a step longer: it ends on the grid
    times = np.arange(steps + 1) * GRID_S
    count = max(round(times[-1] * _KNOTS_PER_S), 2)
    even = np.linspace(0, steps, count + 1)
    times = np.unique(np.rint(even).astype(np.int64)) * GRID_S

    # the instants of the given movement that are at these times now, by Newton's method
    wanted = times / scale
    before = np.interp(wanted, slow_own, own)
    for _ in range(_NEWTON):
        at, slope, _ = _slow(before, slowed)
        before = np.clip(before - (at - wanted) / slope, 0.0, driven.duration)
    _, slope, bend = _slow(before, slowed)
    slope = (slope * scale)[:, None]
    bend = (bend * scale)[:, None]
    found = driven.sample(before)
    qd = found.qd / slope
    qdd = (found.qdd - qd * bend) / slope**2
    grid = np.rint(times / GRID_S).astype(np.int64) * GRID_NS
    longer = JointTrajectory(driven.joint_names, grid, found.q, qd, qdd)
    slow_passed, _, _ = _slow(passed, slowed)
    return longer, slow_passed * scale


def _slow(
    times: FloatArray, slowed: Sequence[TimeBlockSpan]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Instants [s] of the stretched movement for `times` [s] of its own, and their first and second
    derivatives.
    """
    at = np.array(times)
    slope = np.ones_like(at)
    bend = np.zeros_like(at)
    for one in slowed:
        lasting = one.end - one.begin
        x = np.clip((times - one.begin) / lasting, 0.0, 1.0)
        at += one.longer * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        slope += one.longer / lasting * 30.0 * x**2 * (1.0 - x) ** 2
        bend += one.longer / lasting**2 * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)
    return at, slope, bend


def _marks(block: TimeBlock) -> list[int]:
    """Before which parts the stretches of a block end; the last one is its own end."""
    inner = [part for part, _ in block.marks]
    return inner if inner and inner[-1] == block.last else [*inner, block.last]


def _shares(block: TimeBlock) -> FloatArray:
    """Of the block's time, the share of each stretch between its marks (M,): as they are to each
    other where the last one is given too, else what is left of 100 %. Raises KrlMotionError.
    """
    marks = _marks(block)
    shares = np.array([share for _, share in block.marks])
    if len(shares) < len(marks):
        shares = np.append(shares, 100.0 - shares.sum())
    if min(shares) <= 0.0 or min(np.diff([block.first, *marks])) <= 0:
        raise KrlMotionError(
            "TIME_BLOCK PART: shares are above 0 %, each behind a part, and less than 100 % "
            "together before the last one",
            block.place,
        )
    return np.asarray(shares / shares.sum())


def _passing_times(block: TimeBlock, parts: int) -> FloatArray | None:
    """Times (parts + 1,) [s] at which the points are passed; None where marks leave some open."""
    if _marks(block) != list(range(1, parts + 1)):
        return None
    return np.concatenate([[0.0], np.cumsum(_shares(block))]) * block.seconds


def _axis_points(block: SplineBlock, start: FloatArray, arm: Arm) -> FloatArray:
    points = [start]
    for part in block.parts:
        if part.kind not in ("ptp", "spl"):
            raise KrlMotionError("a PTP_SPLINE has SPTP parts only", part.place)
        points.append(arm.reached(part.target, points[-1], part.place))
    if np.abs(np.diff(points, axis=0)).max(axis=1).min() <= 0.0:
        raise KrlMotionError("a PTP_SPLINE goes to the same place twice in a row", block.place)
    return np.array(points)


def spline_poses(block: SplineBlock, start: FloatArray, arm: Arm) -> tuple[FloatArray, list[int]]:
    """Poses (N, 4, 4) of the tool in its base that a SPLINE passes, from the configuration `start`
    (n,), and at which of them its parts end. Raises KrlMotionError.
    """
    first = block.parts[0]
    poses = [arm.tool_pose(first.target, start)]
    ends = []
    for part in block.parts:
        if part.kind == "ptp":
            raise KrlMotionError("a SPLINE has SPL, SLIN and SCIRC parts only, no SPTP", part.place)
        if (
            not np.array_equal(part.target.base, first.target.base)
            or not np.array_equal(part.target.tool, first.target.tool)
            or part.target.external != first.target.external
        ):
            raise KrlMotionError("a SPLINE keeps its tool and its base", part.place)
        poses += _part(part, poses[-1], arm)
        ends.append(len(poses) - 1)
    return np.array(poses), ends


def _part(part: Motion, now: FloatArray, arm: Arm) -> list[FloatArray]:
    """Poses (4, 4) after `now` (4, 4) that a part passes: its end, and before it what makes it
    round.
    """
    if part.kind == "spl":
        end = arm.pose(part.target, now)
        end[:3, :3] = now[:3, :3] if part.keeps_orientation else end[:3, :3]
        return [end]
    last, path = drawn_from(part, now, arm)
    count = (
        _LINE_POINTS
        if isinstance(path, Line)
        else max(int(np.ceil(abs(path.angle) / _ARC_STEP)), _LINE_POINTS)
    )
    share = np.linspace(0.0, 1.0, count + 1)[1:]
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, 3] = path.at(share * path.length)
    poses[:, :3, :3] = turned_evenly(now[:3, :3], last[:3, :3], share)
    return list(poses)


def _rails(block: SplineBlock, start: FloatArray, arm: Arm, ends: list[int]) -> FloatArray:
    """Where (N, 1) [m] a rail is at the poses of a SPLINE, evenly within each part; without a rail
    (N, 0). Raises KrlMotionError.
    """
    base = arm.scene.cell.robot.base
    places = [start[:base]]
    for part in block.parts:
        q = np.append(places[-1], start[base:])
        places.append(arm.rail_at(part.target, q, part.place))
    at = np.arange(ends[-1] + 1)
    columns = [np.interp(at, [0, *ends], column) for column in np.transpose(places)]
    return np.column_stack(columns) if columns else np.zeros((len(at), 0))


def _tool_spline(block: SplineBlock, start: FloatArray, arm: Arm) -> AxisCurve:
    """The spline of the tool through the ends of the parts, followed by the axes."""
    first = block.parts[0]
    poses, ends = spline_poses(block, start, arm)
    places = poses[:, :3, 3]
    rotations = poses[:, :3, :3]
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    if steps.min() <= 0.0:
        raise KrlMotionError("a SPLINE goes to the same place twice in a row", block.place)
    length = float(steps.sum())
    u = np.concatenate([[0.0], np.cumsum(steps)]) / length
    slid = _rails(block, start, arm, ends)
    longest = max(length, float(np.abs(np.diff(slid, axis=0)).sum()))
    samples = int(np.clip(longest / _STEP_M, _SAMPLES_MIN, _SAMPLES_MAX))
    fine = np.linspace(0.0, 1.0, samples)
    along = np.tile(np.eye(4), (samples, 1, 1))
    degree = min(3, len(u) - 1)
    curve = portable.interpolating_spline(u, places, degree)
    along[:, :3, 3] = curve(fine)
    along[:, :3, :3] = RotationSpline(u, rotations)(fine)
    rails = slid
    if slid.size:  # between two places a spline may leave the travel that both keep
        rails = portable.interpolating_spline(u, slid, degree)(fine)
        for extreme in (rails.min(axis=0), rails.max(axis=0)):
            q_there = np.append(extreme, start[len(extreme) :])
            arm.check_limits(q_there, first.target, block.place)
    q = followed(along, rails, first, start, arm)
    turning = float(turn_of(portable.matmul(rotations[0].T, rotations[-1])))
    spline = portable.interpolating_spline(fine, q, _DEGREE)
    return AxisCurve(spline, length, turning, u[ends[:-1]])


# Motions of the tool as segments of a path of the cell's tcp, with the speed that the program
# allows.

_SHORTEST = 1e-4  # m: shorter ones turn on the spot, they are no segment
_SAME_TOOL = 1e-6  # m, and of the rotation's entries
_EVEN = 1e-6  # rad: below, the orientation is constant


@dataclass(frozen=True, eq=False)
class ToolMotion:
    """Segments from `start` (4, 4) [m] of the tcp in the cell; corner [m]: how far around its end
    the tool may leave them for the next motion, 0: it passes its end exactly.
    """

    start: FloatArray
    segments: tuple[CartesianSegment, ...]
    corner: float


def tool_motion(motion: Motion, start: FloatArray, arm: Arm) -> ToolMotion | None:
    """A LIN or CIRC from the configuration `start` (n,); None for one that no segment describes: it
    turns on the spot, it leads another tool than the cell's, which turns, or its speed is out of
    bounds.

    A circle that goes on beyond half a turn is described by several arcs, of two poses each.
    """
    first, last, path = tool_ends(motion, start, arm)
    arcs = 1 if isinstance(path, Line) else max(int(np.ceil(abs(path.angle) / np.pi)), 1)
    share = np.linspace(0.0, 1.0, 2 * arcs + 1)
    poses = np.tile(np.eye(4), (len(share), 1, 1))
    poses[:, :3, 3] = path.at(share * path.length)
    poses[:, :3, :3] = turned_evenly(first[:3, :3], last[:3, :3], share)
    turning = float(turn_of(portable.matmul(first[:3, :3].T, last[:3, :3])))
    speed = _speed(motion.speeds, path.length, turning)
    if path.length < _SHORTEST or not _is_described(motion.target, turning, speed, arm):
        return None
    tcp = _in_cell(poses, motion.target, arm)
    segments = []
    if isinstance(path, Line):
        segments.append(CartesianSegment(LINE, (tcp[-1],), speed))
    else:
        for middle in range(1, 2 * arcs, 2):
            through = (tcp[middle], tcp[middle + 1])
            segments.append(CartesianSegment(CIRCLE, through, speed))
    return ToolMotion(tcp[0], tuple(segments), _corner(motion.blend, path.length))


def tool_spline(block: SplineBlock, start: FloatArray, arm: Arm) -> ToolMotion | None:
    """A SPLINE block from the configuration `start` (n,); None where no segment describes it."""
    first = block.parts[0]
    poses, _ = spline_poses(block, start, arm)
    length = float(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum())
    turns = portable.matmul(poses[:-1, :3, :3].transpose(0, 2, 1), poses[1:, :3, :3])
    turning = float(turn_of(turns).sum())
    speed = _speed(first.speeds, length, turning)
    if len(poses) > POSES_MAX or not _is_described(first.target, turning, speed, arm):
        return None
    tcp = _in_cell(poses, first.target, arm)
    segment = CartesianSegment(SPLINE, tuple(tcp[1:]), speed)
    return ToolMotion(tcp[0], (segment,), _corner(block.blend, length))


def _in_cell(poses: FloatArray, target: Target, arm: Arm) -> FloatArray:
    """The cell's tcp (N, 4, 4) where the target's tool has `poses` (N, 4, 4) in its base."""
    return arm.tcp(target.flange(poses))


def _is_described(target: Target, turning: float, speed: float, arm: Arm) -> bool:
    """Whether the cell's tcp draws what the program's tool does, at a speed that a path may
    have.
    """
    if target.external:
        return False
    own = tool_in_flange(arm.scene.chain.tcp)
    same = turning < _EVEN or float(np.abs(target.tool - own).max()) < _SAME_TOOL
    return same and SPEED_MIN <= speed <= SPEED_MAX


def _speed(speeds: Speeds, length: float, turning: float) -> float:
    """The tool's speed [m/s], no more than lets it turn as fast as it may."""
    bound = speeds.turning * length / turning if turning > 0.0 else speeds.velocity
    return min(speeds.velocity, bound) * speeds.override


def _corner(blend: Blend | None, length: float) -> float:
    if blend is None:
        return 0.0
    return min(blend.distance, 0.5 * blend.share * length)
