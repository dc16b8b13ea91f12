"""Trajectories: what is accepted, the path that leads onto one, and its execution step by step."""

from ir_sim_driver.motion.executor import Executor, Following
from ir_sim_driver.motion.goal import (
    ErrorCode,
    ExecutionSettings,
    JointTolerance,
    Outcome,
    TrajectoryGoal,
)
from ir_sim_driver.motion.path import Motion, Path
from ir_sim_driver.motion.tool_point import ToolPoint, manual_scaling
from ir_sim_driver.motion.trajectory_checks import (
    Driven,
    Route,
    check_goal,
    check_trajectory,
    checked_route,
)

__all__ = [
    "Driven",
    "ErrorCode",
    "ExecutionSettings",
    "Executor",
    "Following",
    "JointTolerance",
    "Motion",
    "Outcome",
    "Path",
    "Route",
    "ToolPoint",
    "TrajectoryGoal",
    "check_goal",
    "check_trajectory",
    "checked_route",
    "manual_scaling",
]
