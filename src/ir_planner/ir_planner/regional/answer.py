"""What a request for a movement is answered with."""

from dataclasses import dataclass
from typing import Any

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import PlanningInfo, TrajectoryReport
from ir_msgs_py.status import Status
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.presentation import plot_trajectory, result_text


@dataclass(frozen=True, eq=False)
class MovementPlan:
    """The answer to a request for a movement; trajectory and waypoints (M, n) None unless the
    status is SUCCESS.
    """

    status: Status
    info: PlanningInfo
    report: TrajectoryReport
    trajectory: JointTrajectory | None = None
    waypoints: FloatArray | None = None

    def __repr__(self) -> str:
        identity = "" if self.trajectory is None else self.trajectory.trajectory_id
        return result_text("MovementPlan", self.status, self.report, identity)

    def plot(self) -> Any:
        """Angles and speeds of the joints over time; a matplotlib figure."""
        return plot_trajectory(self.trajectory, repr(self))
