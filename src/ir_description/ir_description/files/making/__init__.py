"""A robot file from a URDF and what is known of its drives."""

from ir_description.files.making.capsule_fit import (
    CapsuleFit,
    beside_axis,
    encloses,
    fitted,
    with_overhang,
)
from ir_description.files.making.estimates import holding_torques, with_masses
from ir_description.files.making.link_bodies import LinkBody, Meshes, link_bodies
from ir_description.files.making.robot_text import (
    TEMPLATE,
    DriveSheet,
    Value,
    drive_sheet,
    estimated_sheet,
    link_names,
    robot_text,
    with_home,
)
from ir_description.files.making.urdf_arm import UrdfArm, urdf_arm
from ir_description.files.making.urdf_tree import xml_text
from ir_description.files.making.xacro_file import expanded

__all__ = [
    "TEMPLATE",
    "CapsuleFit",
    "DriveSheet",
    "LinkBody",
    "Meshes",
    "UrdfArm",
    "Value",
    "beside_axis",
    "drive_sheet",
    "encloses",
    "estimated_sheet",
    "expanded",
    "fitted",
    "holding_torques",
    "link_bodies",
    "link_names",
    "robot_text",
    "urdf_arm",
    "with_home",
    "with_masses",
    "with_overhang",
    "xml_text",
]
