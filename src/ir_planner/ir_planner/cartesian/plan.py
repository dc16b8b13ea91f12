"""Plans of a tool path: the certified movement of least J, and several for a program."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ir_kernels import portable
from ir_msgs_py.cartesian import TANGENT, CartesianPath
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import PlanningInfo, TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.cartesian.chains import ConfigurationChain, Layers, layers_of
from ir_planner.cartesian.dead_ends import chains_through
from ir_planner.cartesian.path_movement import (
    T1_SPEED,
    DrivenPath,
    best_along,
    farther_from_limits,
    timed,
)
from ir_planner.cartesian.path_parts import TURN_SPEED, parts_of
from ir_planner.cartesian.place_curves import TURN_LENGTH
from ir_planner.cartesian.tool_error import PathAccuracy, kept_of
from ir_planner.cartesian.tool_path import (
    REVERSAL,
    Joint,
    PathRefusedError,
    ToolPath,
    ToolPathRequest,
    joined,
)
from ir_planner.checks import FreeSpace
from ir_planner.curves import extremes
from ir_planner.errors import RequestError
from ir_planner.presentation import plot_trajectory, result_text
from ir_planner.request import Context, checked_options, chosen, leaning_freely_only, within_limits
from ir_planner.timing import Movement
from ir_values.arrays import BoolArray, FloatArray

# What a request for a Cartesian path is answered with.


@dataclass(frozen=True, eq=False)
class CartesianPlan:
    """trajectory None unless the status is SUCCESS.

    Bounds at every instant: tool_error [m], the tcp's distance from the path; rotation_error [rad],
    its turn against the path there; speed_deviation, the share of the tool's speed that it is off,
    without approach, retract and changes of speed. lengths (K,) m at which its segments end,
    counted from the beginning of the approach; configurations: how many were looked at.
    """

    status: Status
    info: PlanningInfo
    report: TrajectoryReport
    trajectory: JointTrajectory | None = None
    tool_error: float = 0.0
    rotation_error: float = 0.0
    speed_deviation: float = 0.0
    lengths: FloatArray = field(default_factory=lambda: np.zeros(0))
    configurations: int = 0

    def __repr__(self) -> str:
        identity = "" if self.trajectory is None else self.trajectory.trajectory_id
        error = f"tool error {1e3 * self.tool_error:.3f} mm"
        return result_text("CartesianPlan", self.status, self.report, identity, error)

    def plot(self) -> Any:
        """Angles and speeds of the joints over time; a matplotlib figure."""
        return plot_trajectory(self.trajectory, repr(self))


# A request's path as it is drawn, with all configurations along it, and what a movement keeps of
# it.

TOOL_ERROR_MAX = 1e-4  # m


@dataclass(frozen=True, eq=False)
class Drawn:
    """What is asked for, how its parts are joined, and the configurations along it."""

    asked: ToolPathRequest
    joints: tuple[Joint, ...]
    layers: Layers

    @property
    def lengths(self) -> FloatArray:
        """Where the K segments end (K,) m."""
        whole = self.asked.whole
        return whole.ends[1:][[part.kept for part in whole.parts]]

    def kept(self, driven: DrivenPath) -> PathAccuracy:
        """What a movement keeps of the path. Raises PathRefusedError where that isn't enough."""
        tolerances = kept_of(driven.sent, self.asked.whole, driven.angle, self.asked.context.scene)
        leaves = max((joint.leaves for joint in self.joints), default=0.0)
        turns = max((joint.turns for joint in self.joints), default=0.0)
        share = min(driven.top_speed / (driven.slower * self.asked.fastest), 1.0)
        tolerances = replace(
            tolerances,
            tool_error=tolerances.tool_error + leaves,
            rotation_error=tolerances.rotation_error + turns,
            speed_deviation=max(
                tolerances.speed_deviation, 1.0 - (1.0 - tolerances.speed_deviation) * share
            ),
        )
        if tolerances.tool_error > TOOL_ERROR_MAX:
            raise PathRefusedError(
                f"the tool can't be shown to keep within {TOOL_ERROR_MAX * 1e3:g} mm of the path: "
                f"{tolerances.tool_error * 1e3:.3g} mm"
            )
        return tolerances


