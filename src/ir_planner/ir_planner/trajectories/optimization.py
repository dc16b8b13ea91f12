"""A trajectory that came from anywhere becomes cheaper between the same end points, and is proved.

Its path is fitted by uniform splines (with its own speed profile, with an even one, and with
corners left out), which are optimised for the objective; the best that is certified is the answer,
unless the original is and costs less. A path that hits something is pushed out of it by the same
descent; where that fails, new paths are searched. The trade of time for energy comes with the
answer.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ir_kernels import portable
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import PlanningInfo, TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import AT_REST, SLACK, FreeSpace, end_in_collision, end_outside_cone
from ir_planner.curves import UniformSpline, evenly_spaced
from ir_planner.errors import RequestError
from ir_planner.optimize import Descents, path_of
from ir_planner.presentation import plot_front, result_text
from ir_planner.regional import Searches, search_regional
from ir_planner.request import DURATION_MAX, Context, Journal, Work, bounded, within_limits
from ir_planner.scene import STILL, PlanningScene
from ir_planner.search import fewest_corners
from ir_planner.timing import Movement, at_the_mains, request_cost
from ir_values.arrays import FloatArray

# Time against energy: certified movements between the fastest and the one of least energy at the
# mains.
#
# Each is optimised at a duration of its own, from its neighbour among others. Energy is E_mains:
# beyond the duration at which it is least, slower costs more of both.

COUNT = 8  # durations from the fastest to the slowest end
# factors on duration or energy by which neighbours of a thinned front differ
_APART = (
    1.005,
    0.98,
)


def pareto_front(known: list[Movement], context: Context) -> tuple[Movement, ...]:
    """The non-dominated of the known certified movements and of those that are optimised from the
    first of them: durations increase, energies fall. The request's own objective and duration don't
    count.

    Ends early where the budget is exhausted. Raises CancelledError when asked to stop.
    """
    points = list(known)

    def descend(start: Movement, context_of_front: Context) -> Movement | None:
        if context.work.exhausted:
            return None
        rounds = 1 if context_of_front.options.duration > 0.0 else 3
        try:
            improved = Descents(context_of_front).improved(start.trajectory, rounds=rounds)
        except RequestError:  # longer than a movement may be
            return None
        if improved is not None:
            points.append(improved)
        return improved

    fastest = context.asking("time")
    for context_of_front in (at_the_mains(context), fastest):
        descend(points[0], context_of_front)
    ends = non_dominated(points)
    neighbour = ends[-1]
    between = portable.geomspace(ends[0].report.duration, ends[-1].report.duration, COUNT)[1:-1]
    for duration in between[::-1] if len(ends) > 1 else ():  # slow movements lead to fast ones
        neighbour = descend(neighbour, context.asking("energy", float(duration))) or neighbour
    descend(neighbour, fastest)
    return non_dominated(points)


def non_dominated(points: list[Movement]) -> tuple[Movement, ...]:
    """Those beside which no other is as quick and takes as little energy; by duration."""
    front: list[Movement] = []
    for point in sorted(points, key=lambda point: (point.report.duration, point.report.energy)):
        if not front or point.report.energy < front[-1].report.energy:
            front.append(point)
    return tuple(front)


def thinned(front: tuple[Movement, ...]) -> tuple[Movement, ...]:
    """A front without points that hardly differ from the one before; both ends stay."""
    points = list(front[:1])
    for point in front[1:]:
        last = points[-1].report
        longer = point.report.duration / last.duration
        cheaper = point.report.energy / last.energy
        if longer >= _APART[0] or cheaper <= _APART[1]:
            points.append(point)
        elif point is front[-1]:
            points[1:] = [*points[1:-1], point]
    return tuple(points)


POINTS_MAX = 10_000
_CORNERS = 22
_AT_STATION = 1e-3  # m, and of the axes: a tcp that near is at the station
_SAME_DURATION = 1e-6  # s


@dataclass(frozen=True, eq=False)
class OptimizationPlan:
    """The answer: reports before and after; trajectory None unless the status is SUCCESS; front:
    certified movements from the fastest to the one of least energy.
    """

    status: Status
    info: PlanningInfo
    before: TrajectoryReport
    after: TrajectoryReport
    trajectory: JointTrajectory | None = None
    front: tuple[Movement, ...] = ()

    def __repr__(self) -> str:
        identity = "" if self.trajectory is None else self.trajectory.trajectory_id
        before = f"before {self.before.duration:.2f} s and {self.before.energy:.0f} J"
        return result_text("OptimizationPlan", self.status, self.after, identity, before)

    def plot(self) -> Any:
        """The front: joules over seconds; a matplotlib figure."""
        return plot_front([point.report for point in self.front], repr(self))


def optimize_trajectory(
    original: JointTrajectory,
    scene: PlanningScene,
    options: PlanOptions,
    work: Work,
    searches: Searches,
) -> OptimizationPlan:
    """Improve a trajectory from rest to rest for the objective.

    Raises RequestError for a trajectory that can't be taken and for a duration that is too short,
    CancelledError when asked to stop.
    """
    _check(original, scene)
    return _Optimization(original, scene, options, work, searches).run()


def _check(original: JointTrajectory, scene: PlanningScene) -> None:
    """Refuse a trajectory with too few or too many points, with ends beyond a limit, or in motion
    at an end. Raises RequestError.
    """
    count = len(original.times_ns)
    if not 2 <= count <= POINTS_MAX:
        raise RequestError(
            StatusCode.INVALID_MOTION_PLAN,
            f"the trajectory has {count} point{'' if count == 1 else 's'}: 2 to {POINTS_MAX} are "
            "taken",
        )
    bounded(original.duration, 0.0, DURATION_MAX, "time of the last point", "s")
    within_limits(
        original.positions[0], scene.cell, "the first point", StatusCode.START_STATE_INVALID
    )
    within_limits(
        original.positions[-1], scene.cell, "the last point", StatusCode.GOAL_STATE_INVALID
    )
    if original.velocities is None:  # straight between its points: a path with times
        return
    for speeds, verb in ((original.velocities[0], "starts"), (original.velocities[-1], "ends")):
        j = int(np.argmax(np.abs(speeds)))
        if abs(speeds[j]) > AT_REST:
            raise RequestError(
                StatusCode.INVALID_MOTION_PLAN,
                f"the trajectory {verb} with velocity {speeds[j]:.4g} rad/s of "
                f"{original.joint_names[j]}: "
                f"it must lead from rest to rest (0 rad/s within {AT_REST:g})",
            )


class _Optimization:
    """One request: the original, and what came of it."""

    def __init__(
        self,
        original: JointTrajectory,
        scene: PlanningScene,
        options: PlanOptions,
        work: Work,
        searches: Searches,
    ) -> None:
        self.scene = scene
        self.searches = searches
        self.path = path_of(original, scene)
        self.journal = Journal(work, options.seed, planner_id="descent")
        context = Context(scene, options, self.journal, _station_at(self.path[[0, -1]], scene))
        self.context = context.upright_from(self.path[0])
        self.options = self.context.options
        cone = self.context.cone
        outside = end_outside_cone(self.path[0], self.path[-1], cone)
        if outside is not None:
            raise RequestError(StatusCode(outside.code), outside.message)
        margin = options.safety_distance
        self.space = FreeSpace.of(scene, margin, work, self.context.station, cone)
        self.descents = Descents(self.context)
        self.rerouting = False
        if self.context.station:
            self.journal.note(
                "station", f"allowed contacts of {self.context.station} hold in its zone"
            )
        with self.journal.stage("before") as notes:
            self.original = Movement(original.positions, original, self.context)
            violation = self.original.prove().violation
            self.wrong = "" if violation is None else violation.sentence
            notes.append(self.wrong or "certified")

    def run(self) -> OptimizationPlan:
        """Improve, trade time for energy, and compare with the original."""
        start = self.path[0]
        goal = self.path[-1]
        blocked = end_in_collision(start, goal, self.space, self.options.safety_distance)
        if blocked is not None:
            return self._answer(blocked)
        if np.abs(goal - start).max() < STILL:
            return self._standing()
        candidates = [self.original] if self._is_within_options(self.original) else []
        found = self._optimised()
        if found is None and not self._fits(candidates):
            status, found = self._rerouted()
            if found is None:
                return self._answer(status)
        candidates += [found] if found is not None else []
        with self.journal.stage("pareto front") as notes:
            first = sorted(candidates, key=lambda movement: movement is not found)
            front = pareto_front(first, self.context)
            shown = thinned(front)
            notes.append(f"{len(shown)} of {len(front)} movements")
        best = min(self._fits([*candidates, *front]), key=self._cost)
        if best is self.original:
            what = "energy" if self.options.duration > 0.0 else self.options.objective
            self.journal.note("result", f"the original is kept: nothing better by {what} was found")
        return self._answer(Status.success(), best, shown)

    def _optimised(self) -> Movement | None:
        """The best certified movement near the original."""
        with self.journal.stage("descent") as notes:
            movement = self.descents.improved(self.original.trajectory, self._shortcut())
            notes.append("certified" if movement else "nothing certified")
            if movement is None and self.options.duration > 0.0:
                movement = self._fastest_stretched()
                notes.append("the fastest one, stretched" if movement else "nor is the fastest one")
        return movement

    def _fastest_stretched(self) -> Movement | None:
        """The fastest movement near the original, stretched to the requested duration.

        Raises RequestError where it is longer already.
        """
        requested = self.options.duration
        descents = Descents(self.context.asking("time"))
        fastest = descents.improved(self.original.trajectory, self._shortcut())
        if fastest is None:
            return None
        if fastest.report.duration > requested:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"duration is {requested:g} s: the shortest found within the limits near the "
                f"trajectory is {fastest.report.duration:.4g} s",
            )
        movement = fastest.stretched_by(requested / fastest.report.duration)
        return movement if movement.prove().certified else None

    def _shortcut(self) -> list[UniformSpline]:
        """A start along the path with corners left out; none where its straight steps aren't
        free.
        """
        corners = evenly_spaced(self.path, _CORNERS)
        if not self.space.edges_free(corners[:-1], corners[1:]).all():
            return []
        return [self.descents.start_along(fewest_corners(corners, self.space, self.scene.weights))]

    def _rerouted(self) -> tuple[Status, Movement | None]:
        """A new movement between the same end points."""
        self.rerouting = True
        self.journal.note(
            "repair", "no descent from the original was certified: new paths are searched"
        )
        self.journal.planner_id = ""
        start = self.path[0]
        goal = self.path[-1]
        status, movement = search_regional(start, goal, self.context.at(""), self.searches)
        if movement is None:
            why = (
                f"the original can't be repaired ({self.wrong})"
                if self.wrong
                else "nothing was certified"
            )
            return Status(status.code, f"{why}; {status.message}"), None
        self.journal.note("result", "not the original's path but a new one between its end points")
        return status, movement

    def _is_within_options(self, movement: Movement) -> bool:
        """Whether a movement is certified and within the scalings."""
        options = self.options
        report = movement.report
        return bool(
            report.certified
            and (report.velocity_ratio <= options.velocity_scaling + SLACK).all()
            and (report.acceleration_ratio <= options.acceleration_scaling + SLACK).all()
            and (report.jerk_ratio <= options.acceleration_scaling + SLACK).all()
        )

    def _fits(self, movements: list[Movement]) -> list[Movement]:
        """Those of the requested duration."""
        requested = self.options.duration
        if requested == 0.0:
            return movements
        return [m for m in movements if abs(m.report.duration - requested) < _SAME_DURATION]

    def _cost(self, movement: Movement) -> float:
        """What the request minimises; the front's movements were made for other objectives."""
        return request_cost(movement.consumption, self.options)

    def _standing(self) -> OptimizationPlan:
        """The end points are the same."""
        moves = np.abs(np.diff(self.path, axis=0)).max() >= STILL
        if moves or not self.original.prove().certified:
            why = "a loop would shrink to nothing: give its parts" if moves else self.wrong
            raise RequestError(
                StatusCode.INVALID_MOTION_PLAN, f"the trajectory ends where it starts: {why}"
            )
        self.journal.note("result", "the original is kept: it stands still")
        return self._answer(Status.success(), self.original)

    def _answer(
        self, status: Status, best: Movement | None = None, front: tuple[Movement, ...] = ()
    ) -> OptimizationPlan:
        if best is not None and best is not self.original:  # nobody knows of a given one
            self.journal.timing = best.timing
        if self.options.planner_id and not self.rerouting:
            sentence = (
                f"planner_id {self.options.planner_id} is not used: no new path had to be searched"
            )
            self.journal.note("options", sentence)
        info = self.journal.info(self.path[0], self.scene.cell.robot.joint_names)
        before = self.original.report
        if best is None:
            return OptimizationPlan(status, info, before, TrajectoryReport())
        return OptimizationPlan(status, info, before, best.report, best.trajectory, front)


def _station_at(ends: FloatArray, scene: PlanningScene) -> str:
    """The station with allowed contacts at whose pose the tcp is at one of the ends (2, n); "" for
    none.
    """
    poses = scene.chain.tcp_poses(ends)
    for station in scene.cell.stations:
        if (
            station.allowed_contacts
            and np.abs(poses - station.pose).max(axis=(1, 2)).min() < _AT_STATION
        ):
            return station.name
    return ""
