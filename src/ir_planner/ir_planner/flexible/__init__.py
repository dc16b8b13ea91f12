"""The flexible cell: parts go through machines that work meanwhile; the cheapest steady cycle."""

from ir_planner.flexible.columns import RUNGS, MovementColumn, slowed_down
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
from ir_planner.flexible.surprises import (
    SHARES,
    CountedTimes,
    OutageReplay,
    ReplayedPart,
    counted_times,
    outage_replay,
    with_counted_times,
)

__all__ = [
    "RUNGS",
    "SHARES",
    "CountedTimes",
    "CyclePoint",
    "CycleStep",
    "MovementColumn",
    "OutageReplay",
    "ReplayedPart",
    "SteadyPlan",
    "counted_times",
    "cycle_steps",
    "machine_bars",
    "outage_replay",
    "plan_steady_cycle",
    "robot_bars",
    "slowed_down",
    "wait_modes",
    "with_counted_times",
]