def drawn(path: CartesianPath, start: FloatArray | None, t1: bool, context: Context) -> Drawn:
    """A path with its configurations, from `start` (n,) or from all. Raises PathRefusedError."""
    if t1:
        path = _at_most(path, T1_SPEED)
    path = _at_most(path, _BELOW * context.tool_bounds.tcp.speed)
    with context.journal.stage("path") as notes:
        whole, joints = joined(path, parts_of(path))
        _check_corners(path, whole, joints)
        notes.append(f"{whole.length:.3f} m in {len(whole.parts)} parts")
        if (reduced := _reduced(path, whole, joints)) < path.blending_radius:
            notes.append(f"blending radius down to {reduced:.4g} m: half of a part")
    request = ToolPathRequest(path, whole, start is not None, t1, context)
    with context.journal.stage("configurations") as notes:
        layers = layers_of(whole, path.free_angle, request.space, start)
        notes.append(f"{len(layers.q)} at {len(layers.s)} samples, {int(layers.free.sum())} free")
    return Drawn(request, joints, layers)


_BELOW = 0.998  # of the tool's largest speed: by how much the tool may be off the speed asked for


def _at_most(path: CartesianPath, speed: float) -> CartesianPath:
    segments = tuple(
        replace(segment, tool_speed=min(segment.tool_speed, speed)) for segment in path.segments
    )
    return replace(path, tool_speed=min(path.tool_speed, speed), segments=segments)


def _reduced(path: CartesianPath, whole: ToolPath, joints: tuple[Joint, ...]) -> float:
    """The smallest radius [m] of a corner that is rounded as asked for."""
    rounded = [joint.radius for joint in joints if joint.rounded]
    return min(rounded, default=path.blending_radius)


def _check_corners(path: CartesianPath, whole: ToolPath, joints: tuple[Joint, ...]) -> None:
    """Raise PathRefusedError at a corner within the path where the tool would have to stop and may
    not.
    """
    for k, joint in enumerate(joints, start=1):
        before = whole.parts[k - 1]
        after = whole.parts[k]
        if joint.radius > 0.0 or not (before.kept and after.kept):
            continue
        if before.in_place or after.in_place:  # where the tool has to stop
            continue
        corner = (
            f"at {whole.ends[k]:.3f} m the path has a corner of {np.degrees(joint.angle):.1f} deg"
        )
        if path.orientation == TANGENT:
            raise PathRefusedError(
                f"{corner}: a tool that turns with the path can't follow it; give a "
                "blending_radius",
                StatusCode.INVALID_MOTION_PLAN,
            )
        if path.speed_tolerance < 1.0:
            rounding = "" if joint.angle > REVERSAL else "give a blending_radius, or "
            raise PathRefusedError(
                f"{corner}, where the tool can't keep {before.speed:g} m/s: {rounding}"
                f"speed_tolerance 1 to stop there (it is {path.speed_tolerance:g})",
                StatusCode.INVALID_MOTION_PLAN,
            )


# Certified movements along a path from and to different configurations, for a program to choose
# among.
#
# Candidates are the cheapest chain to each different end and from each different start; those that
# differ by whole turns of joints are one movement, shifted.

_OF_EACH = 12  # chains by their ends, and as many by their starts
_SAME = 1e-3  # rad: chains that are nearer are one
_TURNS = (-2, -1, 0, 1, 2)


class ChosenMovement(NamedTuple):
    """A movement along a path with its configurations (N, n) from its beginning to its end."""

    points: FloatArray
    movement: Movement


