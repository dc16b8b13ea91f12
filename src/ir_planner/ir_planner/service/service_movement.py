"""Service movement, stage two: several certified ways out of a machine's work area, or into it.

From the work configuration to outside the zone by ways_out; the entry is the reverse. Each way gets its
time within speed, acceleration, jerk and torque with what is held, and is verified with the station's
allowed contacts. The best by the objective come first, then by clearance, then by time.
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import PlanningInfo
from ir_msgs_py.stations import ServiceCandidate
from ir_msgs_py.status import Status, StatusCode

from ir_description import Station
from ir_planner.checks import FreeSpace, nearest_pair, too_near
from ir_planner.configurations import free_configurations, no_configuration
from ir_planner.errors import RequestError, TimingError
from ir_planner.optimize import movement_over
from ir_planner.request import Journal, Work
from ir_planner.scene import PlanningScene
from ir_planner.service.settings import WithdrawalSettings
from ir_planner.service.withdrawal_paths import Exit, Way, Ways, known_method, ways_out
from ir_planner.timing import TimedMovement, objective_value

EXIT, ENTRY = "exit", "entry"
CANDIDATES_MAX = 20
_BRANCHES = 4  # work configurations that are tried
_SAME_BRANCH = 1e-6  # rad


@dataclass(frozen=True, eq=False)
class ServiceRequest:
    """configuration (n,): at the station, None: the best. near (n,): where the cost of configurations counts
    from.
    """

    station: Station
    direction: str
    configuration: FloatArray | None
    near: FloatArray
    max_candidates: int = 3


@dataclass(frozen=True, eq=False)
class ServicePlan:
    """Ranked candidates with their trajectories; empty unless the status is SUCCESS."""

    status: Status
    candidates: tuple[ServiceCandidate, ...]
    info: PlanningInfo


def plan_service(
    request: ServiceRequest,
    scene: PlanningScene,
    options: PlanOptions,
    settings: WithdrawalSettings,
    work: Work,
) -> ServicePlan:
    """Plan a service movement. Raises RequestError for options that can't be met, CancelledError when asked
    to stop.
    """
    journal = Journal(work, options.seed)
    status, candidates = _search(request, scene, options, settings, journal)
    start = candidates[0].trajectory.positions[0] if candidates and candidates[0].trajectory else None
    return ServicePlan(status, candidates, journal.info(start, scene.cell.robot.joint_names))


def _search(
    request: ServiceRequest,
    scene: PlanningScene,
    options: PlanOptions,
    settings: WithdrawalSettings,
    journal: Journal,
) -> tuple[Status, tuple[ServiceCandidate, ...]]:
    method = known_method(options.planner_id)
    with journal.stage("configurations") as notes:
        interaction, status = work_configurations(request, scene, options.safety_distance, journal)
        notes.append(f"{len(interaction)} to try")
    if not status.ok:
        return status, ()
    failed = Status(StatusCode.PLANNING_FAILED, "nothing was tried")
    for q in interaction:
        problem = Exit.of(q, scene, request.station, options.safety_distance, journal.work)
        found = ways_out(problem, settings, request.max_candidates, method, journal)
        with journal.stage("timing") as notes:
            timed = [_timed(way, request, scene, options, journal) for way in found.ways]
            certified = [movement for movement in timed if movement is not None]
            notes.append(f"{len(certified)} of {len(timed)} certified")
        if certified:
            journal.planner_id = certified[0][0].method
            return Status.success(), _ranked(certified, request, scene, options)
        failed = blocked(found, problem, journal)
        if journal.work.exhausted:
            break
    return failed, ()


def work_configurations(
    request: ServiceRequest, scene: PlanningScene, safety_distance: float, journal: Journal
) -> tuple[list[FloatArray], Status]:
    """Free configurations at the station to start from, one per branch, best first; or none and why."""
    inside = FreeSpace.of(scene, safety_distance, journal.work, request.station.name)
    if request.configuration is not None:
        q = request.configuration
        if inside.states_free(q[None])[0]:
            return [q], Status.success()
        entering = request.direction == ENTRY
        code = StatusCode.GOAL_IN_COLLISION if entering else StatusCode.START_STATE_IN_COLLISION
        what = "goal" if entering else "start"
        return [], Status(code, too_near(q, inside, what, safety_distance))
    found = free_configurations(request.station.pose, scene, inside.threshold, request.near)
    journal.rejected.update(found.rejected)
    if len(found.q) == 0:
        status = no_configuration(request.station.pose, scene, found, f"station {request.station.name}")
        return [], Status(status.code, status.message + _best_clearance(request.station.pose, inside))
    chosen: list[FloatArray] = []
    for q in found.q:
        if all(np.abs(np.sin(0.5 * (q - other))).max() > _SAME_BRANCH for other in chosen):
            chosen.append(q)
    return chosen[:_BRANCHES], Status.success()


def _best_clearance(pose: FloatArray, inside: FreeSpace) -> str:
    """What the freest of the configurations that reach a pose comes to; "" where none reaches it."""
    q = inside.scene.inverse_kinematics.solve(np.asarray(pose)[None]).q
    if len(q) == 0:
        return ""
    near = inside.scene.collision.min_distance(q, inside.threshold)
    best = int(np.argmax(near.distance - inside.threshold[near.pair]))
    pair = inside.scene.collision.pairs[int(near.pair[best])]
    return (
        f"; the best clearance is {near.distance[best] * 1e3:.1f} mm between {pair.body_a} and "
        f"{pair.body_b}, it must be more than {inside.threshold[near.pair[best]] * 1e3:.1f} mm"
    )


def _timed(
    way: Way, request: ServiceRequest, scene: PlanningScene, options: PlanOptions, journal: Journal
) -> tuple[Way, TimedMovement] | None:
    """The certified movement over a way, or None with its reason counted."""
    points = way.points[::-1] if request.direction == ENTRY else way.points
    try:
        movement = movement_over(points, scene, options, journal.work, request.station.name)
    except TimingError as error:
        journal.reject(f"torque: {error}")
        return None
    if movement.violation is not None:
        journal.reject(f"not proved: {movement.violation.what}")
        return None
    return way, movement


def _ranked(
    certified: list[tuple[Way, TimedMovement]],
    request: ServiceRequest,
    scene: PlanningScene,
    options: PlanOptions,
) -> tuple[ServiceCandidate, ...]:
    names = scene.cell.robot.joint_names

    def key(entry: tuple[Way, TimedMovement]) -> tuple[float, float, float]:
        report = entry[1].evaluation.report
        cost = objective_value(report, options.objective, options.time_value)
        return round(cost, 6), -report.min_clearance, report.duration

    return tuple(
        ServiceCandidate(
            method=way.method,
            joint_names=names,
            work=way.points[0],
            outside=way.points[-1],
            trajectory_id=movement.trajectory.trajectory_id,
            trajectory=movement.trajectory,
            report=movement.evaluation.report,
        )
        for way, movement in sorted(certified, key=key)
    )


def blocked(found: Ways, problem: Exit, journal: Journal) -> Status:
    """The status where no way was found: how far out, with which clearance there, and what was in the way."""
    scene, station = problem.inside.scene, problem.area.station
    pair = nearest_pair(scene, found.farthest, problem.inside.threshold)
    clearance = (
        ""
        if pair is None
        else f" (clearance there {pair.distance * 1e3:.1f} mm, {pair.body_a} to {pair.body_b})"
    )
    depth = max(problem.safety_distance - found.zone_distance, 0.0)
    cut = " within planning_time" if journal.work.truncated else ""
    met = Counter({reason: n for reason, n in found.met.items() if "too near" in reason})
    way = ", ".join(f"{reason} ({count})" for reason, count in met.most_common(4)) or "nothing met"
    tried = ", ".join(f"{stage.name} ({stage.note})" for stage in journal.stages if stage.note)
    reasons = "; ".join(
        f"{r} ({n})" for r, n in journal.rejected.items() if r.startswith(("torque", "not proved"))
    )
    sentence = (
        f"no way out of station {station.name} found{cut}: the configuration farthest out lacks "
        f"{depth * 1e3:.0f} mm to leave the zone of {station.equipment}{clearance}; in the way: {way}"
        f"{'; ' + reasons if reasons else ''}; tried: {tried}; another configuration, an opened door or a "
        "smaller safety distance may help"
    )
    return Status(StatusCode.PLANNING_FAILED, sentence)


def checked_request(direction: str, max_candidates: int) -> None:
    """Raise RequestError for a direction or a number of candidates that makes no sense."""
    if direction not in (EXIT, ENTRY):
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"direction {direction[:60]!a} is unknown: known are {EXIT}, {ENTRY}",
        )
    if not 1 <= max_candidates <= CANDIDATES_MAX:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"max_candidates is {max_candidates}: it must be in [1, {CANDIDATES_MAX}]",
        )
