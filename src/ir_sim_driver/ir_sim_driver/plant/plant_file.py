"""Plant files: every figure of a plant as YAML. What a file leaves out is nominal."""

from __future__ import annotations

import re
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml

from ir_description import DescriptionFileError, InvalidValueError, PowerData, RobotModel
from ir_description.files import read_regular_file
from ir_description.files.items import Item, read_items
from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.plant.plant_parameters import (
    DriveFigures,
    GearFigures,
    LinkFigures,
    Plant,
    StandingWatts,
    nominal_plant,
)

FORMAT = "ir_sim_driver/plant/1"
_FORMAT = re.compile(rf"""["']?\bformat["']?\s*:\s*["']?{re.escape(FORMAT)}\b""")
BYTES_MAX = 1_000_000
"""Largest plant file [bytes]."""
Figures = TypeVar("Figures", DriveFigures, GearFigures, LinkFigures)
_Keys = dict[str, tuple[str, float, float, str]]

# key in the file: field, smallest and largest value, unit. What the simulation divides by has a
# smallest value, below that of any servo drive.
_DRIVES: _Keys = {
    "torque_constant_nm_per_a": ("torque_constant", 1e-3, 1e3, "Nm/A"),
    "copper_loss_w_per_nm2": ("copper", 0.0, 1e4, "W/Nm^2"),
    "inverter_w_per_a": ("inverter", 0.0, 1e4, "W/A"),
    "switching_w": ("switching", 0.0, 1e4, "W"),
    "iron_w_s_per_rad": ("iron_linear", 0.0, 1e3, "W s/rad"),
    "iron_w_s2_per_rad2": ("iron_square", 0.0, 1e3, "W s^2/rad^2"),
}
_GEARS: _Keys = {
    "friction_viscous_nms_per_rad": ("viscous", 0.0, 1e5, "Nm s/rad"),
    "friction_coulomb_nm": ("coulomb", 0.0, 1e5, "Nm"),
    "load_share_driven": ("load_driven", 0.0, 0.5, ""),
    "load_share_back": ("load_back", 0.0, 0.5, ""),
    "stribeck_nm": ("stribeck", 0.0, 1e5, "Nm"),
    "stribeck_speed_rad_per_s": ("stribeck_speed", 1e-4, 10.0, "rad/s"),
    "viscous_per_kelvin": ("viscous_per_kelvin", 0.0, 0.2, "1/K"),
    "heat_capacity_j_per_k": ("capacity", 0.1, 1e9, "J/K"),
    "conductance_w_per_k": ("conductance", 0.0, 1e6, "W/K"),
    "ambient_deg_c": ("ambient", 0.0, 100.0, "deg C"),
    "start_deg_c": ("start", 0.0, 150.0, "deg C"),
}
_LINK: _Keys = {
    "capacitance_f": ("capacitance", 1e-5, 10.0, "F"),
    "mains_v": ("mains", 10.0, 1e4, "V"),
    "chopper_on_v": ("chopper_on", 0.0, 1e4, "V"),
    "chopper_off_v": ("chopper_off", 0.0, 1e4, "V"),
    "brake_resistor_ohm": ("resistor", 0.1, 1e4, "ohm"),
    "rectifier_drop_v": ("rectifier_drop", 0.0, 100.0, "V"),
    "rectifier_resistance_ohm": ("rectifier_resistance", 0.0, 100.0, "ohm"),
}
_LINK_KEYS = ("name", "mass_kg", "com_m", "inertia_kgm2")
_WATTS = ("controller_w", "drives_w", "tool_factor")
_ROBOT = ("links", "reflected_inertia_kgm2", "charge_pressure_pa")


class PlantFileError(DescriptionFileError):
    """A plant file that can't be read: path, line, and what is wrong."""


def read_plant(path: str, robot: RobotModel, data: PowerData) -> Plant:
    """The plant of a file for this robot. Raises PlantFileError, which quotes nothing of other
    files.
    """
    try:
        text = read_regular_file(Path(path), BYTES_MAX).decode("utf-8")
    except InvalidValueError as error:
        raise PlantFileError(path, 0, str(error)) from error
    except UnicodeDecodeError as error:
        raise PlantFileError(path, 0, "this is no plant file: it is no text in UTF-8") from error
    if not _FORMAT.search(text):
        raise PlantFileError(path, 0, f"this is no plant file: it has no format: {FORMAT}")
    return plant_from_yaml(text, robot, data, path)