def choices_along(
    path: CartesianPath, context: Context, after: FreeSpace, most: int
) -> list[ChosenMovement]:
    """Certified movements whose ends keep the safety distance from everything, at their end also in
    the space `after`; at most `most`. Raises PathRefusedError, RequestError.
    """
    whole = drawn(path, None, False, context)
    whole = replace(whole, layers=replace(whole.layers, free=_ends_free(whole, after)))
    reason: PathRefusedError | None = None
    paths: list[DrivenPath] = []
    for chain in _different(whole):
        context.work.check()
        try:
            driven = farther_from_limits(whole.asked, timed(whole.asked, chain))
            if driven.movement.prove().certified:
                whole.kept(driven)
                paths.append(driven)
        except PathRefusedError as error:
            reason = reason or error
    if not paths:
        paths = [best_along(whole.asked, whole.layers)]
        whole.kept(paths[0])
    turned = (choice for driven in paths for choice in _turned_choices(driven))
    return list(itertools.islice(turned, most))


def _ends_free(whole: Drawn, after: FreeSpace) -> BoolArray:
    """Which configurations take part (M,): at the ends those that nothing is allowed to touch."""
    layers = whole.layers
    context = whole.asked.context
    free = layers.free.copy()
    plain = FreeSpace.of(context.scene, context.safety_distance, context.work)
    for k, spaces in ((0, (plain,)), (len(layers.s) - 1, (plain, after))):
        there = np.flatnonzero(free & (layers.layer == k))
        if len(there) == 0:
            continue
        for space in spaces:
            free[there] &= space.states_free(layers.q[there])
        if not free[there].any():
            end = "its end: give it a retract" if k else "its beginning: give it an approach"
            raise PathRefusedError(
                f"no configuration keeps {1e3 * context.safety_distance:g} mm from everything at "
                f"{end}"
            )
    return free


def _different(whole: Drawn) -> list[ConfigurationChain]:
    """The cheapest chains by their ends and by their starts, each once, cheapest first."""
    request = whole.asked
    layers = whole.layers
    by_end, layers = chains_through(request, layers, _OF_EACH)
    by_start, _ = chains_through(request, layers, _OF_EACH, by_start=True)
    chains: list[ConfigurationChain] = []
    for chain in sorted((*by_end, *by_start), key=lambda path: path.joules):
        if all(
            np.abs(portable.sin(0.5 * (chain.q - other.q))).max() > 0.5 * _SAME for other in chains
        ):
            chains.append(chain)
    return chains


def _turned_choices(driven: DrivenPath) -> Iterator[ChosenMovement]:
    """A movement as it is, then by whole turns of joints as far as their limits allow."""
    movement = driven.movement
    robot = movement.context.scene.cell.robot
    trajectory = movement.trajectory
    largest = extremes(*trajectory.coefficients())
    low = largest.lowest.min(axis=0)
    high = largest.highest.max(axis=0)
    turns = [
        [k for k in _TURNS if a + 2.0 * np.pi * k >= least and b + 2.0 * np.pi * k <= most]
        for a, b, least, most in zip(low, high, robot.position_min, robot.position_max, strict=True)
    ]
    positions = trajectory.positions
    for shift in sorted(itertools.product(*turns), key=lambda one: sum(map(abs, one))):
        if not any(shift):
            yield ChosenMovement(positions, movement)
            continue
        moved = positions + 2.0 * np.pi * np.array(shift)
        yield ChosenMovement(
            moved, replace(movement, trajectory=replace(trajectory, positions=moved))
        )


# What whoever drives a path should know of its speed.

_REACHED = 0.999  # of a speed


