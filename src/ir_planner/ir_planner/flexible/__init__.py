"""The flexible cell: parts go through machines that work meanwhile; the cheapest steady cycle.

Its names are imported when they are first used: a planner loads it, and HiGHS, with its first
cycle.
"""

from typing import TYPE_CHECKING

from ir_values.faces import on_first_use

if TYPE_CHECKING:
    from ir_planner.flexible.columns import RUNGS, MovementColumn, slowed_down
    from ir_planner.flexible.steady_plan import (
        SteadyPlan,
        plan_steady_cycle,
        timed_steps,
        wait_modes,
    )
    from ir_planner.flexible.surprises import (
        SHARES,
        counted_times,
        outage_replay,
        with_counted_times,
    )
else:
    __getattr__, __dir__ = on_first_use(
        globals(),
        {
            "ir_planner.flexible.columns": ("RUNGS", "MovementColumn", "slowed_down"),
            "ir_planner.flexible.steady_plan": (
                "SteadyPlan",
                "plan_steady_cycle",
                "timed_steps",
                "wait_modes",
            ),
            "ir_planner.flexible.surprises": (
                "SHARES",
                "counted_times",
                "outage_replay",
                "with_counted_times",
            ),
        },
    )

__all__ = [
    "RUNGS",
    "SHARES",
    "MovementColumn",
    "SteadyPlan",
    "counted_times",
    "outage_replay",
    "plan_steady_cycle",
    "slowed_down",
    "timed_steps",
    "wait_modes",
    "with_counted_times",
]
