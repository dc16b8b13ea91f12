"""The robot, what it carries, and the power figures of its controller."""

from ir_description.robot.frames import TOOL0, FramePose, fixed_frames, moving_frames
from ir_description.robot.load import MASS_MAX, Load, total_mass
from ir_description.robot.power import (
    NO_TABLE,
    USUAL_LINK,
    ControllerMode,
    DcLink,
    EnergyShare,
    MeasuredPower,
    PlcBit,
    PowerData,
    without_table,
)
from ir_description.robot.power_parameters import (
    AXIS_UNITS,
    IDLE,
    SCALARS,
    PowerParameters,
    interval_over,
    parameter_names,
    parameter_unit,
    physical_bounds,
)
from ir_description.robot.prior import DATA_SHEET, RELATIVE_DEVIATION, prior
from ir_description.robot.robot import Counterbalance, RobotModel

__all__ = [
    "AXIS_UNITS",
    "DATA_SHEET",
    "IDLE",
    "MASS_MAX",
    "NO_TABLE",
    "RELATIVE_DEVIATION",
    "SCALARS",
    "TOOL0",
    "USUAL_LINK",
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
    "interval_over",
    "moving_frames",
    "parameter_names",
    "parameter_unit",
    "physical_bounds",
    "prior",
    "total_mass",
    "without_table",
]
