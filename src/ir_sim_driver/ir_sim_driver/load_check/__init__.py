"""Does the robot carry what was declared? Expected against found torque of a movement, by least
squares.
"""

from ir_sim_driver.load_check.checks import LoadChecks, LoadCheckSettings
from ir_sim_driver.load_check.estimate import (
    Declared,
    LoadFinding,
    NotedMotion,
    Uncertainty,
    weighed,
)

__all__ = [
    "Declared",
    "LoadCheckSettings",
    "LoadChecks",
    "LoadFinding",
    "NotedMotion",
    "Uncertainty",
    "weighed",
]
