"""Checks of a trajectory before it is executed: shape, limits at every instant, and the lead-in."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ir_description import RobotModel
from ir_description.robot import OUTSIDE_MAX
from ir_kernels.dynamics import DynamicsModel
from ir_kernels.limits import Extrema, polynomial_extrema
from ir_msgs_py.names import joint_unit
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion.corner_rounding import SHARES, SLOWEST, is_rounded, rounded
from ir_sim_driver.motion.goal import (
    FOR_EVER,
    ErrorCode,
    ExecutionSettings,
    JointTolerance,
    TrajectoryGoal,
)
from ir_sim_driver.motion.path import Path, PathMotion, quintic
from ir_values.arrays import BoolArray, FloatArray
from ir_values.errors import JointNamesError

# Limits of position, velocity, acceleration and torque, proved for every instant.
#
# Positions, velocities and accelerations are compared by the exact extremes of the polynomials,
# torques by guaranteed bounds (ir_kernels): segments of a nanosecond and paths of an hour alike,
# nothing is sampled.


class PositionRange(NamedTuple):
    """Smallest and largest position (n,) [rad]."""

    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, robot: RobotModel) -> PositionRange:
        """The robot's own."""
        return cls(robot.position_min, robot.position_max)

    def including(self, q: FloatArray) -> PositionRange:
        """This range and q (n,): who is outside may come back, and go no farther out."""
        return PositionRange(np.minimum(self.low, q), np.maximum(self.high, q))

    @classmethod
    def along(cls, trajectory: JointTrajectory, robot: RobotModel) -> PositionRange:
        """The robot's own; a joint that begins at most OUTSIDE_MAX beyond it and ends in it leads
        back, and goes no farther out. Whether the robot stands there is checked at the start.
        """
        own = cls.of(robot)
        first = trajectory.positions[0]
        last = trajectory.positions[-1]
        near = (first >= own.low - OUTSIDE_MAX) & (first <= own.high + OUTSIDE_MAX)
        back = near & (last >= own.low) & (last <= own.high)
        return own.including(np.where(back, first, own.low))


class _Excess(NamedTuple):
    """The earliest instant at which a limit is exceeded most."""

    time: float
    sentence: str


def check_limits(
    coefficients: FloatArray,
    durations: FloatArray,
    start: float,
    robot: RobotModel,
    dynamics: DynamicsModel,
    settings: ExecutionSettings,
    allowed: PositionRange | None = None,
) -> None:
    """Raise TrajectoryRefusedError naming joint, time, value, limit and excess where a limit is
    exceeded first: of position, velocity, acceleration or torque, in this order.

    Segments (S, n, 6) with durations (S,) [s], the first at time `start` [s] of the trajectory.
    dynamics: with the present load. allowed: positions, the robot's own range unless given.
    """
    if len(durations) == 0:
        return
    with np.errstate(over="ignore", invalid="ignore"):
        if not np.isfinite(coefficients).all():
            raise TrajectoryRefusedError(
                ErrorCode.INVALID_GOAL,
                "points lie too close in time: the polynomial between them is not finite",
            )
        position, speed, change = (polynomial_extrema(coefficients, durations, k) for k in range(3))
    starts = start + np.concatenate(([0.0], np.cumsum(durations)[:-1]))
    names = robot.joint_names
    slack = 1.0 + settings.limit_slack
    allowed = allowed or PositionRange.of(robot)
    found = [
        _position_excess(position, starts, names, allowed, settings.position_slack),
        _excess(speed, starts, names, robot.velocity_max, slack, "rad/s"),
        _excess(change, starts, names, robot.acceleration_max, slack, "rad/s^2"),
    ]
    first = next((each for each in found if each is not None), None)
    if first is None:  # bounds of torques need motions of sensible size
        first = _torque_excess(coefficients, durations, start, names, dynamics, slack)
    if first is not None:
        raise TrajectoryRefusedError(ErrorCode.INVALID_GOAL, first.sentence)


