"""Optimisation: path and time scaling are optimised together to certified movements; several are
compared.
"""

from ir_planner.optimize.descents import Descents, path_of
from ir_planner.optimize.path_timing import (
    QUICK_TIMING,
    PathTiming,
    TimingEffort,
    along_its_path,
    rescaled,
)
from ir_planner.optimize.portfolio import Portfolio, estimate
from ir_planner.optimize.refinement import (
    EXACT,
    FEWEST,
    MOST,
    QUICK,
    SPACING,
    THOROUGH,
    Refinement,
    movement_over,
    optimised_near,
    optimised_near_best,
)

__all__ = [
    "EXACT",
    "FEWEST",
    "MOST",
    "QUICK",
    "QUICK_TIMING",
    "SPACING",
    "THOROUGH",
    "Descents",
    "PathTiming",
    "Portfolio",
    "Refinement",
    "TimingEffort",
    "along_its_path",
    "estimate",
    "movement_over",
    "optimised_near",
    "optimised_near_best",
    "path_of",
    "rescaled",
]
