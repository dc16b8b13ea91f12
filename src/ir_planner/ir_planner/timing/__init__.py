"""Time scaling: seven-phase laws, straight movements (PTP), blended corners, the best duration."""

from ir_planner.timing.baseline import baseline, baseline_costs_at_least
from ir_planner.timing.blended_steps import TimedPath, blended, standing, stretched
from ir_planner.timing.jerk_limited_laws import GRID_NS, GRID_S, StepLaws, TimeLaw
from ir_planner.timing.movement import TORQUE_SHARES, Movement, within_torque
from ir_planner.timing.objective import (
    DURATION_SLACK,
    ObjectiveWeights,
    at_best_duration,
    at_the_mains,
    best_stretch,
    check_duration,
    check_requested,
    objective_value,
    objective_weights,
    request_cost,
    slowed_for_tool,
)
from ir_planner.timing.ptp import fastest, free_law
from ir_planner.timing.reserve import need_of, with_less_reserve
from ir_planner.timing.spline_timing import time_spline
from ir_planner.timing.straight_steps import distinct, straight_steps

__all__ = [
    "DURATION_SLACK",
    "GRID_NS",
    "GRID_S",
    "TORQUE_SHARES",
    "Movement",
    "ObjectiveWeights",
    "StepLaws",
    "TimeLaw",
    "TimedPath",
    "at_best_duration",
    "at_the_mains",
    "baseline",
    "baseline_costs_at_least",
    "best_stretch",
    "blended",
    "check_duration",
    "check_requested",
    "distinct",
    "fastest",
    "free_law",
    "need_of",
    "objective_value",
    "objective_weights",
    "request_cost",
    "slowed_for_tool",
    "standing",
    "straight_steps",
    "stretched",
    "time_spline",
    "with_less_reserve",
    "within_torque",
]