def _position_excess(
    found: Extrema, starts: FloatArray, names: Sequence[str], allowed: PositionRange, slack: float
) -> _Excess | None:
    low = _first(~(found.minimum >= allowed.low - slack), found.time_of_minimum, starts)
    high = _first(~(found.maximum <= allowed.high + slack), found.time_of_maximum, starts)
    candidates = []
    for at, values, bounds in (
        (low, found.minimum, allowed.low),
        (high, found.maximum, allowed.high),
    ):
        if at is not None:
            time, k, j = at
            unit = joint_unit(names[j])
            value = float(values[k, j])
            bound = float(bounds[j])
            excess = abs(value - bound)
            sentence = _sentence(f"{names[j]} is at", value, bound, excess, time, unit)
            candidates.append(_Excess(time, sentence))
    return min(candidates, default=None)


def _excess(
    found: Extrema,
    starts: FloatArray,
    names: Sequence[str],
    limit: FloatArray,
    slack: float,
    unit: str,
) -> _Excess | None:
    down = -found.minimum > found.maximum
    value = np.where(down, found.minimum, found.maximum)
    when = np.where(down, found.time_of_minimum, found.time_of_maximum)
    at = _first(~(np.abs(value) <= limit * slack), when, starts)
    if at is None:
        return None
    time, k, j = at
    unit = joint_unit(names[j], unit)
    return _Excess(time, _needs(names[j], float(value[k, j]), float(limit[j]), time, unit))


def _torque_excess(
    coefficients: FloatArray,
    durations: FloatArray,
    start: float,
    names: Sequence[str],
    dynamics: DynamicsModel,
    slack: float,
) -> _Excess | None:
    bounds = dynamics.torque_bounds(coefficients, durations)
    beyond = ~(bounds.upper <= slack)  # what cannot be decided is not allowed
    if not beyond.any():
        return None
    j = int(np.where(beyond, bounds.sampled, -np.inf).argmax())
    q, qd, qdd = Path(coefficients, durations, coefficients[0, :, 0]).motion(float(bounds.time[j]))
    limit = float(dynamics.torque_limit(qd[None])[0, j])
    # by the bound: it counts friction of either sign where a joint turns, and what could not be
    # decided
    needed = dynamics.inverse_dynamics(q[None], qd[None], qdd[None])[0, j]
    torque = float(np.copysign(bounds.upper[j] * limit, needed))
    time = start + float(bounds.time[j])
    return _Excess(time, _needs(names[j], torque, limit, time, "Nm"))


def _first(bad: BoolArray, when: FloatArray, starts: FloatArray) -> tuple[float, int, int] | None:
    """Time [s], segment and joint of the earliest instant `when` (S, n) [s from starts (S,)] that
    is bad.
    """
    if not bad.any():
        return None
    k = int(bad.any(axis=1).argmax())
    j = int(np.where(bad[k], when[k], np.inf).argmin())
    return float(starts[k] + when[k, j]), k, j


def _needs(name: str, value: float, limit: float, time: float, unit: str) -> str:
    """What a joint needs of a quantity that is limited in both directions alike."""
    bound = limit if value >= 0.0 else -limit
    return _sentence(f"{name} needs", value, bound, abs(value) - limit, time, unit)


def _sentence(what: str, value: float, bound: float, excess: float, time: float, unit: str) -> str:
    return (
        f"{what} {value:.6g} {unit} at {time:.4f} s: the limit is {bound:.6g} {unit}, "
        f"exceeded by {excess:.3g} {unit}"
    )


# Lead-in: from where the command is onto a trajectory, without a jump.
#
# A trajectory that begins in the motion which the driven movement has farther on: the movement goes
# on as far as that, and then along the trajectory.
# First time > 0: a polynomial leads in until then. First time 0 at rest: the last difference
# (within the start tolerance) is closed before path time starts, as slowly as is asked. First
# time 0 in motion, or with a first velocity: a polynomial bridges to the next point far enough
# away. A movement that is replaced by one with a later start leads in until that start.

_PEAK = 10.0 / math.sqrt(3.0)  # largest acceleration of a unit quintic step of unit duration
_SAME = 1e-12  # rad; what rounding leaves of a difference
AT_REST = 1e-6  # rad/s that still count as standing


