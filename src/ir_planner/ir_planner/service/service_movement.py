"""Service movement, stage two: several certified paths out of a machine's work area, or into it.

From the interaction configuration to outside the zone by `withdrawal`; the entry is the reverse.
Each path gets its time within speed, acceleration, jerk and torque with what is held, and is
verified with the station's allowed contacts. The best by the objective come first, then by
clearance, then by time.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ir_description import Station
from ir_kernels import portable
from ir_msgs_py.report import PlanningInfo, ServiceCandidate, TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_planner.checks import (
    CLOSEST,
    PATH,
    ZONES,
    Colour,
    FreeSpace,
    Shape,
    leans,
    nearest_pair,
    too_near,
)
from ir_planner.configurations import free_configurations, no_configuration
from ir_planner.errors import RequestError, TimingError
from ir_planner.optimize import movement_over
from ir_planner.presentation import in_mm, plot_trajectory, result_text
from ir_planner.request import Context, Journal
from ir_planner.scene import PlanningScene
from ir_planner.service.exit import Exit, ExitSearch
from ir_planner.service.exit_paths import (
    EXIT_SEARCHES,
    ExitPath,
    Withdrawal,
    known_method,
    withdrawal,
)
from ir_planner.timing import Movement, objective_value
from ir_values.arrays import FloatArray

EXIT = "exit"
ENTRY = "entry"
CANDIDATES_MAX = 20  # trajectories in one answer
_BRANCHES = 4  # configurations that are tried: each that fails costs a whole search
_SAME_BRANCH = 1e-6  # rad


@dataclass(frozen=True, eq=False)
class ServiceRequest:
    """configuration (n,): at the station, None: the best. near (n,): where the cost of
    configurations counts from.
    """

    station: Station
    direction: str
    configuration: FloatArray | None
    near: FloatArray
    max_candidates: int = 3


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


def work_configurations(
    request: ServiceRequest, context: Context
) -> tuple[list[FloatArray], Status]:
    """Free configurations (n,) at the station to start from, one per branch, best first; or none
    and why.
    """
    scene = context.scene
    margin = context.safety_distance
    name = request.station.name
    inside = FreeSpace.of(scene, margin, context.work, name)
    if request.configuration is not None:
        q = request.configuration
        if inside.states_free(q[None])[0]:
            return [q], Status.success()
        entering = request.direction == ENTRY
        code = StatusCode.GOAL_IN_COLLISION if entering else StatusCode.START_STATE_IN_COLLISION
        return [], Status(code, too_near(q, inside, "goal" if entering else "start", margin))
    found = free_configurations(request.station.pose, scene, inside.threshold, request.near)
    context.journal.rejected.update(found.rejected)
    if len(found.q) == 0:
        status = no_configuration(request.station.pose, scene, found, f"station {name}")
        return [], Status(
            status.code, status.message + _best_clearance(request.station.pose, inside)
        )
    chosen: list[FloatArray] = []
    for q in found.q:
        if all(np.abs(portable.sin(0.5 * (q - other))).max() > _SAME_BRANCH for other in chosen):
            chosen.append(q)
    return chosen[:_BRANCHES], Status.success()


def _best_clearance(pose: FloatArray, inside: FreeSpace) -> str:
    """What the freest of the configurations that reach a pose comes to; "" where none reaches
    it.
    """
    q = inside.scene.inverse_kinematics.solve(np.asarray(pose)[None]).q
    if len(q) == 0:
        return ""
    near = inside.scene.collision.min_distance(q, inside.threshold)
    best = int(np.argmax(near.distance - inside.threshold[near.pair]))
    pair = inside.scene.collision.pairs[int(near.pair[best])]
    distance, bound = in_mm(float(near.distance[best]), float(inside.threshold[near.pair[best]]))
    return (
        f"; the best clearance is {distance} mm between {pair.body_a} and "
        f"{pair.body_b}, it must be more than {bound} mm"
    )


@dataclass(frozen=True, eq=False)
class ServicePlan:
    """Ranked candidates with their trajectories; empty unless the status is SUCCESS."""

    status: Status
    candidates: tuple[ServiceCandidate, ...]
    info: PlanningInfo

    def __repr__(self) -> str:
        if not self.candidates:
            return result_text("ServicePlan", self.status, TrajectoryReport(), "")
        best = self.candidates[0]
        count = f"first of {len(self.candidates)}"
        return result_text("ServicePlan", self.status, best.report, best.trajectory_id, count)

    def plot(self) -> Any:
        """Angles and speeds of the first candidate over time; a matplotlib figure."""
        best = self.candidates[0].trajectory if self.candidates else None
        return plot_trajectory(best, repr(self))


def plan_service(
    request: ServiceRequest, context: Context, searches: Mapping[str, ExitSearch] = EXIT_SEARCHES
) -> ServicePlan:
    """Plan a service movement. Raises RequestError for options that can't be met, CancelledError
    when asked to stop.
    """
    status, candidates = _search(request, context.at(request.station.name), searches)
    start = (
        candidates[0].trajectory.positions[0] if candidates and candidates[0].trajectory else None
    )
    return ServicePlan(status, candidates, context.journal.info(start, context.joint_names))


def _search(
    request: ServiceRequest, context: Context, searches: Mapping[str, ExitSearch]
) -> tuple[Status, tuple[ServiceCandidate, ...]]:
    """Ways out from one work configuration after the other, those first that rank first, until one
    has a certified candidate; the status of the last that failed.
    """
    journal = context.journal
    method = known_method(context.options.planner_id)
    with journal.stage("configurations") as notes:
        interaction, status = work_configurations(request, context)
        notes.append(f"{len(interaction)} to try")
    if not status.ok:
        return status, ()
    failed = Status(StatusCode.PLANNING_FAILED, "nothing was tried")
    untimed = Counter[str]()
    for q in interaction:
        upright = context.upright_from(q)
        leaning = _leaning(q, request, upright)
        if leaning is not None:
            failed = leaning
            continue
        problem = Exit.of(q, upright)
        found = withdrawal(problem, request.max_candidates, method, searches, journal)
        with journal.stage("timing") as notes:
            timed = [_timed(path, request, upright, untimed) for path in found.paths]
            certified = [movement for movement in timed if movement is not None]
            notes.append(f"{len(certified)} of {len(timed)} certified")
        if certified:
            journal.planner_id = certified[0][0].method
            ranked = _ranked(certified, context)
            journal.timing = ranked[0][1].timing
            return Status.success(), tuple(
                _candidate(path, movement, context) for path, movement in ranked
            )
        failed = blocked(found, problem, journal, untimed)
        if journal.work.exhausted:
            break
    return failed, ()


def _leaning(q: FloatArray, request: ServiceRequest, context: Context) -> Status | None:
    """The status where the tool leans too far at the station (n,); None where it doesn't."""
    cone = context.cone
    if cone is None or cone.holds(q[None])[0]:
        return None
    entering = request.direction == ENTRY
    code = (
        StatusCode.GOAL_VIOLATES_PATH_CONSTRAINTS
        if entering
        else StatusCode.START_STATE_VIOLATES_PATH_CONSTRAINTS
    )
    return Status(code, leans(float(cone.tilts(q[None])[0]), cone, f"at {request.station.name}"))


