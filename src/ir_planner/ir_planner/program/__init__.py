"""Whole programs: configurations at the stations, all movements and pauses between them, power
modes.
"""

from ir_planner.program.pauses import (
    AUTO,
    Charge,
    Pause,
    pause_by_itself,
    spent,
    switch_times,
)
from ir_planner.program.program import Outlook, outlook, plan_program
from ir_planner.program.request import (
    ProgramPlan,
    ProgramRequest,
    Progress,
    nobody,
    unknown_searches,
)
from ir_planner.program.spreads import Spreads, with_intervals
from ir_planner.program.standby import Lengths, Standby, Trip, best_posture, lengths_of
from ir_planner.program.steps import (
    Doors,
    PlacedStep,
    Scenes,
    doors_advice,
    doors_along,
    doors_text,
    placed_steps,
    with_doors,
)

__all__ = [
    "AUTO",
    "Charge",
    "Doors",
    "Lengths",
    "Outlook",
    "Pause",
    "PlacedStep",
    "ProgramPlan",
    "ProgramRequest",
    "Progress",
    "Scenes",
    "Spreads",
    "Standby",
    "Trip",
    "best_posture",
    "doors_advice",
    "doors_along",
    "doors_text",
    "lengths_of",
    "nobody",
    "outlook",
    "pause_by_itself",
    "placed_steps",
    "plan_program",
    "spent",
    "switch_times",
    "unknown_searches",
    "with_doors",
    "with_intervals",
]
