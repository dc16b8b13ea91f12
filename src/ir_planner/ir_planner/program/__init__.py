"""Whole programs: configurations at the stations, all movements and pauses between them, power
modes.
"""

from ir_planner.program.choice import Choice
from ir_planner.program.more_work import chosen
from ir_planner.program.movement_fronts import Ladder, TimeValues
from ir_planner.program.movements import Movements
from ir_planner.program.pause_lengths import PauseLengths, lengths_of
from ir_planner.program.pauses import AUTO, Charge, PlannedPause, spent, switch_times
from ir_planner.program.program import outlook, plan_program, prepared, program_of
from ir_planner.program.request import (
    ProgramPlan,
    ProgramRequest,
    Progress,
    StageError,
    nobody,
    unknown_searches,
)
from ir_planner.program.rests import MOTORS, Rests, Steps, at_once, rests_at
from ir_planner.program.savings import common_program, savings_of
from ir_planner.program.spreads import Spreads, with_intervals
from ir_planner.program.standby import Standby, plan_standby
from ir_planner.program.station_chain import cheapest_chain
from ir_planner.program.station_graph import ACROSS, ENTER, LEAVE, HopPart, StationChain
from ir_planner.program.steps import (
    Doors,
    PlacedStep,
    Route,
    Scenes,
    doors_advice,
    doors_along,
    doors_text,
    placed_steps,
    with_doors,
)
from ir_planner.program.stop_nodes import StopNode, station_nodes
from ir_planner.program.timeouts import Timeouts

__all__ = [
    "ACROSS",
    "AUTO",
    "ENTER",
    "LEAVE",
    "MOTORS",
    "Charge",
    "Choice",
    "Doors",
    "HopPart",
    "Ladder",
    "Movements",
    "PauseLengths",
    "PlacedStep",
    "PlannedPause",
    "ProgramPlan",
    "ProgramRequest",
    "Progress",
    "Rests",
    "Route",
    "Scenes",
    "Spreads",
    "StageError",
    "Standby",
    "StationChain",
    "Steps",
    "StopNode",
    "TimeValues",
    "Timeouts",
    "at_once",
    "cheapest_chain",
    "chosen",
    "common_program",
    "doors_advice",
    "doors_along",
    "doors_text",
    "lengths_of",
    "nobody",
    "outlook",
    "placed_steps",
    "plan_program",
    "plan_standby",
    "prepared",
    "program_of",
    "rests_at",
    "savings_of",
    "spent",
    "station_nodes",
    "switch_times",
    "unknown_searches",
    "with_doors",
    "with_intervals",
]