@dataclass(frozen=True, eq=False)
class LeadPath:
    """A path and the path time [s] at which its trajectory starts; the first `lead` segments are
    not the trajectory's. joined: they are those of the movement that is driven, at its present
    speed.
    """

    path: Path
    offset: float
    lead: int
    joined: bool = False


class CurrentPath(NamedTuple):
    """The path of the movement that is driven, and the path time [s] that it has reached."""

    path: Path
    s: float


_AHEAD = 30.0  # s of path time within which a movement may be joined
_LOOKS = 0.004  # s between two looks along a path for a place on it
_POLISHED = 8  # steps towards that place
# that a place on a path may be off a trajectory's first point: rad, rad/s, rad/s^2
_JOINED = (1e-6, 1e-4, 1e-2)


def joining(
    trajectory: JointTrajectory, driven: CurrentPath, settings: ExecutionSettings, delay: float
) -> LeadPath | None:
    """The movement that is driven as far as the trajectory begins on it, in its motion, and then
    the trajectory; None where it doesn't begin there. delay [s]: until its time 0 by its header
    stamp, which counts within bridge_time, 0: none.
    """
    path, s = driven
    begin = _motion_at_point(trajectory, 0)
    if trajectory.times_ns[0] != 0 or np.abs(begin.qd).max() <= AT_REST or s >= path.duration:
        return None

    # the nearest instant of the path ahead, then polished by Newton's method
    until = min(path.duration, s + _AHEAD)
    looks = np.linspace(s, until, 2 + int((until - s) / _LOOKS))
    away = np.abs(path.positions(looks) - begin.q).max(axis=1)
    if delay > 0.0:
        away[np.abs(looks - s - delay) > settings.bridge_time] = np.inf
    at = float(looks[int(away.argmin())])
    for _ in range(_POLISHED):
        there = path.motion(at)
        squared_speed = float(np.square(there.qd).sum())
        ahead = float(((begin.q - there.q) * there.qd).sum())
        at += ahead / squared_speed if squared_speed > 0.0 else 0.0
        at = min(max(at, s), path.duration)

    there = path.motion(at)
    for own, wanted, most in zip(there, begin, _JOINED, strict=True):
        if float(np.abs(own - wanted).max()) > most:
            return None
    lead, lead_durations = path.between(s, at)
    coefficients, durations = trajectory.coefficients()
    whole = _path([lead, coefficients], [lead_durations, durations], path.position(s))
    return LeadPath(whole, float(lead_durations.sum()), len(lead_durations), joined=True)


def route_onto(
    trajectory: JointTrajectory,
    now: PathMotion,
    acceleration_max: FloatArray,
    settings: ExecutionSettings,
    delay: float,
    share: float,
) -> LeadPath:
    """Path from the commanded motion `now` onto and along the trajectory that is executed.

    acceleration_max (n,) [rad/s^2]. delay [s]: until time 0 of the trajectory, below 0 since; a
    robot at rest waits for it. share: of acceleration_max, that closing the last difference may
    use; anything else has its time given. Raises TrajectoryRefusedError.
    """
    moving = bool(now.qd.any())
    late = max(0.0, -delay) if settings.join_late else 0.0
    if late > 0.0:
        return _bridged(trajectory, now, settings.bridge_time, late)
    first = float(trajectory.times[0]) + (max(0.0, delay) if moving else 0.0)
    coefficients, durations = trajectory.coefficients()
    begin = _motion_at_point(trajectory, 0)
    if first > 0.0:
        lead = quintic(now, begin, first)
        whole = _path([lead, coefficients], [np.array([first]), durations], now.q)
        return LeadPath(whole, 0.0, 1)
    _check_start(trajectory, now, acceleration_max, settings)
    if moving or np.abs(begin.qd).max() > AT_REST:
        return _bridged(trajectory, now, settings.bridge_time)
    start = trajectory.positions[0]
    delta = np.abs(start - now.q)
    if delta.max() <= _SAME:
        return LeadPath(Path(coefficients, durations, start), 0.0, 0)

    # from rest to rest, as long as the share of the acceleration takes
    T = math.sqrt(_PEAK * float((delta / acceleration_max).max()) / share)
    still = np.zeros_like(delta)
    closing = quintic(PathMotion(now.q, still, still), PathMotion(start, still, still), T)
    whole = _path([closing, coefficients], [np.array([T]), durations], now.q)
    return LeadPath(whole, T, 1)