def plant_from_yaml(text: str, robot: RobotModel, data: PowerData, source: str = "<text>") -> Plant:
    """The plant of a text; what it leaves out is that of the nominal plant. Raises
    PlantFileError.
    """
    nominal = nominal_plant(robot, data)
    root = read_items(text, source, PlantFileError)
    top = root.table(("format", "name", "robot"), (*_ROBOT, "drives", "gears", "dc_link", "watts"))
    top["format"].choice((FORMAT,))
    top["robot"].choice((robot.name,))
    with root.blamed():
        changed = _robot(top.get("links"), robot)
        if "reflected_inertia_kgm2" in top:
            rotors = top["reflected_inertia_kgm2"].numbers(robot.n, 0.0, 1e6, "kg m^2")
            changed = replace(changed, reflected_inertia=rotors)
        spring = robot.counterbalance
        pressure = top.get("charge_pressure_pa")
        if spring is not None and pressure is not None:
            value = pressure.number(0.0, 1e9, "Pa", above=True)
            changed = replace(changed, counterbalance=replace(spring, charge_pressure=value))
        return Plant(
            top["name"].text(64),
            changed,
            _figures(top.get("drives"), nominal.drives, _DRIVES, robot.n),
            _figures(top.get("gears"), nominal.gears, _GEARS, robot.n),
            _figures(top.get("dc_link"), nominal.link, _LINK, 0),
            _watts(top.get("watts"), nominal.watts),
        )


def plant_to_yaml(plant: Plant) -> str:
    """All figures of a plant, for `plant_from_yaml`."""
    robot = plant.robot
    content = {
        "format": FORMAT,
        "name": plant.name,
        "robot": robot.name,
        "links": [
            {"name": name, "mass_kg": float(m), "com_m": com.tolist(), "inertia_kgm2": _entries(J)}
            for name, m, com, J in zip(
                robot.link_names, robot.link_mass, robot.link_com, robot.link_inertia, strict=True
            )
        ],
        "reflected_inertia_kgm2": robot.reflected_inertia.tolist(),
        "drives": _written(plant.drives, _DRIVES),
        "gears": _written(plant.gears, _GEARS),
        "dc_link": _written(plant.link, _LINK),
        "watts": {
            "controller_w": {mode.name: float(w) for mode, w in plant.watts.controller.items()},
            "drives_w": float(plant.watts.drives),
            "tool_factor": float(plant.watts.tool),
        },
    }
    if robot.counterbalance is not None:
        content["charge_pressure_pa"] = robot.counterbalance.charge_pressure
    return str(yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=110))


def plant_hash(plant: Plant) -> str:
    """Hash of all figures of a plant, whatever file or seed they are from."""
    return sha256(plant_to_yaml(replace(plant, name="")).encode()).hexdigest()


def _robot(links: Item | None, robot: RobotModel) -> RobotModel:
    """The robot with the masses, centres and inertias of the file."""
    mass, com, inertia = (
        np.array(x) for x in (robot.link_mass, robot.link_com, robot.link_inertia)
    )
    for item in [] if links is None else links.list(0, robot.n + 1):
        table = item.table(_LINK_KEYS[:1], _LINK_KEYS[1:])
        i = robot.link_names.index(table["name"].choice(robot.link_names))
        if "mass_kg" in table:
            mass[i] = table["mass_kg"].number(0.0, 1e5, "kg", above=True)
        if "com_m" in table:
            com[i] = table["com_m"].numbers(3, -100.0, 100.0, "m")
        if "inertia_kgm2" in table:
            xx, yy, zz, xy, xz, yz = table["inertia_kgm2"].numbers(6, -1e6, 1e6, "kg m^2")
            inertia[i] = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    return replace(robot, link_mass=mass, link_com=com, link_inertia=inertia)


def _figures(item: Item | None, nominal: Figures, keys: _Keys, n: int) -> Figures:
    """The figures of a section; n: entries of each, 0: numbers."""
    if item is None:
        return nominal
    table = item.table((), tuple(keys))
    given: dict[str, Any] = {}
    for key, (field, low, high, unit) in keys.items():
        found = table.get(key)
        if found is not None:
            given[field] = found.numbers(n, low, high, unit) if n else found.number(low, high, unit)
    with item.blamed():
        return replace(nominal, **given)


def _watts(item: Item | None, nominal: StandingWatts) -> StandingWatts:
    if item is None:
        return nominal
    table = item.table((), _WATTS)
    controller = dict(nominal.controller)
    if "controller_w" in table:
        modes = table["controller_w"].table((), [mode.name for mode in controller])
        for mode in controller:
            watts = modes.get(mode.name)
            controller[mode] = controller[mode] if watts is None else watts.number(0.0, 1e5, "W")
    drives = table.get("drives_w")
    tool = table.get("tool_factor")
    return StandingWatts(
        controller,
        nominal.drives if drives is None else drives.number(0.0, 1e5, "W"),
        nominal.tool if tool is None else tool.number(0.0, 10.0),
    )


def _written(figures: Figures, keys: _Keys) -> dict[str, object]:
    return {key: np.array(getattr(figures, field)).tolist() for key, (field, *_) in keys.items()}


def _entries(inertia: FloatArray) -> list[float]:
    J = inertia.tolist()
    return [J[0][0], J[1][1], J[2][2], J[0][1], J[0][2], J[1][2]]
