"""The flexible cell: parts go through machines that work meanwhile; the cheapest steady cycle."""

from ir_planner.flexible.steady_plan import (
    CyclePoint,
    SteadyPlan,
    machine_bars,
    plan_steady_cycle,
    robot_bars,
)

__all__ = ["CyclePoint", "SteadyPlan", "machine_bars", "plan_steady_cycle", "robot_bars"]
