"""A path of the tool as a certified movement: the chain of configurations of least J that keeps the speed."""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import TANGENT, CartesianPath
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_planner.cartesian.answer import CartesianPlan
from ir_planner.cartesian.corners import Joint, joined
from ir_planner.cartesian.free_angle import angle_along
from ir_planner.cartesian.joint_curve import Angle, JointCurve, curve_of
from ir_planner.cartesian.layers import Chain, Layers, chains, layers_of
from ir_planner.cartesian.parts import parts_of
from ir_planner.cartesian.points import SentPath, sent
from ir_planner.cartesian.refusal import PathRefusedError
from ir_planner.cartesian.speed_law import Span
from ir_planner.cartesian.timed import timed_stroke
from ir_planner.cartesian.tool_error import Kept, kept_of
from ir_planner.cartesian.tool_path import HeadingError, ToolPath
from ir_planner.checks import FreeSpace
from ir_planner.errors import RequestError
from ir_planner.request import Context, checked_options, chosen
from ir_planner.scene import MotionLimits
from ir_planner.timing import Movement, check_duration, within_torque

PLANNER_ID = "cartesian"
T1_SPEED = 0.25  # m/s at the tcp and at the centre of the flange
TOOL_ERROR_MAX = 1e-4  # m
CANDIDATES = 3  # chains that are timed, the cheapest by the estimate first
_BLOCKED = 6  # chains that may collide between samples before the search ends
_AROUND = 0.02  # m along the path, and
_NEAR = 0.3  # rad around a configuration that collides: blocked
_SHRUNK = 0.999


@dataclass(frozen=True, eq=False)
class _Timed:
    """A chain as a movement, and what it keeps of the path."""

    movement: Movement
    sent: SentPath
    angle: Angle | None


def plan_path(path: CartesianPath, start: FloatArray | None, t1: bool, context: Context) -> CartesianPlan:
    """Plan a path from the configuration `start` (n,), None: the one of least J. t1: at most 250 mm/s.

    Raises RequestError for a request that makes no sense, CancelledError when asked to stop.
    """
    context.journal.planner_id, context.journal.timing = PLANNER_ID, "synchronous"
    try:
        return _planned(path, start, t1, context)
    except PathRefusedError as error:
        return _answer(error.status, context)
    except HeadingError as error:
        return _answer(Status(StatusCode.INVALID_MOTION_PLAN, f"orientation is {TANGENT}: {error}"), context)


def _planned(path: CartesianPath, start: FloatArray | None, t1: bool, context: Context) -> CartesianPlan:
    if t1:
        path = _at_most(path, T1_SPEED)
    with context.journal.stage("path") as notes:
        whole, joints = joined(path, parts_of(path))
        _check_corners(path, whole, joints)
        notes.append(f"{whole.length:.3f} m in {len(whole.parts)} parts")
        if (reduced := _reduced(path, whole, joints)) < path.blending_radius:
            notes.append(f"blending radius down to {reduced:.4g} m: half of a part")
    space = FreeSpace.of(context.scene, context.safety_distance, context.work)
    with context.journal.stage("configurations") as notes:
        layers = layers_of(whole, path.free_angle, space, start)
        notes.append(f"{len(layers.q)} at {len(layers.s)} samples, {int(layers.free.sum())} free")
    found = _best(path, whole, layers, t1, context)
    with context.journal.stage("tool error"):
        kept = kept_of(found.sent, whole, found.angle, context.scene)
    leaves = max((joint.leaves for joint in joints), default=0.0)
    turns = max((joint.turns for joint in joints), default=0.0)
    kept = replace(kept, tool_error=kept.tool_error + leaves, rotation_error=kept.rotation_error + turns)
    if kept.tool_error > TOOL_ERROR_MAX:
        raise PathRefusedError(
            f"the tool can't be shown to keep within {TOOL_ERROR_MAX * 1e3:g} mm of the path: "
            f"{kept.tool_error * 1e3:.3g} mm"
        )
    trajectory = found.movement.trajectory
    check_duration(trajectory.duration, context.options)
    status, info = Status.success(), context.journal.info(trajectory.positions[0], context.joint_names)
    return CartesianPlan(
        status, info, found.movement.report, trajectory, *_values(kept), whole.ends[1:], len(layers.q)
    )


