"""How far a robot may be from its data sheet, before anything is measured: from the marks of
confidence.

This is the one table of the planner's assumptions: its intervals, the reserve of torque and the
start of a fit read it. The plants of the simulation are drawn by rules of their own
(docs/plant.md), so that what holds on them is a finding.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ir_description.robot.power import PowerData
from ir_description.robot.power_parameters import IDLE, SCALARS, PowerParameters, parameter_names
from ir_description.robot.robot import RobotModel

DATA_SHEET = "data_sheet"
"""Name of the parameters that are the data's own."""

RELATIVE_DEVIATION = {"H": 0.02, "M": 0.10, "L": 0.30}
"""Standard deviation as a share of the value, by the mark of confidence in the data."""

_FACTORS = {"viscous": 1.5, "coulomb": 1.5}
"""Friction is this much less certain than its mark says: it changes with temperature, grease and
wear.
"""

COUNTERBALANCE = 0.03
"""Gas pressure of the counterbalance: filled and checked to a few per cent, whatever its geometry's
mark.
"""

LOAD_MASS = 0.01
TOOL_WATTS = 0.20
"""Of the declared load and of the tool's declared watts: the cell files have no marks."""

IRON_SHARE = 0.005
"""Iron loss at full speed, as a share of peak torque times full speed: half normal, its scale."""

INVERTER_WATTS = 3.0
"""W per Nm of motor torque: 1 to 2 V across each conducting switch, 1 to 2 A per Nm; half
normal.
"""

GEAR_SHARE = 0.04
"""Loss of the gears that grows with the torque, beyond the friction that the data have; half
normal.
"""

IDLE_WATTS = 10.0
"""Per axis: switching losses of an inverter without a current; half normal. The data count them
with the drives, which they can't exceed; but they come from the DC link, where braking axes pay for
them.
"""

RECTIFIER_LOSS = 0.02
"""Diode rectifier and mains filter; half normal below 1."""


_PLACES = {
    "viscous": "drives.friction_viscous_nms_rad",
    "coulomb": "drives.friction_coulomb_nm",
    "copper": "drives.copper_loss_w_per_nm2",
    "rotor_inertia": "drives.reflected_inertia_kgm2",
    "drives_watts": "drives_and_brake_release_w",
}

Marks = Mapping[str, str]
"""H, M or L by the place of a figure in its file."""


def prior(robot: RobotModel, power: PowerData, marks: Marks) -> PowerParameters:
    """The parameters as the data have them, independent, with the deviations of this module."""
    joints = robot.joint_names
    modes = tuple(mode.name for mode in power.modes)
    names = parameter_names(joints, modes)
    watts = [
        float(robot.idle_loss.sum()),
        power.drives_and_brake_release,
        *(mode.controller_watts for mode in power.modes),
    ]
    means = (
        robot.friction_viscous,
        robot.friction_coulomb,
        robot.copper_loss,
        robot.iron_loss,
        robot.inverter_loss,
        robot.gear_loss,
    )  # in the order of AXIS_UNITS
    mean = np.concatenate([*means, np.ones(len(SCALARS)), watts])
    known = [_mark(name, robot, marks) for name in names]
    share = np.array([RELATIVE_DEVIATION.get(mark, 0.0) for mark in known])
    deviation = (
        np.abs(mean)
        * share
        * np.array([_FACTORS.get(name.partition(".")[0], 1.0) for name in names])
    )
    for name, value in _assumed(robot, power).items():
        deviation[names.index(name)] = value
    return PowerParameters(
        name=DATA_SHEET,
        robot=robot.name,
        controller=power.name,
        joints=joints,
        modes=modes,
        mean=mean,
        covariance=np.diag(deviation**2),
        sources=tuple(f"data {mark}" if mark else "assumed" for mark in known),
    )


def _assumed(robot: RobotModel, power: PowerData) -> dict[str, float]:
    """Standard deviations of what the data have no mark for."""
    iron = IRON_SHARE * robot.envelope_torque[:, 0] / robot.velocity_max
    return {
        **{
            f"iron.{joint}": float(value)
            for joint, value in zip(robot.joint_names, iron, strict=True)
        },
        **{f"inverter.{joint}": INVERTER_WATTS for joint in robot.joint_names},
        **{f"gear.{joint}": GEAR_SHARE for joint in robot.joint_names},
        "load_mass": LOAD_MASS,
        "counterbalance": COUNTERBALANCE,
        "tool_watts": TOOL_WATTS,
        "rectifier_efficiency": RECTIFIER_LOSS,
        IDLE: min(IDLE_WATTS * robot.n, power.drives_and_brake_release),
    }


def _mark(name: str, robot: RobotModel, marks: Marks) -> str:
    """The mark of a parameter; "" where the data say nothing of it."""
    kind, _, part = name.partition(".")
    if kind == "link_mass":
        return _of_most(robot, marks)
    place = f"modes.{part}.controller_w" if kind == "watts" else _PLACES.get(kind)
    return marks.get(place, "L") if place else ""


def _of_most(robot: RobotModel, marks: Marks) -> str:
    """The mark that most of the moving mass has."""
    mass_of = dict.fromkeys(RELATIVE_DEVIATION, 0.0)
    for link, mass in zip(robot.link_names[1:], robot.link_mass[1:], strict=True):
        mass_of[marks.get(f"links.{link}.mass_kg", "L")] += float(mass)
    return max(mass_of, key=lambda mark: mass_of[mark])
