"""The robot, what it carries, and the power figures of its controller."""

from ir_description.robot.load import MASS_MAX, Load, total_mass
from ir_description.robot.power import ControllerMode, DcLink, EnergyShare, MeasuredPower, PlcBit, PowerData
from ir_description.robot.robot import Counterbalance, RobotModel

__all__ = [
    "MASS_MAX",
    "ControllerMode",
    "Counterbalance",
    "DcLink",
    "EnergyShare",
    "Load",
    "MeasuredPower",
    "PlcBit",
    "PowerData",
    "RobotModel",
    "total_mass",
]