def _bridged(
    trajectory: JointTrajectory, now: PathMotion, bridge_time: float, late: float = 0.0
) -> LeadPath:
    """Onto the first point that is at least bridge_time [s] ahead, `late` [s] after time 0."""
    coefficients, durations = trajectory.coefficients()
    if len(durations) == 0 and trajectory.times[0] <= late:
        raise TrajectoryRefusedError(
            ErrorCode.INVALID_GOAL,
            "the only point has time 0 s and the robot moves: give it a time above 0 s",
        )
    k = min(int(np.searchsorted(trajectory.times, late + bridge_time)), len(durations))
    bridge_time = float(trajectory.times[k]) - late
    bridge = quintic(now, _motion_at_point(trajectory, k), bridge_time)
    pieces = [bridge, coefficients[k:]], [np.array([bridge_time]), durations[k:]]
    return LeadPath(_path(*pieces, now.q), -late, 1)


def _path(coefficients: list[FloatArray], durations: list[FloatArray], rest: FloatArray) -> Path:
    return Path(np.concatenate(coefficients), np.concatenate(durations), rest)


def _motion_at_point(trajectory: JointTrajectory, k: int) -> PathMotion:
    """Motion right after point k; what a trajectory does not say comes from its own polynomial. At
    rest there is no acceleration but what it says: to meet that of a polynomial, what leads there
    would swing back, the farther the longer it lasts.
    """
    samples = trajectory.sample(trajectory.times[k : k + 1])
    last = k == len(trajectory.times_ns) - 1
    still = np.zeros(samples.q.shape[1])
    v = samples.qd[0] if trajectory.velocities is None else trajectory.velocities[k]
    a = samples.qdd[0] if trajectory.accelerations is None else trajectory.accelerations[k]
    if last and trajectory.velocities is None:
        v = still
    if trajectory.accelerations is None and not v.any():
        a = still
    return PathMotion(trajectory.positions[k], v, a)


def _check_start(
    trajectory: JointTrajectory,
    now: PathMotion,
    acceleration_max: FloatArray,
    settings: ExecutionSettings,
) -> None:
    delta = trajectory.positions[0] - now.q
    j = int(np.abs(delta).argmax())
    name = trajectory.joint_names[j]
    unit = joint_unit(name)
    if abs(delta[j]) > settings.start_tolerance:
        raise TrajectoryRefusedError(
            ErrorCode.INVALID_GOAL,
            f"{name} starts at {trajectory.positions[0, j]:.6f} {unit}, "
            f"{delta[j]:+.6f} {unit} from the commanded {now.q[j]:.6f} {unit}: at most "
            f"{settings.start_tolerance:g} {unit} (or a first time above 0 s)",
        )
    jump = _motion_at_point(trajectory, 0).qd - now.qd
    over = np.abs(jump) - settings.blend_time * acceleration_max
    j = int(over.argmax())
    if over[j] > 0.0:
        name = trajectory.joint_names[j]
        unit = joint_unit(name, "rad/s")
        raise TrajectoryRefusedError(
            ErrorCode.INVALID_GOAL,
            f"{name} starts with {jump[j]:+.4f} {unit} against the command: at most "
            f"{settings.blend_time * acceleration_max[j]:.4f} {unit} (or a first time above 0 s)",
        )


# Shape of a trajectory, and all checks together.

_NS = 1e-9
_GENTLENESS = (0.25, 0.1, 0.03, 0.01, 1e-3, 1e-4)
"""Shares of the acceleration limits with which the last difference to a trajectory may be closed,
tried in turn. With the last one the torques are those of standing there and of friction.
"""
_HARMLESS = 1e-5
"""A difference [rad] that is closed whatever friction asks for: encoders leave less, and a drive
that holds the robot where the trajectory starts creeps so far (30 um at 3 m) with what it has left.
"""
_SHORT = 0.01  # share for it: over before a motor that gives all it has counts as overloaded


