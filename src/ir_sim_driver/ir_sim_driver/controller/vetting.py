"""Goals before they start: what is checked beside the running robot, and what only when they start."""

from __future__ import annotations

from dataclasses import dataclass

from ir_description import RobotModel
from ir_kernels.dynamics import DynamicsModel
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion import (
    ErrorCode,
    ExecutionSettings,
    Motion,
    Route,
    TrajectoryGoal,
    check_goal,
    check_trajectory,
    checked_route,
)

_NS = 1e-9


@dataclass(frozen=True, eq=False)
class VettedGoal:
    """A goal whose trajectory was found executable with the dynamics of one load."""

    goal: TrajectoryGoal
    dynamics: DynamicsModel

    def route(
        self,
        now: Motion,
        robot: RobotModel,
        dynamics: DynamicsModel,
        settings: ExecutionSettings,
        delay: float,
    ) -> Route:
        """Path from the commanded motion `now` onto the trajectory. Raises TrajectoryRefusedError."""
        if self.dynamics is not dynamics:
            raise TrajectoryRefusedError(
                ErrorCode.INVALID_GOAL, "the load changed while the trajectory was checked"
            )
        return checked_route(self.goal.trajectory, now, robot, dynamics, settings, delay)

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
) -> VettedGoal:
    """Check all of a goal that does not depend on the robot's state. Raises TrajectoryRefusedError."""
    checked = check_goal(goal, tuple(robot.joint_names), settings, now_ns)
    check_trajectory(checked.trajectory, robot, dynamics, settings)
    return VettedGoal(checked, dynamics)
