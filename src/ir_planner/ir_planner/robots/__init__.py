"""Several robots in one cell: what could meet, zones that they pass in turns, the joint cycle."""

from ir_planner.robots.arm_program import check_processes, check_repeatable
from ir_planner.robots.joint_plan import RobotsPlan, plan_robots
from ir_planner.robots.meetings import check_places

__all__ = [
    "RobotsPlan",
    "check_places",
    "check_processes",
    "check_repeatable",
    "plan_robots",
]