def check_goal(
    goal: TrajectoryGoal, joint_names: tuple[str, ...], settings: ExecutionSettings, now_ns: int
) -> TrajectoryGoal:
    """Return the goal in the robot's joint order. Raises TrajectoryRefusedError; knows nothing of
    the robot's state.
    """
    if goal.multi_dof:
        raise _invalid(f"{goal.multi_dof} multi-dof points: the robot has joints only")
    if goal.has_effort:
        raise _invalid("points carry effort: torques are the driver's business, leave them empty")
    points = len(goal.trajectory.times_ns)
    if points > settings.max_points:
        raise _invalid(f"the trajectory has {points} points: at most {settings.max_points}")
    try:
        trajectory = goal.trajectory.reordered(joint_names)
    except JointNamesError as error:
        raise TrajectoryRefusedError(ErrorCode.INVALID_JOINTS, str(error)) from error
    if trajectory.duration > settings.max_duration:
        raise _invalid(
            f"the trajectory takes {trajectory.duration:g} s: at most {settings.max_duration:g} s"
        )
    _check_stamp(goal, trajectory, settings, now_ns)
    _check_end(trajectory)
    goal = replace(goal, trajectory=trajectory)
    for tolerance in (*goal.path_tolerance, *goal.goal_tolerance):
        goal = goal.noted(_checked_tolerance(tolerance, joint_names))
    known = math.isfinite(goal.goal_time) and (goal.goal_time >= 0.0 or goal.goal_time == FOR_EVER)
    if not known:
        raise _invalid(
            f"goal_time_tolerance is {goal.goal_time:g} s: it must be at least 0 s (0: default), "
            "or -1 s (for ever)"
        )
    return goal


def check_trajectory(
    trajectory: JointTrajectory,
    robot: RobotModel,
    dynamics: DynamicsModel,
    settings: ExecutionSettings,
) -> tuple[JointTrajectory, str]:
    """Check every instant of a trajectory against the limits, whatever state the robot is in; what
    is executed of it, and what its sender should know, "" for nothing.

    Positions alone are rounded and, where the limits need it, slowed. May take a while for long
    ones. Raises TrajectoryRefusedError.
    """
    _check_points(trajectory, robot, settings)
    if not is_rounded(trajectory):
        _check_segments(trajectory, robot, dynamics, settings)
        return trajectory, ""
    for share in SHARES:
        executed = rounded(trajectory, robot, settings, share)
        if executed.slowed > SLOWEST:
            break
        try:
            _check_segments(executed.trajectory, robot, dynamics, settings)
        except TrajectoryRefusedError as error:
            refusal = error
        else:
            return executed.trajectory, executed.note(settings)
    if executed.slowed <= SLOWEST:
        raise refusal
    raise _invalid(
        f"the lines between the points would have to be driven {executed.slowed:.3g} times slower "
        f"to keep the limits: at most {SLOWEST:g}; give the points more time"
    )


def _check_segments(
    trajectory: JointTrajectory,
    robot: RobotModel,
    dynamics: DynamicsModel,
    settings: ExecutionSettings,
) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        coefficients, durations = trajectory.coefficients()
    start = float(trajectory.times[0])
    allowed = PositionRange.along(trajectory, robot)
    check_limits(coefficients, durations, start, robot, dynamics, settings, allowed)


def checked_route(
    trajectory: JointTrajectory,
    now: PathMotion,
    robot: RobotModel,
    dynamics: DynamicsModel,
    settings: ExecutionSettings,
    delay: float = 0.0,
    driven: CurrentPath | None = None,
) -> LeadPath:
    """Path from the commanded motion `now` along a trajectory that passed check_trajectory. driven:
    the movement that goes on, which it may join.

    Only what leads in is checked here; from outside its range a joint may come back, and go no
    farther out.
    The last difference of a robot at rest is closed as fast as its torques allow: nobody gave that
    a time. One that is _HARMLESS is never refused.
    delay [s]: until time 0 of the trajectory. Raises TrajectoryRefusedError.
    """
    allowed = PositionRange.of(robot).including(now.q)
    joined = None if driven is None else joining(trajectory, driven, settings, delay)
    if joined is not None:
        _check_lead(joined, robot, dynamics, settings, allowed)
        return joined

    def route(share: float) -> LeadPath:
        return route_onto(trajectory, now, robot.acceleration_max, settings, delay, share)

    for share in _GENTLENESS:
        found = route(share)
        try:
            _check_lead(found, robot, dynamics, settings, allowed)
        except TrajectoryRefusedError as error:
            if found.offset <= 0.0:
                raise
            refusal = error
        else:
            return found
    if np.abs(trajectory.positions[0] - now.q).max() <= _HARMLESS:
        return route(_SHORT)
    raise _invalid(
        f"{refusal}; until 0 s it goes from where it stands to the first point, however slowly: "
        "plan it again from where it stands"
    ) from refusal


