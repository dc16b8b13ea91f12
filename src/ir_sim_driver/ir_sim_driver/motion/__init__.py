"""Trajectories: what is accepted, the path that leads onto one, and its execution step by step."""

from ir_sim_driver.motion.executor import Executor, Following
from ir_sim_driver.motion.goal import (
    ErrorCode,
    ExecutionSettings,
    GoalOutcome,
    JointTolerance,
    TrajectoryGoal,
)
from ir_sim_driver.motion.path import Path, PathMotion
from ir_sim_driver.motion.tool_point import TOOL_SPEED, ToolPoint, manual_scaling
from ir_sim_driver.motion.trajectory_checks import (
    CurrentPath,
    LeadPath,
    check_goal,
    check_trajectory,
    checked_route,
)

__all__ = [
    "TOOL_SPEED",
    "CurrentPath",
    "ErrorCode",
    "ExecutionSettings",
    "Executor",
    "Following",
    "GoalOutcome",
    "JointTolerance",
    "LeadPath",
    "Path",
    "PathMotion",
    "ToolPoint",
    "TrajectoryGoal",
    "check_goal",
    "check_trajectory",
    "checked_route",
    "manual_scaling",
]
