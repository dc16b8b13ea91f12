"""Whole programs: configurations at the stations, all movements and pauses between them, power modes."""

from ir_planner.program.program import plan_program
from ir_planner.program.request import ProgramPlan, ProgramRequest, Progress, nobody
from ir_planner.program.standby import Standby, plan_standby

__all__ = [
    "ProgramPlan",
    "ProgramRequest",
    "Progress",
    "Standby",
    "nobody",
    "plan_program",
    "plan_standby",
]
