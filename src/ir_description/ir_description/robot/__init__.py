"""The robot, what it carries, and the power figures of its controller."""

from ir_description.robot.frames import FramePose, fixed_frames, moving_frames
from ir_description.robot.load import MASS_MAX, Load, total_mass
from ir_description.robot.power import ControllerMode, DcLink, EnergyShare, MeasuredPower, PlcBit, PowerData
from ir_description.robot.robot import Counterbalance, RobotModel

__all__ = [
    "MASS_MAX",
    "ControllerMode",
    "Counterbalance",
    "DcLink",
    "EnergyShare",
    "FramePose",
    "Load",
    "MeasuredPower",
    "PlcBit",
    "PowerData",
    "RobotModel",
    "fixed_frames",
    "moving_frames",
    "total_mass",
]
