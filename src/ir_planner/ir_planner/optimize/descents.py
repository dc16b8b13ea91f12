"""Descents to certified movements from several starts near one path."""

import numpy as np

from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import UniformSpline, along_motion, along_path, evenly_spaced, fewest_seconds
from ir_planner.optimize.refinement import (
    EDGES_PER_INTERVAL,
    FEWEST,
    MOST,
    SLOWER,
    SPACING,
    THOROUGH,
    Refinement,
    Solution,
)
from ir_planner.request import Context
from ir_planner.scene import PlanningScene
from ir_planner.timing import Movement
from ir_values.arrays import FloatArray

# control points that leave the path in tight corners, but are often faster in the end
_FEW = (
    12,
    18,
)
_NEAR = 0.02  # rad that a fit may leave its path by, unless that takes too many points
_SLOWEST = 3.0  # times the path at full speed: the longest duration that a descent starts from
_REFINED = 3  # coarse solutions that are refined
_ROUNDS = 3
_GAIN = 2e-3  # relative: less isn't worth another round
_ALONG = 256  # points of a path


def path_of(trajectory: JointTrajectory, scene: PlanningScene) -> FloatArray:
    """Points (256, n) at even distances along a trajectory, within the joints' ranges."""
    begin = float(trajectory.times[0])
    span = trajectory.duration - float(trajectory.times[0])
    dense = trajectory.sample(begin + np.linspace(0.0, 1.0, 8 * _ALONG) * span).q
    robot = scene.cell.robot
    dense = np.clip(
        np.concatenate([trajectory.positions[:1], dense]), robot.position_min, robot.position_max
    )
    dense[-1] = trajectory.positions[-1]
    return evenly_spaced(dense, _ALONG)


class Descents:
    """Descents for one request."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._refinement = Refinement(context)

    def starts(self, trajectory: JointTrajectory, path: FloatArray) -> list[UniformSpline]:
        """Coarse splines along a trajectory: with its own speed profile, and with an even one, also
        with so few control points that they leave it; path (M, n): its points.
        """
        least, count = self._least(path)
        own = trajectory.duration - float(trajectory.times[0])
        requested = self.context.options.duration
        robot = self.context.scene.cell.robot
        motion = along_motion(
            trajectory, count, requested or float(np.clip(own, least, _SLOWEST * least))
        )
        kept = np.clip(motion.control, robot.position_min, robot.position_max)
        counts = sorted({count, *(few for few in _FEW if few < count and not requested)})
        even = [along_path(path, few, requested or SLOWER * least) for few in counts]
        return [UniformSpline(kept, motion.interval), *even]

    def improved(
        self,
        trajectory: JointTrajectory,
        more: list[UniformSpline] | None = None,
        rounds: int = _ROUNDS,
    ) -> Movement | None:
        """The best certified movement by descents from a trajectory and `more` starts, and again
        from what was found; None where none can be certified.
        """
        found: Movement | None = None
        starts = list(more or [])
        for _ in range(rounds):
            path = path_of(trajectory, self.context.scene)
            again = self.best([*self.starts(trajectory, path), *starts], path)
            starts = []
            if again is None:
                break
            gain = np.inf if found is None else 1.0 - again.cost / found.cost
            found = again if gain > 0.0 else found
            if gain < _GAIN or self.context.work.exhausted:
                break
            trajectory = again.trajectory
        return found

    def start_along(self, path: FloatArray) -> UniformSpline:
        """A coarse spline along a path (M, n)."""
        least, count = self._least(path)
        return along_path(path, count, self.context.options.duration or SLOWER * least)

    def _least(self, path: FloatArray) -> tuple[float, int]:
        """Fewest seconds for a path, and control points enough to keep to it."""
        limits = self._refinement.limits
        least = fewest_seconds(path, limits.velocity, limits.acceleration)
        count = int(np.clip(np.ceil(least / SPACING), FEWEST, MOST))
        while count < MOST and _deviation(along_path(path, count, 1.0), path) > _NEAR:
            count = min(2 * count, MOST)
        return least, count

    def best(self, starts: list[UniformSpline], path: FloatArray) -> Movement | None:
        """The best certified movement from the starts whose coarse solutions cost least; None where
        none can be certified. path (M, n): what they came from.
        """
        work = self.context.work
        coarse: list[Solution] = []
        for k, start in enumerate(starts):
            if not coarse or not work.exhausted:
                share = work.left / (
                    EDGES_PER_INTERVAL * start.intervals * (len(starts) - k + _REFINED)
                )
                evaluations = max(min(THOROUGH.coarse, int(share)), 1)
                coarse.append(self._refinement.coarse_from(start, path, evaluations))
        found: list[Movement] = []
        for solution in sorted(coarse, key=lambda solution: solution.cost)[:_REFINED]:
            if found and work.exhausted:
                break
            movement = self._refinement.refined(solution, path, THOROUGH)
            if movement is not None and movement.prove().certified:
                found.append(movement)
            else:
                self.context.journal.reject("not certified after descent")
        return min(found, key=lambda movement: movement.cost) if found else None


def _deviation(spline: UniformSpline, path: FloatArray) -> float:
    """How far a spline along a path leaves its points, at the knots [rad]."""
    knots = spline.knots()[0]
    away = np.abs(path[None, :, :] - knots[:, None, :]).max(axis=2)
    return float(max(away.min(axis=1).max(), away.min(axis=0).max() - _step(knots)))


def _step(knots: FloatArray) -> float:
    """Half the longest step between knots: how far a point of the path may be from the next one
    [rad].
    """
    return 0.5 * float(np.abs(np.diff(knots, axis=0)).max())
