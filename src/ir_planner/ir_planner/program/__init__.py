"""Whole programs: configurations at the stations, all movements and pauses between them, power
modes.
"""

from ir_planner.program.asked_searches import unknown_searches
from ir_planner.program.charge import Charge
from ir_planner.program.doors import Doors, doors_advice, doors_along, doors_text, with_doors
from ir_planner.program.outlook import Outlook, outlook
from ir_planner.program.pause_lengths import Lengths, lengths_of
from ir_planner.program.pauses import AUTO, Pause, pause_by_itself
from ir_planner.program.program import plan_program
from ir_planner.program.request import ProgramPlan, ProgramRequest, Progress, nobody
from ir_planner.program.spreads import Spreads, with_intervals
from ir_planner.program.standby import Standby
from ir_planner.program.steps import PlacedStep, Scenes, placed_steps
from ir_planner.program.waiting import Trip, best_posture

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
    "unknown_searches",
    "with_doors",
    "with_intervals",
]
