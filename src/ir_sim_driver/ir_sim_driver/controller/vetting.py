"""Goals before they start: what is checked beside the running robot, and what only when they
start.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ir_description import RobotModel
from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.errors import InvalidValueError
from ir_sim_driver.controller.collision_check import check_collision
from ir_sim_driver.controller.keep import Keep
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion import (
    ErrorCode,
    ExecutionSettings,
    Motion,
    Path,
    Route,
    TrajectoryGoal,
    check_goal,
    check_trajectory,
    checked_route,
)

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
        now: Motion,
        robot: RobotModel,
        dynamics: DynamicsModel,
        settings: ExecutionSettings,
        delay: float,
    ) -> Route:
        """Path from the commanded motion `now` onto the trajectory. Raises
        TrajectoryRefusedError.
        """
        if self.dynamics is not dynamics:
            raise TrajectoryRefusedError(
                ErrorCode.INVALID_GOAL, "the load changed while the trajectory was checked"
            )
        route = checked_route(self.goal.trajectory, now, robot, dynamics, settings, delay)
        if not self.goal.allow_collision and route.lead:
            check_collision(route.path, slice(0, route.lead), route.offset, self.keep)
        return route

    def delay(self, now_ns: int) -> float:
        """Seconds until time 0 of the trajectory."""
        stamp = self.goal.stamp_ns
        return 0.0 if stamp == 0 else max(0.0, (stamp - now_ns) * _NS)


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
    executed = check_trajectory(checked.trajectory, robot, dynamics, settings)
    try:
        keep = asked(checked.station)
    except InvalidValueError as error:
        raise TrajectoryRefusedError(ErrorCode.INVALID_GOAL, str(error)) from error
    if not checked.allow_collision:
        path = Path(*executed.coefficients(), executed.positions[0])
        check_collision(path, slice(0, None), -float(executed.times[0]), keep)
    return VettedGoal(checked, dynamics, keep)
