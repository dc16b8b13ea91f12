"""Runs a planned program on the driver: movements, pauses with their power mode, signals of the
machines.
"""

from ir_program_runner.errors import CanceledError, ProgramError, RunnerError, StepFailedError
from ir_program_runner.fulfilment import DriverPort, Fulfilment, Ports
from ir_program_runner.machines import Machines
from ir_program_runner.program import Program, ProgramResult, check_program, load_after
from ir_program_runner.settings import LinkSettings, ProgramSettings

__all__ = [
    "CanceledError",
    "DriverPort",
    "Fulfilment",
    "LinkSettings",
    "Machines",
    "Ports",
    "Program",
    "ProgramError",
    "ProgramResult",
    "ProgramSettings",
    "RunnerError",
    "StepFailedError",
    "check_program",
    "load_after",
]
