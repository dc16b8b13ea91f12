"""Files and texts: cells, robots, power figures and meshes in, cells and URDF out."""

from ir_description.files.cell_reader import ROBOT_MARK, cell_errors, read_cell, read_robot_cells
from ir_description.files.cell_writer import cell_hash, cell_to_yaml
from ir_description.files.power_file import (
    bundled_controller,
    bundled_controllers,
    power_from_yaml,
    power_parameters_from_yaml,
    power_parameters_to_yaml,
)
from ir_description.files.program_reader import path_from_yaml
from ir_description.files.robot_file import read_robot, robot_file_errors, robot_from_yaml
from ir_description.files.subject_lines import subject_line
from ir_description.files.urdf_writer import robot_urdf
from ir_values.files import is_path, read_regular_file, text_of
from ir_values.yaml_tree import plain_yaml

__all__ = [
    "ROBOT_MARK",
    "bundled_controller",
    "bundled_controllers",
    "cell_errors",
    "cell_hash",
    "cell_to_yaml",
    "is_path",
    "path_from_yaml",
    "plain_yaml",
    "power_from_yaml",
    "power_parameters_from_yaml",
    "power_parameters_to_yaml",
    "read_cell",
    "read_regular_file",
    "read_robot",
    "read_robot_cells",
    "robot_file_errors",
    "robot_from_yaml",
    "robot_urdf",
    "subject_line",
    "text_of",
]
