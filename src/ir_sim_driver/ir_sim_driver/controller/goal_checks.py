"""Checks of a goal that don't depend on the robot's state: limits and collisions."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ir_description import RobotModel
from ir_kernels.collision import COLLIDES, FREE
from ir_kernels.dynamics import DynamicsModel
from ir_sim_driver.controller.cell_scene import ContactScene, Keep, PathPiece
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion import (
    CurrentPath,
    ErrorCode,
    ExecutionSettings,
    LeadPath,
    Path,
    PathMotion,
    TrajectoryGoal,
    check_goal,
    check_trajectory,
    checked_route,
)
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError

# Collisions along a path: proved for every instant, not sampled.

CHECK_TIME = 20.0  # s of processor time: 20 000 points take some 0.02 s
_PIECES = 200  # segments that are proved together


def check_collision(path: Path, segments: slice, offset: float, keep: Keep) -> None:
    """Prove that every pair keeps its distance along some segments of a path; offset [s]: of its
    trajectory's time 0. Raises TrajectoryRefusedError.
    """
    begin = float(np.sum(path.durations[: segments.start or 0]))
    if len(path.durations[segments]) == 0:
        _check_point(path.start, keep)
        return
    started = time.thread_time()
    for piece in _short_pieces(keep.pieces(path.coefficients[segments], path.durations[segments])):
        found = keep.scene.model.certify_trajectory(*piece)
        if found.verdict != FREE:
            at = begin + found.interval[1]
            raise _refused(path.position(at), at - offset, found.verdict, found.pair, keep.scene)
        begin += float(piece.durations.sum())
        if time.thread_time() - started > CHECK_TIME:
            raise TrajectoryRefusedError(
                ErrorCode.INVALID_GOAL,
                f"the trajectory could not be proved free of collisions within {CHECK_TIME:g} s "
                f"of processor time: it was up to {begin - offset:.3f} s",
            )


def _short_pieces(pieces: Iterable[PathPiece]) -> Iterator[PathPiece]:
    """The pieces in parts of at most _PIECES segments."""
    for piece in pieces:
        for first in range(0, len(piece.durations), _PIECES):
            part = slice(first, first + _PIECES)
            yield PathPiece(piece.coefficients[part], piece.durations[part], piece.thresholds)


def _check_point(q: FloatArray, keep: Keep) -> None:
    threshold = keep.at(q)
    near = keep.scene.model.min_distance(q[None], threshold)
    z = int(near.pair[0])
    if z >= 0 and near.distance[0] <= threshold[z]:
        raise _refused(q, 0.0, COLLIDES, z, keep.scene)


def _refused(
    q: FloatArray, at: float, verdict: int, z: int, scene: ContactScene
) -> TrajectoryRefusedError:
    kind, body_a, body_b = scene.model.pairs[z]
    distance = float(scene.model.witnesses(q[None], [z]).distance[0])
    does = "collides" if verdict == COLLIDES else "can't be proved free of collisions"
    return TrajectoryRefusedError(
        ErrorCode.INVALID_GOAL,
        f"the trajectory {does}: {body_a} and {body_b} ({kind.lower()}) come to "
        f"{distance * 1e3:.1f} mm at {at:.3f} s; plan it again, or allow_collision",
    )


# Checks beside the running robot, and those that are left for the start.

_NS = 1e-9


@dataclass(frozen=True, eq=False)
class VettedGoal:
    """A goal whose trajectory was found executable with the dynamics of one load, and free in one
    scene.
    """

    goal: TrajectoryGoal
    dynamics: DynamicsModel
    keep: Keep

    def route(
        self,
        now: PathMotion,
        robot: RobotModel,
        dynamics: DynamicsModel,
        settings: ExecutionSettings,
        delay: float,
        driven: CurrentPath | None = None,
    ) -> LeadPath:
        """Path from the commanded motion `now`, or on the movement that is driven, onto the
        trajectory. Raises TrajectoryRefusedError.
        """
        if self.dynamics is not dynamics:
            raise TrajectoryRefusedError(
                ErrorCode.INVALID_GOAL, "the load changed while the trajectory was checked"
            )
        route = checked_route(self.goal.trajectory, now, robot, dynamics, settings, delay, driven)
        if not self.goal.allow_collision and route.lead:
            check_collision(route.path, slice(0, route.lead), route.offset, self.keep)
        return route

    def delay(self, now_ns: int) -> float:
        """Seconds until time 0 of the trajectory; below 0: since, by its header stamp."""
        stamp = self.goal.stamp_ns
        return 0.0 if stamp == 0 else (stamp - now_ns) * _NS


def vet(
    goal: TrajectoryGoal,
    robot: RobotModel,
    dynamics: DynamicsModel,
    settings: ExecutionSettings,
    now_ns: int,
    asked: Callable[[str], Keep],
) -> VettedGoal:
    """Check all of a goal that does not depend on the robot's state. asked: what a station's
    trajectory must keep clear of now. Raises TrajectoryRefusedError.
    """
    checked = check_goal(goal, tuple(robot.joint_names), settings, now_ns)
    executed, note = check_trajectory(checked.trajectory, robot, dynamics, settings)
    label = checked.label or checked.trajectory.trajectory_id
    checked = replace(checked, trajectory=executed, label=label).noted(note)
    try:
        keep = asked(checked.station)
    except InvalidValueError as error:
        raise TrajectoryRefusedError(ErrorCode.INVALID_GOAL, str(error)) from error
    if not checked.allow_collision:
        path = Path(*executed.coefficients(), executed.positions[0])
        check_collision(path, slice(0, None), -float(executed.times[0]), keep)
    return VettedGoal(checked, dynamics, keep)
