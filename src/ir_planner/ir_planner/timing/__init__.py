"""Time scaling: seven-phase laws, straight movements (PTP), blended corners, the best duration."""

from ir_planner.timing.blending import TimedPath, blended, stretched
from ir_planner.timing.level_timing import fastest
from ir_planner.timing.movement import (
    DURATION_SLACK,
    TimedMovement,
    check_duration,
    distinct,
    stretched_to_wish,
    timed_movement,
)
from ir_planner.timing.objective import (
    ObjectiveWeights,
    best_stretch,
    objective_value,
    objective_weights,
    pace_value,
    trajectory_value,
)
from ir_planner.timing.spline_timing import time_spline
from ir_planner.timing.time_law import StepLaws

__all__ = [
    "DURATION_SLACK",
    "ObjectiveWeights",
    "StepLaws",
    "TimedMovement",
    "TimedPath",
    "best_stretch",
    "blended",
    "check_duration",
    "distinct",
    "fastest",
    "objective_value",
    "objective_weights",
    "pace_value",
    "stretched",
    "stretched_to_wish",
    "time_spline",
    "timed_movement",
    "trajectory_value",
]
