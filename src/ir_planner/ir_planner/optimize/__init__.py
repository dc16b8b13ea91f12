"""Optimisation: path and time scaling descend together to certified movements; several are compared."""

from ir_planner.optimize.descents import Descents, Measured, Task, path_of
from ir_planner.optimize.path_timing import Paced, along_its_path
from ir_planner.optimize.portfolio import Portfolio
from ir_planner.optimize.refinement import Refinement, movement_over

__all__ = [
    "Descents",
    "Measured",
    "Paced",
    "Portfolio",
    "Refinement",
    "Task",
    "along_its_path",
    "movement_over",
    "path_of",
]
