"""What a request for a movement is answered with."""

from dataclasses import dataclass

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import PlanningInfo, TrajectoryReport
from ir_msgs_py.status import Status
from ir_msgs_py.trajectory import JointTrajectory


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
