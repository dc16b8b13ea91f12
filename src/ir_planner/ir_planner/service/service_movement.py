"""Service movement, stage two: several certified paths out of a machine's work area, or into it.

From the interaction configuration to outside the zone by `withdrawal`; the entry is the reverse.
Each path gets its time within speed, acceleration, jerk and torque with what is held, and is
verified with the station's allowed contacts. The best by the objective come first, then by
clearance, then by time.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ir_msgs_py.report import PlanningInfo, ServiceCandidate, TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_planner.checks import nearest_pair
from ir_planner.errors import TimingError
from ir_planner.optimize import movement_over
from ir_planner.presentation import plot_trajectory, result_text
from ir_planner.request import Context, Journal
from ir_planner.service.exit import Exit
from ir_planner.service.exit_search import ExitSearch
from ir_planner.service.withdrawals import (
    EXIT_SEARCHES,
    ExitPath,
    Withdrawal,
    known_method,
    withdrawal,
)
from ir_planner.service.work_configurations import ENTRY, ServiceRequest, work_configurations
from ir_planner.timing import Movement, objective_value


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
    journal = context.journal
    method = known_method(context.options.planner_id)
    with journal.stage("configurations") as notes:
        interaction, status = work_configurations(request, context)
        notes.append(f"{len(interaction)} to try")
    if not status.ok:
        return status, ()
    failed = Status(StatusCode.PLANNING_FAILED, "nothing was tried")
    for q in interaction:
        problem = Exit.of(q, context)
        found = withdrawal(problem, request.max_candidates, method, searches, journal)
        with journal.stage("timing") as notes:
            timed = [_timed(path, request, context) for path in found.paths]
            certified = [movement for movement in timed if movement is not None]
            notes.append(f"{len(certified)} of {len(timed)} certified")
        if certified:
            journal.planner_id = certified[0][0].method
            ranked = _ranked(certified, context)
            journal.timing = ranked[0][1].timing
            return Status.success(), tuple(
                _candidate(path, movement, context) for path, movement in ranked
            )
        failed = blocked(found, problem, journal)
        if journal.work.exhausted:
            break
    return failed, ()


def _timed(
    path: ExitPath, request: ServiceRequest, context: Context
) -> tuple[ExitPath, Movement] | None:
    """The certified movement over an exit path, or None with its reason counted."""
    points = path.points[::-1] if request.direction == ENTRY else path.points
    try:
        movement = movement_over(points, context)
    except TimingError as error:
        context.journal.reject(f"torque: {error}")
        return None
    if movement.violation is not None:
        context.journal.reject(f"not proved: {movement.violation.what}")
        return None
    return path, movement


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


def blocked(found: Withdrawal, problem: Exit, journal: Journal) -> Status:
    """The status where no path was found: how far out, with which clearance there, and what
    obstructed.
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
    cut = " within planning_time" if journal.work.truncated else ""
    met = Counter({reason: n for reason, n in found.rejected.items() if "too near" in reason})
    obstructing = (
        ", ".join(f"{reason} ({count})" for reason, count in met.most_common(4)) or "nothing met"
    )
    tried = ", ".join(f"{stage.name} ({stage.note})" for stage in journal.stages if stage.note)
    reasons = "; ".join(
        f"{r} ({n})" for r, n in journal.rejected.items() if r.startswith(("torque", "not proved"))
    )
    sentence = (
        f"no path out of station {station.name} found{cut}: the configuration farthest out lacks "
        f"{depth * 1e3:.0f} mm to leave the zone of {station.equipment}{clearance}; obstructing: "
        f"{obstructing}{'; ' + reasons if reasons else ''}; tried: {tried}; another "
        "configuration, an opened door or a smaller safety distance may help"
    )
    return Status(StatusCode.PLANNING_FAILED, sentence)
