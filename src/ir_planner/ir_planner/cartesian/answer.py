"""What a request for a Cartesian path is answered with."""

from dataclasses import dataclass, field

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import PlanningInfo, TrajectoryReport
from ir_msgs_py.status import Status
from ir_msgs_py.trajectory import JointTrajectory


@dataclass(frozen=True, eq=False)
class CartesianPlan:
    """trajectory None unless the status is SUCCESS.

    Bounds at every instant: tool_error [m], the tcp's distance from the path; rotation_error [rad],
    its turn against the path there; speed_deviation, the share of the tool's speed that it is off,
    without approach, retract and changes of speed. lengths (K,) m at
    which its segments end, counted from the beginning of the approach; configurations: how many
    were looked at.
    """

    status: Status
    info: PlanningInfo
    report: TrajectoryReport
    trajectory: JointTrajectory | None = None
    tool_error: float = 0.0
    rotation_error: float = 0.0
    speed_deviation: float = 0.0
    lengths: FloatArray = field(default_factory=lambda: np.zeros(0))
    configurations: int = 0
