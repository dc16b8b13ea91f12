"""Regional movements that start or end in motion: from (q, qd, qdd) to (q, qd, qdd).

What every movement from such a state must do is judged first: a joint that can't brake before its
limit, or that goes on getting faster than it may while its acceleration falls, is a refusal with
the axis, the value and the bound. Then movements come from three sources, and the cheapest
certified one is the answer: descents with the given motion at the ends, along free paths and
guesses; the stop and go around it (braking, a movement from rest to rest, getting up to speed); and
the descent from that one. So no answer costs more than that stop and go.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import (
    FreeSpace,
    clearance_violation,
    end_in_collision,
    end_outside_cone,
    torque_proof,
)
from ir_planner.curves import extremes
from ir_planner.errors import RequestError, TimingError
from ir_planner.optimize import Portfolio, Refinement
from ir_planner.regional.companions import over_free_steps
from ir_planner.regional.exploration import Path, Searches, first_paths, improve
from ir_planner.request import Context
from ir_planner.scene import STILL, torque_use
from ir_planner.search import Ends
from ir_planner.timing import TORQUE_SHARES, Movement, distinct
from ir_values.arrays import FloatArray

STOP_AND_GO = "stop and go"  # the search of movements that brake to rest in between
FLOWING = "flowing"  # of those that came from one by descent, without the stop
_SLACK = 1e-9  # relative
_POSITION = 1e-9  # rad
_LONGER = 1.06  # from one try of a stop to the next
_TRIES = 60
_SHORTEST = 1e-3  # s, of a stop
_REFINED = 1  # of the cheapest coarse solutions, where no work is asked for
_AWAY = 1e-3  # rad: a goal that is nearer than that has no path to it


class MovingEnd(NamedTuple):
    """q, qd, qdd (n,) at the start of a movement, or at its goal as it looks backwards in time."""

    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    what: str
    code: StatusCode

    @property
    def at_rest(self) -> bool:
        """Whether nothing moves."""
        return not (self.qd.any() or self.qdd.any())


def moving_ends(
    start: FloatArray, goal: FloatArray, motion: FloatArray
) -> tuple[MovingEnd, MovingEnd]:
    """Both ends of a movement from start to goal (n,) with qd, qdd, motion (2, 2, n)."""
    return (
        MovingEnd(start, motion[0, 0], motion[0, 1], "start", StatusCode.START_STATE_INVALID),
        MovingEnd(goal, -motion[1, 0], motion[1, 1], "goal", StatusCode.GOAL_STATE_INVALID),
    )


def search_in_motion(
    start: FloatArray,
    goals: FloatArray,
    context: Context,
    searches: Searches,
) -> tuple[Status, Movement | None]:
    """The cheapest movement found with the context's motion at its ends, start (n,), goals (G, n),
    or why there is none. Raises RequestError for ends from which limits can't be kept.
    """
    assert context.motion is not None
    begin, end = moving_ends(start, goals[0], context.motion)
    for each in (begin, end):
        check_driveable(each, context)
    cone = context.cone
    space = FreeSpace.of(context.scene, context.safety_distance, context.work, cone=cone)
    blocked = end_in_collision(start, goals[0], space, context.safety_distance)
    blocked = blocked or end_outside_cone(start, goals[0], cone)
    if blocked is not None:
        return blocked, None
    context.journal.timing = "synchronous"
    if context.options.timing == "asynchronous":
        context.journal.note("asynchronous", "timing is synchronous: the movement is in motion")
    portfolio = Portfolio(space, Refinement(context))
    with context.journal.stage(STOP_AND_GO) as notes:
        stopping, common = _stop_and_go((begin, end), goals, context, searches)
        notes.append("certified" if common is not None else stopping)
        if common is not None and not context.work.exhausted:
            near = portfolio.refinement.coarse_along(common.trajectory, common.path)
            portfolio.offer(FLOWING, common.path, near)
    ends = Ends(start, goals)
    away = np.abs(goals - start).max(axis=1).min() > _AWAY
    paths = first_paths(ends, space, context, searches, briefly=True) if away else []
    if away and not paths and common is None:
        paths = first_paths(ends, space, context, searches, briefly=False)
    best = _best_of(ends, paths, portfolio, searches)
    if common is not None and (best is None or common.cost < best[1].cost):
        best = STOP_AND_GO, common
    if best is None:
        return _refusal(stopping, context), None
    context.journal.planner_id, movement = best
    if context.options.objective == "movement_cost":  # W of its waypoints is asked for
        movement = over_free_steps(movement, space)
    return Status.success(), movement


def _best_of(
    ends: Ends, paths: list[Path], portfolio: Portfolio, searches: Searches
) -> tuple[str, Movement] | None:
    """The best movement that comes of the portfolio and of free paths: with little work, as a robot
    that moves doesn't wait; with more where the request names some.
    """
    context = portfolio.context
    if paths and context.options.max_iterations:
        improve(ends, paths, portfolio, context, searches)
        return portfolio.best()
    with context.journal.stage("refine"):
        if paths:
            portfolio.add(paths[0][0], [path for _, path in paths])
        portfolio.refine_best(_REFINED)
    return portfolio.best()


def _refusal(stopping: str, context: Context) -> Status:
    tried = "; ".join(f"{reason} ({n})" for reason, n in context.journal.rejected.items())
    lasting = context.options.duration
    asked = f" of {lasting:g} s" if lasting > 0.0 else ""
    longer = "another duration, " if lasting > 0.0 else ""
    return Status(
        StatusCode.PLANNING_FAILED,
        f"no movement{asked} with this motion at its ends was found; {STOP_AND_GO}: {stopping}"
        f"{'; ' if tried else ''}{tried}; {longer}a slower start, or an earlier one, may help",
    )


# What no movement can avoid: the exact least that a joint does whose acceleration falls with its
# largest jerk.


def check_driveable(end: MovingEnd, context: Context) -> None:
    """Raise RequestError where no movement within the limits begins with this motion."""
    robot = context.scene.cell.robot
    for joint in range(len(robot.joint_names)):
        _check_joint(end, joint, context)
    most = 1.0 - context.scene.drives.torque_reserve
    forwards = end.qd if end.what == "start" else -end.qd
    use = torque_use(context.scene.dynamics, end.q[None], forwards[None], end.qdd[None])[0]
    heaviest = int(np.argmax(use))
    if use[heaviest] > most * (1.0 + _SLACK):
        raise _undriveable(
            end,
            f"{robot.joint_names[heaviest]} needs {use[heaviest]:.4g} of its torque there: at most "
            f"{most:.4g} may be used",
        )


def _check_joint(end: MovingEnd, j: int, context: Context) -> None:
    """Raise RequestError where one joint exceeds its limits there, or can't but exceed them soon:
    its acceleration falls with the jerk limit, and it brakes before its end of travel.
    """
    limits = context.limits
    robot = context.scene.cell.robot
    name = robot.joint_names[j]
    v = float(end.qd[j])
    a = float(end.qdd[j])
    unit = "rad" if j >= robot.base else "m"
    bounds = (
        (abs(v), limits.velocity[j], "velocity", f"{unit}/s"),
        (abs(a), limits.acceleration[j], "acceleration", f"{unit}/s^2"),
    )
    for value, bound, kind, of_it in bounds:
        if not value <= bound * (1.0 + _SLACK):
            raise _undriveable(
                end,
                f"{name} has {kind} {value:.6g} {of_it}: it must be at most {bound:.6g} "
                f"{of_it}, exceeded by {value - bound:.3g} {of_it}",
            )
    rising = abs(v) + a * a / (2.0 * limits.jerk[j]) if a * v > 0.0 else 0.0
    if rising > limits.velocity[j] * (1.0 + _SLACK):
        raise _undriveable(
            end,
            f"{name} has velocity {abs(v):.6g} {unit}/s and acceleration {abs(a):.6g} "
            f"{unit}/s^2, which falls with {limits.jerk[j]:g} {unit}/s^3: it reaches "
            f"{rising:.6g} {unit}/s, it must be at most {limits.velocity[j]:.6g} {unit}/s",
        )
    turned = "goes on" if end.what == "start" else "comes"
    for side, limit in ((1.0, robot.position_max[j]), (-1.0, robot.position_min[j])):
        needed = stopping_distance(
            side * v, side * a, float(limits.acceleration[j]), float(limits.jerk[j])
        )
        left = side * (float(limit) - float(end.q[j]))
        if needed > left + _POSITION:
            raise _undriveable(
                end,
                f"{name} {turned} {robot.shown(j, needed, 4)} with {abs(v):.4g} {unit}/s, "
                f"however it brakes: {robot.shown(j, left, 4)} are left to its limit of "
                f"{robot.shown(j, limit)}",
            )


def _undriveable(end: MovingEnd, sentence: str) -> RequestError:
    return RequestError(end.code, f"{end.what} in motion: {sentence}")


def stopping_distance(v: float, a: float, acceleration: float, jerk: float) -> float:
    """How far [rad] a joint with v [rad/s] and a [rad/s^2] goes on at least in the positive
    direction until it turns, within its acceleration and jerk; 0 where it doesn't get beyond its
    place.
    """
    until = (a + acceleration) / jerk  # s, to its largest braking
    slowest = v + until * (a - 0.5 * jerk * until)
    if slowest <= 0.0:
        square = a * a + 2.0 * jerk * v
        t = (a + np.sqrt(square)) / jerk if square >= 0.0 else 0.0
        return max(float(t * (v + t * (0.5 * a - jerk * t / 6.0))), 0.0)
    gone = until * (v + until * (0.5 * a - jerk * until / 6.0))
    return max(float(gone + slowest * slowest / (2.0 * acceleration)), 0.0)


# The stop and go: what is done today by who can't join a movement that is driven.


def braking(end: MovingEnd, context: Context) -> JointTrajectory | None:
    """The shortest stop of all joints together, each by the cubic speed from its motion to rest,
    within limits and torque; None where there is none.
    """
    limits = context.limits
    speed = np.abs(end.qd)
    shortest = max(
        _SHORTEST,
        float(np.max(1.5 * speed / limits.acceleration)),
        float(np.max(np.sqrt(2.0 * speed / limits.jerk))),
        float(np.max(np.abs(end.qdd) / limits.jerk)),
    )
    most = 1.0 - context.scene.drives.torque_reserve
    seconds = shortest
    for _ in range(_TRIES):
        trajectory = _stop_lasting(end, seconds, context)
        forwards = trajectory if end.what == "start" else _backwards(trajectory)
        if _is_within_limits(trajectory, context) and (
            torque_proof(forwards, context.scene, most * TORQUE_SHARES[0]).violation is None
        ):
            return trajectory
        seconds *= _LONGER
    return None


def _stop_lasting(end: MovingEnd, seconds: float, context: Context) -> JointTrajectory:
    step = int(np.ceil(seconds * 1e9))
    T = step * 1e-9
    rest = np.zeros_like(end.q)
    stands = end.q + T * (0.5 * end.qd + T / 12.0 * end.qdd)
    return JointTrajectory(
        context.joint_names,
        np.array([0, step], dtype=np.int64),
        np.stack([end.q, stands]),
        np.stack([end.qd, rest]),
        np.stack([end.qdd, rest]),
    )


def _is_within_limits(trajectory: JointTrajectory, context: Context) -> bool:
    """Whether a trajectory keeps the context's limits at every instant, and the joints' range."""
    bounds = context.limits
    robot = context.scene.cell.robot
    largest = extremes(*trajectory.coefficients())
    kept = (
        (largest.velocity <= bounds.velocity * (1.0 + _SLACK)).all()
        and (largest.acceleration <= bounds.acceleration * (1.0 + _SLACK)).all()
        and (largest.jerk <= bounds.jerk * (1.0 + _SLACK)).all()
    )
    inside = (largest.lowest >= robot.position_min - _POSITION) & (
        largest.highest <= robot.position_max + _POSITION
    )
    return bool(kept and inside.all())


def _stop_and_go(
    ends: tuple[MovingEnd, MovingEnd],
    goals: FloatArray,
    context: Context,
    searches: Searches,
) -> tuple[str, Movement | None]:
    """The movement that brakes, goes from rest to rest and gets up to speed, certified; or None and
    why there is none.
    """
    begin, end = ends
    stop, why = _proved_stop(begin, context)
    run_up, why_not = _proved_stop(end, context)
    if stop is None or run_up is None:
        return why or why_not, None
    lasting = context.options.duration
    stops = stop.duration + run_up.duration
    if 0.0 < lasting <= stops:
        return f"stops alone take {stops:.3f} s, {lasting:g} s are asked", None
    stands = stop.positions[-1]
    targets = goals if end.at_rest else run_up.positions[-1:]
    asked = replace(context.options, duration=lasting - stops if lasting > 0.0 else 0.0)
    resting = replace(context, options=asked, motion=None)
    try:
        why, between = _from_rest_to_rest(stands, targets, resting, searches)
    except (RequestError, TimingError) as error:
        return str(error), None
    if between is None:
        return why, None
    whole = stop.then(between.trajectory)
    path = np.concatenate([begin.q[None], between.path])
    if not end.at_rest:
        whole = whole.then(_backwards(run_up))
        path = np.concatenate([path, end.q[None]])
    common = Movement(distinct(path), whole, context)
    violation = common.prove().violation
    if violation is not None:
        return violation.sentence, None
    return "", common


def _proved_stop(end: MovingEnd, context: Context) -> tuple[JointTrajectory | None, str]:
    """The stop of an end, one point where it rests; or None and why it isn't proved."""
    if end.at_rest:
        return _trajectory_at_rest(end, context), ""
    stop = braking(end, context)
    if stop is None:
        return None, f"the {end.what} has no stop within all limits"
    near = clearance_violation(stop, context.scene, context.safety_distance, context.station)
    if near is not None:
        begins = (
            "stop from the start" if end.what == "start" else "way up to speed, seen from the goal"
        )
        return None, f"on the shortest {begins} {near.sentence}"
    return stop, ""


