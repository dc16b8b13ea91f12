"""The robot and the cells as data: limits, drives, power modes, cells, and their typed, validated loading."""

from ir_description.cell import (
    AllowedContact,
    Cell,
    CellSignal,
    Equipment,
    EquipmentState,
    Part,
    PartPlaces,
    ProgramStep,
    StateSwitch,
    Station,
    Task,
    Zone,
)
from ir_description.cell_process import read_cell_apart
from ir_description.cell_review import Finding, check_cell
from ir_description.errors import (
    CellFileError,
    DescriptionError,
    DescriptionFileError,
    RobotFileError,
    UnknownNameError,
)
from ir_description.files import cell_hash, cell_to_yaml, robot_urdf
from ir_description.library import (
    bundled_cells,
    bundled_robots,
    cell_file_errors,
    cell_from_yaml,
    is_path,
    load_cell,
    load_power_data,
    load_robot,
    power_marks,
    robot_marks,
)
from ir_description.robot import (
    Counterbalance,
    FramePose,
    Load,
    PowerData,
    RobotModel,
    fixed_frames,
    moving_frames,
)
from ir_description.shapes import Body, Capsule
from ir_msgs_py.errors import InvalidValueError
from ir_msgs_py.plc import Signal

__all__ = [
    "AllowedContact",
    "Body",
    "Capsule",
    "Cell",
    "CellFileError",
    "CellSignal",
    "Counterbalance",
    "DescriptionError",
    "DescriptionFileError",
    "Equipment",
    "EquipmentState",
    "Finding",
    "FramePose",
    "InvalidValueError",
    "Load",
    "Part",
    "PartPlaces",
    "PowerData",
    "ProgramStep",
    "RobotFileError",
    "RobotModel",
    "Signal",
    "StateSwitch",
    "Station",
    "Task",
    "UnknownNameError",
    "Zone",
    "bundled_cells",
    "bundled_robots",
    "cell_file_errors",
    "cell_from_yaml",
    "cell_hash",
    "cell_to_yaml",
    "check_cell",
    "fixed_frames",
    "is_path",
    "load_cell",
    "load_power_data",
    "load_robot",
    "moving_frames",
    "power_marks",
    "read_cell_apart",
    "robot_marks",
    "robot_urdf",
]
