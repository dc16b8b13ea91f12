"""Whole programs: configurations at the stations, all movements and pauses between them, power modes."""

from ir_planner.program.front import plan_front
from ir_planner.program.program import plan_program
from ir_planner.program.request import ProgramPlan, ProgramRequest
from ir_planner.program.saving_request import SavingPlan, plan_savings
from ir_planner.program.savings import Saving, Savings
from ir_planner.program.standby import Standby, plan_standby

__all__ = [
    "ProgramPlan",
    "ProgramRequest",
    "Saving",
    "SavingPlan",
    "Savings",
    "Standby",
    "plan_front",
    "plan_program",
    "plan_savings",
    "plan_standby",
]
