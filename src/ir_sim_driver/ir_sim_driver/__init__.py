"""A simulated KUKA KR210 on a KR C4: trajectories, power modes, PLC, mains meter. The core runs
without ROS.

simulation = make_simulation("demo")
simulation.run(1.0)
"""

from ir_msgs_py.modes import MODES
from ir_sim_driver.controller import (
    ControllerSettings,
    Driver,
    Simulation,
    SimulationSettings,
    VettedGoal,
    make_simulation,
)
from ir_sim_driver.errors import (
    BackendError,
    DriverError,
    LinkError,
    RequestRefusedError,
    SettingsError,
    TrajectoryRefusedError,
)
from ir_sim_driver.load_check import LoadCheckSettings, LoadFinding
from ir_sim_driver.motion import (
    ErrorCode,
    ExecutionSettings,
    GoalOutcome,
    JointTolerance,
    TrajectoryGoal,
)
from ir_sim_driver.plant import (
    BACKENDS,
    Backend,
    Carried,
    ControlSettings,
    MotorWork,
    carried,
    custom_load,
)
from ir_sim_driver.plc import LINKS, Link, PlcSettings, usable_links
from ir_sim_driver.power import IdleTimes

__all__ = [
    "BACKENDS",
    "LINKS",
    "MODES",
    "Backend",
    "BackendError",
    "Carried",
    "ControlSettings",
    "ControllerSettings",
    "Driver",
    "DriverError",
    "ErrorCode",
    "ExecutionSettings",
    "GoalOutcome",
    "IdleTimes",
    "JointTolerance",
    "Link",
    "LinkError",
    "LoadCheckSettings",
    "LoadFinding",
    "MotorWork",
    "PlcSettings",
    "RequestRefusedError",
    "SettingsError",
    "Simulation",
    "SimulationSettings",
    "TrajectoryGoal",
    "TrajectoryRefusedError",
    "VettedGoal",
    "carried",
    "custom_load",
    "make_simulation",
    "usable_links",
]
