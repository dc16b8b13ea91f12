"""The robot, what it carries, and the power figures of its controller."""

from ir_description.robot.frames import FramePose, fixed_frames, moving_frames
from ir_description.robot.load import MASS_MAX, Load, total_mass
from ir_description.robot.power import ControllerMode, DcLink, EnergyShare, MeasuredPower, PlcBit, PowerData
from ir_description.robot.power_parameters import (
    AXIS_UNITS,
    SCALARS,
    PowerParameters,
    parameter_names,
    parameter_unit,
    physical_bounds,
)
from ir_description.robot.prior import DATA_SHEET, RELATIVE_DEVIATION, prior
from ir_description.robot.robot import Counterbalance, RobotModel

__all__ = [
    "AXIS_UNITS",
    "DATA_SHEET",
    "MASS_MAX",
    "RELATIVE_DEVIATION",
    "SCALARS",
    "ControllerMode",
    "Counterbalance",
    "DcLink",
    "EnergyShare",
    "FramePose",
    "Load",
    "MeasuredPower",
    "PlcBit",
    "PowerData",
    "PowerParameters",
    "RobotModel",
    "fixed_frames",
    "moving_frames",
    "parameter_names",
    "parameter_unit",
    "physical_bounds",
    "prior",
    "total_mass",
]
