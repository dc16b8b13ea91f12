"""A simulated KUKA KR210 on a KR C4: trajectories, power modes, PLC, mains meter. The core runs
without ROS.

simulation = make_simulation("demo")
simulation.run(1.0)
"""

from ir_sim_driver.controller import Driver, Simulation, SimulationSettings, make_simulation
from ir_sim_driver.errors import DriverError, TrajectoryRefusedError
from ir_sim_driver.motion import ErrorCode, ExecutionSettings, TrajectoryGoal

__all__ = [
    "Driver",
    "DriverError",
    "ErrorCode",
    "ExecutionSettings",
    "Simulation",
    "SimulationSettings",
    "TrajectoryGoal",
    "TrajectoryRefusedError",
    "make_simulation",
]