def _trajectory_at_rest(end: MovingEnd, context: Context) -> JointTrajectory:
    rest = np.zeros((1, len(end.q)))
    return JointTrajectory(context.joint_names, np.zeros(1, np.int64), end.q[None], rest, rest)


def _from_rest_to_rest(
    start: FloatArray, goals: FloatArray, context: Context, searches: Searches
) -> tuple[str, Movement | None]:
    """The movement near the first free path between them, or why there is none: with little work,
    most of it goes into movements that don't rest in between.
    """
    cone = context.cone
    space = FreeSpace.of(context.scene, context.safety_distance, context.work, cone=cone)
    blocked = end_in_collision(start, goals[0], space, context.safety_distance)
    blocked = blocked or end_outside_cone(start, goals[0], cone)
    if blocked is not None:
        return blocked.message, None
    ends = Ends(start, goals)
    paths = first_paths(ends, space, context, searches, briefly=True)
    paths = paths or first_paths(ends, space, context, searches, briefly=False)
    if not paths:
        return "no path from where it stands was found", None
    portfolio = Portfolio(space, Refinement(context))
    best = None
    if np.abs(goals - start).max(axis=1).min() > STILL:
        portfolio.add(paths[0][0], [path for _, path in paths])
        portfolio.refine_best(1)
        best = portfolio.best()
    best = best or portfolio.in_straight_steps(paths)
    return "no movement from where it stands was certified", None if best is None else best[1]


def _backwards(trajectory: JointTrajectory) -> JointTrajectory:
    """The same motion the other way round in time."""
    assert trajectory.velocities is not None
    assert trajectory.accelerations is not None
    return JointTrajectory(
        trajectory.joint_names,
        (trajectory.times_ns[-1] - trajectory.times_ns)[::-1].copy(),
        trajectory.positions[::-1],
        -trajectory.velocities[::-1],
        trajectory.accelerations[::-1],
    )
