"""Does the robot carry what was declared? Expected against found torque of a movement, by least
squares.
"""

from ir_sim_driver.load_check.checks import LoadChecks
from ir_sim_driver.load_check.estimate import Declared, LoadFinding, Motion, weighed
from ir_sim_driver.load_check.settings import LoadCheckSettings
from ir_sim_driver.load_check.uncertainty import Uncertainty
from ir_sim_driver.load_check.watch import LoadWatch

__all__ = [
    "Declared",
    "LoadCheckSettings",
    "LoadChecks",
    "LoadFinding",
    "LoadWatch",
    "Motion",
    "Uncertainty",
    "weighed",
]