def _check_lead(
    route: LeadPath,
    robot: RobotModel,
    dynamics: DynamicsModel,
    settings: ExecutionSettings,
    allowed: PositionRange,
) -> None:
    """Raise TrajectoryRefusedError where what leads in exceeds a limit."""
    coefficients = route.path.coefficients[: route.lead]
    durations = route.path.durations[: route.lead]
    check_limits(coefficients, durations, -route.offset, robot, dynamics, settings, allowed)


def _check_points(
    trajectory: JointTrajectory, robot: RobotModel, settings: ExecutionSettings
) -> None:
    """Name the point that is outside: more use to its sender than the instant between points."""
    q = trajectory.positions
    allowed = PositionRange.along(trajectory, robot)
    over = np.maximum(q - allowed.high, allowed.low - q) > settings.position_slack
    if over.any():
        k, j = (int(i) for i in np.argwhere(over)[0])
        low = allowed.low[j]
        high = allowed.high[j]
        excess = max(q[k, j] - high, low - q[k, j])
        name = trajectory.joint_names[j]
        unit = joint_unit(name)
        raise _invalid(
            f"point {k} joint {j} ({name}) is at {q[k, j]:.6f} {unit}: the "
            f"limits are [{low:.6f}, {high:.6f}] {unit}, exceeded by {excess:.3g} {unit}"
        )


def _check_stamp(
    goal: TrajectoryGoal, trajectory: JointTrajectory, settings: ExecutionSettings, now_ns: int
) -> None:
    if goal.stamp_ns == 0:
        return
    delay = (goal.stamp_ns - now_ns) * _NS
    if delay + trajectory.duration <= 0.0:
        raise TrajectoryRefusedError(
            ErrorCode.OLD_HEADER_TIMESTAMP,
            f"the trajectory ended {-delay - trajectory.duration:.3f} s ago by its header stamp: "
            "it must end in the future",
        )
    if delay > settings.max_delay:
        raise _invalid(
            f"the trajectory starts in {delay:.3f} s by its header stamp: at most "
            f"{settings.max_delay:g} s"
        )


def _check_end(trajectory: JointTrajectory) -> None:
    if trajectory.velocities is None:
        return
    last = trajectory.velocities[-1]
    j = int(np.abs(last).argmax())
    if abs(last[j]) > AT_REST:
        name = trajectory.joint_names[j]
        unit = joint_unit(name, "rad/s")
        raise _invalid(
            f"point {len(trajectory.times_ns) - 1} joint {j} ({name}) ends with {last[j]:g} "
            f"{unit}: the last velocity must be 0 {unit}"
        )


def _checked_tolerance(tolerance: JointTolerance, joint_names: tuple[str, ...]) -> str:
    """What of a tolerance is not used, "" when all is. Raises TrajectoryRefusedError."""
    for what in ("position", "velocity", "acceleration"):
        value = getattr(tolerance, what)
        if not (math.isfinite(value) and (value >= 0.0 or value == -1.0)):
            raise _invalid(
                f"{what} tolerance of {tolerance.name[:80]} is {value:g}: it must be at least 0 "
                "(0: default), or -1 (unbounded)"
            )
    if tolerance.name not in joint_names:
        return f"tolerance for unknown joint {tolerance.name[:80]!r} is not used"
    if tolerance.acceleration > 0.0:
        return (
            f"acceleration tolerance of {tolerance.name} is not used: nothing measures "
            "accelerations"
        )
    return ""


def _invalid(sentence: str) -> TrajectoryRefusedError:
    return TrajectoryRefusedError(ErrorCode.INVALID_GOAL, sentence)
