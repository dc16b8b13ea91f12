"""A robot file from a URDF and a sheet of drive figures."""

from ir_description.files.making.capsule_fit import CapsuleFit, fitted
from ir_description.files.making.robot_text import TEMPLATE, DriveSheet, drive_sheet, robot_text
from ir_description.files.making.urdf_arm import UrdfArm, urdf_arm

__all__ = [
    "TEMPLATE",
    "CapsuleFit",
    "DriveSheet",
    "UrdfArm",
    "drive_sheet",
    "fitted",
    "robot_text",
    "urdf_arm",
]
