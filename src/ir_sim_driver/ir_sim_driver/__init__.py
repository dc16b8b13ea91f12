"""A simulated KUKA KR210 on a KR C4: trajectories, power modes, PLC, mains meter. The core runs
without ROS.

simulation = make_simulation("demo")
simulation.run(1.0)
"""

from ir_sim_driver.controller import (
    ControllerSettings,
    Driver,
    Simulation,
    SimulationSettings,
    make_simulation,
)
from ir_sim_driver.errors import DriverError, RequestRefusedError, TrajectoryRefusedError
from ir_sim_driver.load_check import LoadCheckSettings, LoadFinding
from ir_sim_driver.motion import ErrorCode, ExecutionSettings, GoalOutcome, TrajectoryGoal
from ir_sim_driver.plant import ControlSettings, carried, custom_load
from ir_sim_driver.plc import PlcSettings, usable_links
from ir_sim_driver.power import IdleTimes

__all__ = [
    "ControlSettings",
    "ControllerSettings",
    "Driver",
    "DriverError",
    "ErrorCode",
    "ExecutionSettings",
    "GoalOutcome",
    "IdleTimes",
    "LoadCheckSettings",
    "LoadFinding",
    "PlcSettings",
    "RequestRefusedError",
    "Simulation",
    "SimulationSettings",
    "TrajectoryGoal",
    "TrajectoryRefusedError",
    "carried",
    "custom_load",
    "make_simulation",
    "usable_links",
]