def _timed(
    path: ExitPath, request: ServiceRequest, context: Context, untimed: Counter[str]
) -> tuple[ExitPath, Movement] | None:
    """The certified movement over an exit path; None with its reason counted, in `untimed` too."""
    points = path.points[::-1] if request.direction == ENTRY else path.points
    try:
        movement = movement_over(points, context)
    except TimingError as error:
        reason = f"torque: {error}"
    else:
        violation = movement.prove().violation
        if violation is None:
            return path, movement
        reason = f"not proved: {violation.what}"
    context.journal.reject(reason)
    untimed[reason] += 1
    return None


def _ranked(
    certified: list[tuple[ExitPath, Movement]], context: Context
) -> list[tuple[ExitPath, Movement]]:
    """The best by the objective first, then by clearance, then by time."""
    options = context.options

    def key(entry: tuple[ExitPath, Movement]) -> tuple[float, float, float]:
        report = entry[1].report
        cost = objective_value(report, options.objective, options.time_value)
        return round(cost, 6), -report.min_clearance, report.duration

    return sorted(certified, key=key)


def _candidate(path: ExitPath, movement: Movement, context: Context) -> ServiceCandidate:
    return ServiceCandidate(
        method=path.method,
        joint_names=context.joint_names,
        work=path.points[0],
        outside=path.points[-1],
        trajectory_id=movement.trajectory.trajectory_id,
        trajectory=movement.trajectory,
        report=movement.report,
    )


