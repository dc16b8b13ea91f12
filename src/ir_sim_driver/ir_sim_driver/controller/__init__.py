"""The controller around the plant: the stepped simulation, its settings, and the driver that runs
it.
"""

from ir_sim_driver.controller.driver import Driver
from ir_sim_driver.controller.goals import ended_by_stop, refused
from ir_sim_driver.controller.outputs import Frame, Joints, PartStatus
from ir_sim_driver.controller.settings import ControllerSettings, SimulationSettings
from ir_sim_driver.controller.simulation import Simulation, make_simulation
from ir_sim_driver.controller.supervision import SupervisionSettings
from ir_sim_driver.controller.surroundings import PlannedCell

__all__ = [
    "ControllerSettings",
    "Driver",
    "Frame",
    "Joints",
    "PartStatus",
    "PlannedCell",
    "Simulation",
    "SimulationSettings",
    "SupervisionSettings",
    "ended_by_stop",
    "make_simulation",
    "refused",
]
