"""The robot and the cells as data: limits, drives, power modes, cells, and their typed, validated
loading.
"""

from ir_description.cell import Cell, Equipment, PartPlaces, ProgramStep, RobotCells, Station
from ir_description.cell_review import check_cell
from ir_description.files import cell_hash, cell_to_yaml, is_path, robot_urdf
from ir_description.library import (
    bundled_cells,
    bundled_robots,
    cell_from_yaml,
    data_sheet,
    data_sheet_of,
    load_cell,
    load_power_data,
    load_robot,
    load_robot_cells,
)
from ir_description.robot import Load, PowerData, PowerParameters, RobotModel
from ir_description.shapes import Body
from ir_values.errors import (
    CellFileError,
    DescriptionError,
    DescriptionFileError,
    InvalidValueError,
    UnknownNameError,
)

__all__ = [
    "Body",
    "Cell",
    "CellFileError",
    "DescriptionError",
    "DescriptionFileError",
    "Equipment",
    "InvalidValueError",
    "Load",
    "PartPlaces",
    "PowerData",
    "PowerParameters",
    "ProgramStep",
    "RobotCells",
    "RobotModel",
    "Station",
    "UnknownNameError",
    "bundled_cells",
    "bundled_robots",
    "cell_from_yaml",
    "cell_hash",
    "cell_to_yaml",
    "check_cell",
    "data_sheet",
    "data_sheet_of",
    "is_path",
    "load_cell",
    "load_power_data",
    "load_robot",
    "load_robot_cells",
    "robot_urdf",
]