def blocked(
    found: Withdrawal, problem: Exit, journal: Journal, untimed: Mapping[str, int]
) -> Status:
    """The status where no path was found: how far out, with which clearance there, and what
    obstructed; untimed: why paths that were found made no movement.
    """
    scene = problem.inside.scene
    station = problem.area.station
    pair = nearest_pair(scene, found.farthest, problem.inside.threshold)
    clearance = (
        ""
        if pair is None
        else f" (clearance there {pair.distance * 1e3:.1f} mm, {pair.body_a} to {pair.body_b})"
    )
    depth = max(problem.safety_distance - found.zone_distance, 0.0)
    ceiling = journal.work.ended_by
    cut = f" within {ceiling}" if ceiling else ""
    obstructing = (
        ", ".join(f"{reason} ({count})" for reason, count in found.obstructed.most_common(4))
        or "nothing met"
    )
    tried = ", ".join(f"{stage.name} ({stage.note})" for stage in journal.stages if stage.note)
    reasons = "; ".join(f"{reason} ({n})" for reason, n in untimed.items())
    sentence = (
        f"no path out of station {station.name} found{cut}: the configuration farthest out lacks "
        f"{depth * 1e3:.0f} mm to leave the zone of {station.equipment}{clearance}; obstructing: "
        f"{obstructing}{'; ' + reasons if reasons else ''}; tried: {tried}; another "
        "configuration, an opened door or a smaller safety distance may help"
    )
    return Status(StatusCode.PLANNING_FAILED, sentence)


_NONE = np.zeros((0, 3))
_OTHERS: Colour = (0.45, 0.6, 0.85, 0.7)  # candidates after the best
_WHITE: Colour = (1.0, 1.0, 1.0, 1.0)
_SAMPLES = 60


def service_shapes(
    candidates: Sequence[ServiceCandidate], station: str, scene: PlanningScene
) -> tuple[Shape, ...]:
    """Shapes of ranked candidates at a station: the best path is thick, its closest pair has a
    label.
    """
    machine = scene.cell.machine(scene.station(station).equipment)
    zone = machine.zone
    shapes = []
    if machine.enabled:
        red, green, blue, alpha = ZONES[zone.kind]
        colour = (red, green, blue, min(2.0 * alpha, 1.0))
        shapes.append(Shape("service_zone", "box", zone.pose, zone.size, colour, _NONE))
    for rank, candidate in enumerate(candidates):
        if candidate.trajectory is None:
            continue
        times = np.linspace(candidate.trajectory.times[0], candidate.trajectory.times[-1], _SAMPLES)
        path = scene.chain.tcp_poses(candidate.trajectory.sample(times).q)[:, :3, 3]
        width = np.array([0.006 if rank else 0.014, 0.0, 0.0])
        colour = _OTHERS if rank else PATH
        shapes.append(Shape("service_candidates", "line", np.eye(4), width, colour, path))
        shapes.extend(_closest(candidate, rank == 0))
    return tuple(shapes)


def _closest(candidate: ServiceCandidate, labelled: bool) -> list[Shape]:
    """The line between the closest points of the path's nearest pair, and its label."""
    pair = candidate.report.closest
    if pair is None:
        return []
    ends = np.stack([pair.point_a, pair.point_b])
    shapes = [
        Shape("service_closest", "line", np.eye(4), np.array([0.012, 0.0, 0.0]), CLOSEST, ends)
    ]
    if labelled:
        pose = np.eye(4)
        pose[:3, 3] = ends.mean(axis=0) + np.array([0.0, 0.0, 0.05])
        text = f"{candidate.method}: {pair.distance * 1e3:.1f} mm {pair.body_a} - {pair.body_b}"
        shapes.append(Shape("service_closest", "text", pose, np.full(3, 0.06), _WHITE, _NONE, text))
    return shapes