def _values(kept: Kept) -> tuple[float, float, float]:
    return kept.tool_error, kept.rotation_error, kept.speed_deviation


def _answer(status: Status, context: Context) -> CartesianPlan:
    return CartesianPlan(status, context.journal.info(None, context.joint_names), TrajectoryReport())


def _at_most(path: CartesianPath, speed: float) -> CartesianPath:
    segments = tuple(replace(one, tool_speed=min(one.tool_speed, speed)) for one in path.segments)
    return replace(path, tool_speed=min(path.tool_speed, speed), segments=segments)


def _reduced(path: CartesianPath, whole: ToolPath, joints: tuple[Joint, ...]) -> float:
    """The smallest radius [m] of a corner that is rounded as asked for."""
    rounded = [joint.radius for joint in joints if joint.radius > 0.0 and joint.leaves == 0.0]
    return min(rounded, default=path.blending_radius)


def _check_corners(path: CartesianPath, whole: ToolPath, joints: tuple[Joint, ...]) -> None:
    """Raise PathRefusedError at a corner within the path where the tool would have to stop and may not."""
    for k, joint in enumerate(joints, start=1):
        before, after = whole.parts[k - 1], whole.parts[k]
        if joint.radius > 0.0 or not (before.kept and after.kept):
            continue
        corner = f"at {whole.ends[k]:.3f} m the path has a corner of {np.degrees(joint.angle):.1f} deg"
        if path.orientation == TANGENT:
            raise PathRefusedError(
                f"{corner}: a tool that turns with the path can't follow it; give a blending_radius",
                StatusCode.INVALID_MOTION_PLAN,
            )
        if path.speed_tolerance < 1.0:
            raise PathRefusedError(
                f"{corner}, where the tool can't keep {before.speed:g} m/s: give a blending_radius, or "
                f"speed_tolerance 1 to stop there (it is {path.speed_tolerance:g})",
                StatusCode.INVALID_MOTION_PLAN,
            )


def _best(path: CartesianPath, whole: ToolPath, layers: Layers, t1: bool, context: Context) -> _Timed:
    """The certified movement of least cost by the request's objective over the cheapest chains.

    Raises PathRefusedError with the reason of the cheapest one where none is certified.
    """
    reason: PathRefusedError | None = None
    for _ in range(_BLOCKED):
        context.work.check()
        with context.journal.stage("search") as notes:
            try:
                found = chains(layers, path.tool_speed, context.scene, CANDIDATES)
            except PathRefusedError as error:
                raise reason or error from error
            notes.append(f"{len(found)} chains")
        with context.journal.stage("timing") as notes:
            timed: list[_Timed] = []
            for chain in found:
                try:
                    timed.append(_timed(path, whole, chain, t1, context))
                except PathRefusedError as error:
                    context.journal.reject(str(error))
                    reason = reason or error
            notes.append(f"{len(timed)} of {len(found)} within the limits")
        if not timed:
            assert reason is not None  # each chain that isn't timed gave one
            raise reason
        with context.journal.stage("proof") as notes:
            for one in sorted(timed, key=lambda one: one.movement.coarse_cost):
                violation = one.movement.violation
                if violation is None:
                    return one
                notes.append(violation.sentence)
                reason = _uncertified(one, whole)
                layers = _without(layers, one)
    assert reason is not None  # of the last round
    raise reason


def _uncertified(one: _Timed, whole: ToolPath) -> PathRefusedError:
    violation = one.movement.violation
    assert violation is not None  # that is why it is asked
    place = _place_at(one.sent, violation.time)
    return PathRefusedError(f"at {place:.3f} m: {violation.sentence}", StatusCode.INVALID_MOTION_PLAN)


