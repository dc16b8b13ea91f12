"""Several robots in one cell: what could meet, zones that they pass in turns, the joint cycle."""

from ir_planner.robots.joint_plan import RobotsPlan, SharedZone, plan_robots

__all__ = ["RobotsPlan", "SharedZone", "plan_robots"]
