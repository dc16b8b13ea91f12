"""Optimisation: path and time scaling are optimised together to certified movements; several are
compared.
"""

from ir_planner.optimize.descents import Descents, path_of
from ir_planner.optimize.path_timing import QUICK_TIMING, rescaled
from ir_planner.optimize.portfolio import Portfolio
from ir_planner.optimize.refinement import (
    QUICK,
    THOROUGH,
    Refinement,
    movement_over,
    optimised_near,
    optimised_near_best,
)

__all__ = [
    "QUICK",
    "QUICK_TIMING",
    "THOROUGH",
    "Descents",
    "Portfolio",
    "Refinement",
    "movement_over",
    "optimised_near",
    "optimised_near_best",
    "path_of",
    "rescaled",
]