def _place_at(path: SentPath, time: float) -> float:
    """Arc length [m] that is passed at a time [s]."""
    k = int(np.clip(np.searchsorted(path.begins, time, side="right") - 1, 0, len(path.begins) - 1))
    motion = path.strokes[k].at(path.instants[k])
    return float(np.interp(time - path.begins[k], motion.t, motion.s))


def _without(layers: Layers, one: _Timed) -> Layers:
    """The layers without the configurations near where a movement isn't certified."""
    violation = one.movement.violation
    assert violation is not None  # that is why it is asked
    place = _place_at(one.sent, violation.time)
    q = one.movement.trajectory.sample([violation.time]).q[0]
    near = (np.abs(layers.s[layers.layer] - place) <= _AROUND) & (np.abs(layers.q - q).max(axis=1) <= _NEAR)
    return replace(layers, free=layers.free & ~near)


def _timed(path: CartesianPath, whole: ToolPath, chain: Chain, t1: bool, context: Context) -> _Timed:
    """A chain with its time. Raises PathRefusedError."""
    scene = context.scene
    angle, chain = angle_along(whole, chain, path.free_angle, context)
    ends = _strokes(whole)
    curves = [curve_of(whole, chain, angle, (whole.ends[a], whole.ends[b]), scene) for a, b in ends]
    slower = _flange_share(path, curves, context) if t1 else 1.0
    tolerance = path.speed_tolerance
    made: list[_Timed] = []

    def timed(limits: MotionLimits) -> Movement:
        strokes = tuple(
            timed_stroke(curve, _spans(whole, a, b, slower), tolerance, limits, scene)
            for curve, (a, b) in zip(curves, ends, strict=True)
        )
        check_duration(sum(stroke.duration for stroke in strokes), context.options)
        points = sent(strokes, scene)
        movement = Movement(chain.q, points.trajectory, context)
        made.append(_Timed(movement, points, angle))
        return movement

    within_torque(timed, context)
    return made[-1]


def _strokes(whole: ToolPath) -> list[tuple[int, int]]:
    """From which corner to which the tool moves without a stop."""
    stops = [k for k, radius in enumerate(whole.radius) if radius == 0.0]
    return list(itertools.pairwise(stops))


def _spans(whole: ToolPath, first: int, last: int, slower: float) -> tuple[Span, ...]:
    lengths = np.diff(whole.ends)
    return tuple(
        Span(float(lengths[k]), whole.parts[k].speed * slower, whole.parts[k].kept)
        for k in range(first, last)
    )


def _flange_share(path: CartesianPath, curves: list[JointCurve], context: Context) -> float:
    """What share of the speed keeps the centre of the flange at T1's speed too."""
    fastest = 0.0
    for curve in curves:
        s = np.linspace(curve.begin, curve.end, 400)
        q, first, _, _ = curve.at(s)
        poses = context.scene.chain.link_poses(q)
        step = 1e-6  # m: difference quotient along the path
        ahead = context.scene.chain.link_poses(q + step * first)
        rate = np.linalg.norm(ahead[:, -1, :3, 3] - poses[:, -1, :3, 3], axis=1).max() / step
        fastest = max(fastest, float(rate))
    top = max([path.tool_speed, *(one.tool_speed for one in path.segments)])
    share = min(1.0, _SHRUNK * T1_SPEED / max(fastest * top, 1e-12))
    if share < 1.0:
        context.journal.note("t1", f"{share * path.tool_speed:.4g} m/s, so that the flange keeps 250 mm/s")
    return share


def checked_path_options(options: PlanOptions) -> tuple[PlanOptions, str]:
    """The options within the planner's bounds, and a note ("" mostly). Raises RequestError for those that a
    path at a given speed can't meet.
    """
    chosen(options.planner_id, ("", PLANNER_ID), "planner_id")
    if options.duration > 0.0:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"duration is {options.duration:g} s: it follows from tool_speed here, it must be 0 s",
        )
    if options.timing != "synchronous":
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"timing is {options.timing}: along a path all axes move together, it must be synchronous",
        )
    return checked_options(options)
