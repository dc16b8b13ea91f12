"""Files and texts: cells, robots, power figures and meshes in, cells and URDF out."""

from ir_description.files.all_errors import cell_errors
from ir_description.files.cell_hash import cell_hash
from ir_description.files.cell_reader import read_cell
from ir_description.files.cell_writer import cell_to_yaml
from ir_description.files.confidence import confidence_marks
from ir_description.files.mesh import read_regular_file
from ir_description.files.power_file import power_from_yaml
from ir_description.files.power_parameters_file import power_parameters_from_yaml, power_parameters_to_yaml
from ir_description.files.robot_file import robot_from_yaml
from ir_description.files.urdf import robot_urdf

__all__ = [
    "cell_errors",
    "cell_hash",
    "cell_to_yaml",
    "confidence_marks",
    "power_from_yaml",
    "power_parameters_from_yaml",
    "power_parameters_to_yaml",
    "read_cell",
    "read_regular_file",
    "robot_from_yaml",
    "robot_urdf",
]
