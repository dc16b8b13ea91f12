"""The flexible cell: parts go through machines that work meanwhile; the cheapest steady cycle."""

from ir_planner.flexible.columns import RUNGS, Column, slowed_down
from ir_planner.flexible.steady_plan import (
    CyclePoint,
    CycleStep,
    SteadyPlan,
    cycle_steps,
    machine_bars,
    plan_steady_cycle,
    robot_bars,
    wait_modes,
)

__all__ = [
    "RUNGS",
    "Column",
    "CyclePoint",
    "CycleStep",
    "SteadyPlan",
    "cycle_steps",
    "machine_bars",
    "plan_steady_cycle",
    "robot_bars",
    "slowed_down",
    "wait_modes",
]
