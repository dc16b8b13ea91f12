"""Descents to certified movements from several starts near one path."""

from dataclasses import dataclass, replace

import numpy as np
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.trajectory import JointTrajectory

from ir_planner.checks import Evaluation, evaluate_trajectory
from ir_planner.curves import UniformSpline, along_motion, along_path, evenly_spaced, fewest_seconds
from ir_planner.optimize.refinement import THOROUGH, Draft, Refinement
from ir_planner.request import Journal
from ir_planner.scene import PlanningScene
from ir_planner.timing import objective_value

_SPACING = 0.1  # s between the knots of the coarsest spline
_FEWEST, _MOST = 12, 64  # its control points
_FEW = (12, 18)  # that leave the path in tight corners, but are often quicker in the end
_NEAR = 0.02  # rad that a fit may leave its path by, unless that takes too many points
_SLOWER = 1.3  # than the path at full speed
_PATIENCE = 3.0  # times the path at full speed: the slowest pace that a descent starts from
_FINISHED = 3
_ROUNDS = 3
_GAIN = 2e-3  # relative: less isn't worth another round
_ALONG = 256  # points of a path


@dataclass(frozen=True, eq=False)
class Measured:
    """A movement with everything that is known about it."""

    trajectory: JointTrajectory
    evaluation: Evaluation

    @property
    def report(self) -> TrajectoryReport:
        """What it costs."""
        return self.evaluation.report

    @property
    def certified(self) -> bool:
        """Clearance and limits proved for every instant."""
        return self.evaluation.verification.certified


@dataclass(frozen=True, eq=False)
class Task:
    """Where movements are, what they must keep, and whose allowed contacts hold ("": nobody's)."""

    scene: PlanningScene
    options: PlanOptions
    journal: Journal
    station: str = ""

    def measured(self, trajectory: JointTrajectory) -> Measured:
        """A movement, verified as it is sent."""
        margin = self.options.safety_distance
        return Measured(trajectory, evaluate_trajectory(trajectory, self.scene, margin, self.station))

    def asking(self, objective: str, duration: float = 0.0) -> "Task":
        """The same with another objective and duration [s], 0: free."""
        return replace(self, options=replace(self.options, objective=objective, duration=duration))


def path_of(trajectory: JointTrajectory, scene: PlanningScene) -> FloatArray:
    """Points (256, n) at even distances along a trajectory, within the joints' ranges."""
    begin, span = float(trajectory.times[0]), trajectory.duration - float(trajectory.times[0])
    dense = trajectory.sample(begin + np.linspace(0.0, 1.0, 8 * _ALONG) * span).q
    robot = scene.cell.robot
    dense = np.clip(np.concatenate([trajectory.positions[:1], dense]), robot.position_min, robot.position_max)
    dense[-1] = trajectory.positions[-1]
    return evenly_spaced(dense, _ALONG)


class Descents:
    """Descents for one task."""

    def __init__(self, task: Task) -> None:
        self.task, self.scene, self.options, self.journal = task, task.scene, task.options, task.journal
        self._refinement = Refinement(task.scene, task.options, task.journal.work, task.station)

    def starts(self, trajectory: JointTrajectory, path: FloatArray) -> list[UniformSpline]:
        """Coarse splines along a trajectory: at its own pace, and at an even one, also with so few control
        points that they leave it; path (M, n): its points.
        """
        least, count = self._least(path)
        own = trajectory.duration - float(trajectory.times[0])
        wished = self.options.duration
        robot = self.scene.cell.robot
        motion = along_motion(trajectory, count, wished or float(np.clip(own, least, _PATIENCE * least)))
        kept = np.clip(motion.control, robot.position_min, robot.position_max)
        counts = sorted({count, *(few for few in _FEW if few < count and not wished)})
        even = [along_path(path, few, wished or _SLOWER * least) for few in counts]
        return [UniformSpline(kept, motion.interval), *even]

    def improved(
        self, trajectory: JointTrajectory, more: list[UniformSpline] | None = None, rounds: int = _ROUNDS
    ) -> Measured | None:
        """The best certified movement by descents from a trajectory and `more` starts, and again from what
        was found; None where none can be certified.
        """
        found: Measured | None = None
        starts = list(more or [])
        for _ in range(rounds):
            path = path_of(trajectory, self.scene)
            again = self.best([*self.starts(trajectory, path), *starts], path)
            starts = []
            if again is None:
                break
            gain = np.inf if found is None else 1.0 - self.value(again) / self.value(found)
            found = again if gain > 0.0 else found
            if gain < _GAIN or self.journal.work.exhausted:
                break
            trajectory = again.trajectory
        return found

    def value(self, movement: Measured) -> float:
        """What is minimised: the objective, or joules where the duration is wished."""
        if self.options.duration > 0.0:
            return movement.report.energy
        return objective_value(movement.report, self.options.objective, self.options.time_value)

    def start_along(self, path: FloatArray) -> UniformSpline:
        """A coarse spline along a path (M, n)."""
        least, count = self._least(path)
        return along_path(path, count, self.options.duration or _SLOWER * least)

    def _least(self, path: FloatArray) -> tuple[float, int]:
        """Fewest seconds for a path, and control points enough to keep to it."""
        limits = self._refinement.limits
        least = fewest_seconds(path, limits.velocity, limits.acceleration)
        count = int(np.clip(np.ceil(least / _SPACING), _FEWEST, _MOST))
        while count < _MOST and _deviation(along_path(path, count, 1.0), path) > _NEAR:
            count = min(2 * count, _MOST)
        return least, count

    def best(self, starts: list[UniformSpline], path: FloatArray) -> Measured | None:
        """The best certified movement from the starts that look best after a short way down; None where none
        can be certified. path (M, n): what they came from.
        """
        work = self.journal.work
        drafts: list[Draft] = []
        for start in starts:
            if not drafts or not work.exhausted:
                drafts.append(self._refinement.continued(start, path, THOROUGH.coarse))
        found: list[Measured] = []
        for draft in sorted(drafts, key=lambda draft: draft.cost)[:_FINISHED]:
            if found and work.exhausted:
                break
            refined = self._refinement.finished(draft, path, THOROUGH)
            movement = self.task.measured(refined.trajectory) if refined else None
            if movement is not None and movement.certified:
                found.append(movement)
            else:
                self.journal.reject("not certified after descent")
        return min(found, key=lambda movement: self.value(movement)) if found else None


def _deviation(spline: UniformSpline, path: FloatArray) -> float:
    """How far a spline along a path leaves its points, at the knots [rad]."""
    knots = spline.knots()[0]
    away = np.abs(path[None, :, :] - knots[:, None, :]).max(axis=2)
    return float(max(away.min(axis=1).max(), away.min(axis=0).max() - _step(knots)))


def _step(knots: FloatArray) -> float:
    """Half the longest way between knots: how far a point of the path may be from the next one [rad]."""
    return 0.5 * float(np.abs(np.diff(knots, axis=0)).max())
