"""The flexible cell: parts go through machines that work meanwhile; the cheapest steady cycle."""

from ir_planner.flexible.columns import RUNGS, MovementColumn, slowed_down
from ir_planner.flexible.steady_plan import SteadyPlan, cycle_steps, plan_steady_cycle, wait_modes
from ir_planner.flexible.surprises import SHARES, counted_times, outage_replay, with_counted_times

__all__ = [
    "RUNGS",
    "SHARES",
    "MovementColumn",
    "SteadyPlan",
    "counted_times",
    "cycle_steps",
    "outage_replay",
    "plan_steady_cycle",
    "slowed_down",
    "wait_modes",
    "with_counted_times",
]
