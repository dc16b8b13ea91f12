"""The robot and the cells as data: limits, drives, power modes, cells, and their typed, validated loading."""

from ir_description.capsule import Capsule
from ir_description.errors import (
    CellFileError,
    DescriptionError,
    DescriptionFileError,
    InvalidValueError,
    RobotFileError,
    UnknownNameError,
)
from ir_description.library import bundled_robots, load_power_data, load_robot
from ir_description.load import Load
from ir_description.power import PowerData
from ir_description.robot import Counterbalance, RobotModel

__all__ = [
    "Capsule",
    "CellFileError",
    "Counterbalance",
    "DescriptionError",
    "DescriptionFileError",
    "InvalidValueError",
    "Load",
    "PowerData",
    "RobotFileError",
    "RobotModel",
    "UnknownNameError",
    "bundled_robots",
    "load_power_data",
    "load_robot",
]
