"""Does the robot carry what was declared? Expected against found torque of a movement, by least
squares.
"""

from ir_sim_driver.load_check.mass_estimate import (
    Declared,
    LoadFinding,
    NotedMotion,
    Uncertainty,
    weighed,
)
from ir_sim_driver.load_check.torque_check import LoadChecks, LoadCheckSettings

__all__ = [
    "Declared",
    "LoadCheckSettings",
    "LoadChecks",
    "LoadFinding",
    "NotedMotion",
    "Uncertainty",
    "weighed",
]
