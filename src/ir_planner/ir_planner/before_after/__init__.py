"""Today's program against the planner's: the same stations and pauses, at its cycle time and at
others.
"""

from ir_planner.before_after.comparison import before_after, before_after_common
from ir_planner.before_after.today import Today, TodayMotion, today_of_krl
from ir_planner.before_after.today_steps import assumed_doors, doors_as_assumed

__all__ = [
    "Today",
    "TodayMotion",
    "assumed_doors",
    "before_after",
    "before_after_common",
    "doors_as_assumed",
    "today_of_krl",
]