def remarks(drawn: ToolPathRequest, found: DrivenPath) -> Iterator[tuple[str, str]]:
    """Names and texts of remarks: T1 slows the tool, ramps are long, or the speed isn't reached."""
    path = drawn.path
    whole = drawn.whole
    if any(part.in_place and part.speed == TURN_LENGTH * TURN_SPEED for part in whole.parts):
        yield "speed", f"turns in place at {found.slower * TURN_SPEED:.4g} rad/s"
    moving = [stroke for k, stroke in enumerate(found.sent.strokes) if not whole.turns_in_place(k)]
    if not moving:
        return
    if found.slower < 1.0:
        yield "t1", f"{found.slower * path.tool_speed:.4g} m/s, so that the flange keeps 250 mm/s"
    if found.longer:
        yield "speed", f"the axes need long ramps: the tool keeps its speed {_kept_between(found)}"
    fastest = found.slower * max(part.tool_speed or path.tool_speed for part in path.segments)
    top = found.top_speed if len(moving) == len(found.sent.strokes) else fastest
    slowed = [stroke for stroke in moving if stroke.slowness is not None]
    if path.speed_tolerance >= 1.0 and slowed:
        mean = sum(s.curve.end - s.curve.begin for s in moving) / sum(s.duration for s in moving)
        yield (
            "speed",
            f"slower than {fastest:.4g} m/s where the axes need it: {mean:.4g} m/s in the mean",
        )
    elif top < _REACHED * fastest:
        yield (
            "speed",
            f"the path is too short for {fastest:.4g} m/s: the tool moves at {top:.4g} m/s at most",
        )


def _kept_between(found: DrivenPath) -> str:
    """Where the tool keeps its speed."""
    where = [
        f"from {stroke.curve.begin + begin:.3f} to {stroke.curve.begin + end:.3f} m"
        for stroke in found.sent.strokes
        for begin, end, even in zip(
            stroke.law.places[:-1], stroke.law.places[1:], stroke.law.even, strict=True
        )
        if even
    ]
    return ", ".join(where) or "nowhere"


# A path of the tool as a certified movement: the chain of configurations of least J that keeps the
# speed.

PLANNER_ID = "cartesian"


def plan_path(
    path: CartesianPath, start: FloatArray | None, t1: bool, context: Context
) -> CartesianPlan:
    """Plan a path from the configuration `start` (n,), None: the one of least J. t1: at most 250
    mm/s.

    Raises RequestError for a request that makes no sense, CancelledError when asked to stop.
    """
    context.journal.planner_id = PLANNER_ID
    context.journal.timing = "synchronous"
    try:
        return _plan_of_path(path, start, t1, context)
    except PathRefusedError as error:
        return _answer(error.status, context)


def _plan_of_path(
    path: CartesianPath, start: FloatArray | None, t1: bool, context: Context
) -> CartesianPlan:
    """Draw the path, drive it at least cost, and measure how far the tool may be off it. Raises
    PathRefusedError.
    """
    if start is not None:
        cell = context.scene.cell
        start = within_limits(start, cell, "start", StatusCode.START_STATE_INVALID)
    whole = drawn(path, start, t1, context)
    driven = best_along(whole.asked, whole.layers)
    with context.journal.stage("tool error"):
        accuracy = whole.kept(driven)
    for name, text in remarks(whole.asked, driven):
        context.journal.note(name, text)
    trajectory = driven.movement.trajectory
    info = context.journal.info(trajectory.positions[0], context.joint_names)
    return CartesianPlan(
        Status.success(),
        info,
        driven.movement.report,
        trajectory,
        accuracy.tool_error,
        accuracy.rotation_error,
        accuracy.speed_deviation,
        whole.lengths,
        len(whole.layers.q),
    )


def _answer(status: Status, context: Context) -> CartesianPlan:
    return CartesianPlan(
        status, context.journal.info(None, context.joint_names), TrajectoryReport()
    )


def checked_path_options(options: PlanOptions) -> tuple[PlanOptions, str]:
    """The options within the planner's bounds, and a note ("" mostly). Raises RequestError for
    those that a path at a given speed can't meet.
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
            f"timing is {options.timing}: along a path all axes move together, it must be "
            "synchronous",
        )
    leaning_freely_only(options, "a path of the tool, whose poses say how it leans,")
    return checked_options(options)
