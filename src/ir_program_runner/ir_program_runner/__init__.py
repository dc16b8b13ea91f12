"""Runs a planned program on the driver: movements, pauses with their power mode, signals of the
machines.
"""

from ir_program_runner.machines import Machines
from ir_program_runner.program import Program, ProgramResult
from ir_program_runner.settings import ProgramSettings

__all__ = [
    "Machines",
    "Program",
    "ProgramResult",
    "ProgramSettings",
]
