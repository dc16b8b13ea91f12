"""Plants: nominal, drawn by seed, read from a file, and chosen by a text."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml

from ir_description import DescriptionFileError, InvalidValueError, PowerData, RobotModel, is_path
from ir_description.files import read_regular_file
from ir_sim_driver.errors import SettingsError
from ir_sim_driver.plant.plant_parameters import (
    NOMINAL,
    DriveFigures,
    GearFigures,
    LinkFigures,
    Plant,
    StandingWatts,
    nominal_plant,
)
from ir_values.arrays import FloatArray
from ir_values.yaml_items import Item, read_items

# Typical plants: figures drawn by seed, spread as far as the data's marks of confidence say.
#
# Each figure of the data is scaled by a factor of its own. Terms that the data do not know have
# the values and the spread below. docs/plant.md has the sources and what is assumed.

TYPICAL = "typical"
UNMARKED = "L"  # of figures of a controller whose table nobody has: known least
SPREAD: Mapping[str, float] = {"H": 0.01, "M": 0.05, "L": 0.2}
"""Standard deviation of a figure by its confidence mark, as a share of the figure."""
CUT = 2.5
"""Standard deviations beyond which nothing is drawn."""
LINK_SIZE = 0.2
"""m: a centre of mass is off by the spread times this, in each direction."""
SUPPLY = 0.02
"""Standard deviation of the mains voltage, as a share: most stay well within 10 %."""
THRESHOLDS = 0.01
"""Standard deviation of the chopper's voltages, as a share: they are set by resistors of 1 %."""

INVERTER_SHARE = 0.35
"""Of the holding losses that the data, calibrated at the mains, call copper: the part of the
inverter.
"""
SWITCHING = 10.0
"""W per axis: a part of the watts that the data give for drives that are switched on."""
IRON = (0.04, 1.2e-4)
"""W s/rad and W s^2/rad^2 of a motor of 55 Nm: 45 W at its full speed."""
LOAD_SHARES = (0.02, 0.03)
"""Friction as a share of the torque through the gear, driven and driven back."""
STRIBECK = 0.1
"""Friction more at rest, as a share of the Coulomb friction."""
PER_KELVIN = 0.01
"""1/K by which viscous friction falls."""
WARM = 25.0
"""K above the hall: a plant starts anywhere between cold and this warm."""
RECTIFIER = (2.0, 0.2)
"""V of two diodes, ohm of diodes, choke and line."""


class _Draw:
    """Factors around 1 by mark, from a generator."""

    def __init__(self, generator: np.random.Generator) -> None:
        self._generator = generator

    def by(self, spread: float, n: int = 1) -> FloatArray:
        """n factors with this standard deviation."""
        return 1.0 + spread * np.clip(self._generator.standard_normal(n), -CUT, CUT)

    def mark(self, mark: str, n: int = 1) -> FloatArray:
        """n factors for figures with this mark."""
        return self.by(SPREAD[mark], n)

    def uniform(self) -> float:
        """Between 0 and 1."""
        return float(self._generator.uniform())

    def one(self, mark: str) -> float:
        """A factor for a figure with this mark."""
        return float(self.mark(mark)[0])


def typical_plant(robot: RobotModel, data: PowerData, seed: int) -> Plant:
    """The plant of this seed."""
    draw = _Draw(np.random.default_rng(seed))
    marks = robot.marks
    power = data.marks
    nominal = nominal_plant(robot, data)
    plant = Plant(
        f"{TYPICAL}:{seed}",
        _robot(robot, marks, draw),
        _drives(nominal, robot, marks, draw),
        _gears(nominal, robot, marks, draw),
        _link(nominal, data, power, draw),
        _watts(nominal, power, robot.n, draw),
    )
    rate = nominal.link.discharge_rate * draw.one(power.get("dc_link.discharge_s", UNMARKED))
    return replace(plant, link=replace(plant.link, discharge_rate=rate))


def _robot(robot: RobotModel, marks: Mapping[str, str], draw: _Draw) -> RobotModel:
    """Masses, centres, inertias, rotors and the counterbalance's pressure."""
    mass, com, inertia = (
        np.array(x) for x in (robot.link_mass, robot.link_com, robot.link_inertia)
    )
    for i, name in enumerate(robot.link_names):
        place = f"links.{name}"
        mass[i] *= draw.one(marks[f"{place}.mass_kg"])
        com[i] += LINK_SIZE * (draw.mark(marks[f"{place}.com_m"], 3) - 1.0)
        inertia[i] *= draw.one(marks[f"{place}.inertia_kgm2"])
    rotors = robot.reflected_inertia * draw.mark(marks["drives.reflected_inertia_kgm2"], robot.n)
    spring = robot.counterbalance
    if spring is not None:
        factor = draw.one(marks["counterbalance.charge_pressure_pa"])
        spring = replace(spring, charge_pressure=spring.charge_pressure * factor)
    return replace(
        robot,
        link_mass=mass,
        link_com=com,
        link_inertia=inertia,
        reflected_inertia=rotors,
        counterbalance=spring,
    )


def _switching(nominal: Plant, n: int) -> float:
    """Watts of each of n drives that are up, of those that the data give all of them."""
    return min(SWITCHING, nominal.watts.drives / n)


def _drives(
    nominal: Plant, robot: RobotModel, marks: Mapping[str, str], draw: _Draw
) -> DriveFigures:
    n = robot.n
    known = nominal.drives
    copper = known.copper * draw.mark(marks["drives.copper_loss_w_per_nm2"], n)
    size = robot.envelope_torque[:, 0] / robot.gear_ratio / 55.0
    # at the torque that lets the data's copper loss be 50 W, what a motor takes while it holds
    current = np.sqrt(50.0 / known.copper) / known.torque_constant
    return DriveFigures(
        torque_constant=known.torque_constant * draw.mark("L", n),
        copper=copper * (1.0 - INVERTER_SHARE),
        inverter=INVERTER_SHARE * 50.0 / current * draw.mark("L", n),
        switching=_switching(nominal, n) * draw.mark("L", n),
        iron_linear=IRON[0] * size * draw.mark("L", n),
        iron_square=IRON[1] * size * draw.mark("L", n),
    )


def _gears(nominal: Plant, robot: RobotModel, marks: Mapping[str, str], draw: _Draw) -> GearFigures:
    n = robot.n
    known = nominal.gears
    ambient = known.ambient * draw.one("L")
    coulomb = known.coulomb * draw.mark(marks["drives.friction_coulomb_nm"], n)
    return GearFigures(
        viscous=known.viscous * draw.mark(marks["drives.friction_viscous_nms_rad"], n),
        coulomb=coulomb,
        load_driven=LOAD_SHARES[0] * draw.mark("L", n),
        load_back=LOAD_SHARES[1] * draw.mark("L", n),
        stribeck=STRIBECK * coulomb * draw.mark("L", n),
        stribeck_speed=known.stribeck_speed * draw.mark("L", n),
        viscous_per_kelvin=PER_KELVIN * draw.mark("L", n),
        capacity=known.capacity * draw.mark("L", n),
        conductance=known.conductance * draw.mark("L", n),
        ambient=ambient,
        start=ambient + WARM * draw.uniform(),
    )


def _link(nominal: Plant, data: PowerData, marks: Mapping[str, str], draw: _Draw) -> LinkFigures:
    threshold = float(draw.by(THRESHOLDS)[0])
    return LinkFigures(
        capacitance=nominal.link.capacitance
        * draw.one(marks.get("dc_link.capacitance_f", UNMARKED)),
        mains=nominal.link.mains * float(draw.by(SUPPLY)[0]),
        chopper_on=data.dc_link.chopper_on * threshold,
        chopper_off=data.dc_link.chopper_off * threshold,
        resistor=nominal.link.resistor
        * draw.one(marks.get("dc_link.brake_resistor_ohm", UNMARKED)),
        rectifier_drop=RECTIFIER[0] * draw.one("L"),
        rectifier_resistance=RECTIFIER[1] * draw.one("L"),
    )


def _watts(nominal: Plant, marks: Mapping[str, str], n: int, draw: _Draw) -> StandingWatts:
    known = nominal.watts
    switching = n * _switching(nominal, n)
    return StandingWatts(
        {
            mode: watts * draw.one(marks.get(f"modes.{mode.name}.controller_w", UNMARKED))
            for mode, watts in known.controller.items()
        },
        known.drives * draw.one(marks.get("drives_and_brake_release_w", UNMARKED)) - switching,
        draw.one("M"),
        known.rest_table,
    )


# Plant files: every figure of a plant as YAML. What a file leaves out is nominal.

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
    "discharge_per_s": ("discharge_rate", 0.0, 10.0, "1/s"),
}
_LINK_KEYS = ("name", "mass_kg", "com_m", "inertia_kgm2")
_WATTS = ("controller_w", "drives_w", "tool_factor")
_ROBOT = ("links", "reflected_inertia_kgm2", "charge_pressure_pa")


def read_plant(path: str, robot: RobotModel, data: PowerData) -> Plant:
    """The plant of a file for this robot. Raises DescriptionFileError, which quotes nothing of
    other files.
    """
    try:
        text = read_regular_file(Path(path), BYTES_MAX).decode("utf-8")
    except InvalidValueError as error:
        raise DescriptionFileError(path, 0, str(error)) from error
    except UnicodeDecodeError as error:
        raise DescriptionFileError(
            path, 0, "this is no plant file: it is no text in UTF-8"
        ) from error
    if not _FORMAT.search(text):
        raise DescriptionFileError(path, 0, f"this is no plant file: it has no format: {FORMAT}")
    return plant_from_yaml(text, robot, data, path)


def plant_from_yaml(text: str, robot: RobotModel, data: PowerData, source: str = "<text>") -> Plant:
    """The plant of a text; what it leaves out is that of the nominal plant. Raises
    DescriptionFileError.
    """
    nominal = nominal_plant(robot, data)
    root = read_items(text, source, DescriptionFileError)
    top = root.table(("format", "name", "robot"), (*_ROBOT, "drives", "gears", "dc_link", "watts"))
    top["format"].choice((FORMAT,))
    top["robot"].choice((robot.name,))
    with root.blamed():
        changed = _robot_plant_file(top.get("links"), robot)
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
            _watts_plant_file(top.get("watts"), nominal.watts),
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


def _robot_plant_file(links: Item | None, robot: RobotModel) -> RobotModel:
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


def _watts_plant_file(item: Item | None, nominal: StandingWatts) -> StandingWatts:
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
        nominal.rest_table,
    )


def _written(figures: Figures, keys: _Keys) -> dict[str, object]:
    return {key: np.array(getattr(figures, field)).tolist() for key, (field, *_) in keys.items()}


def _entries(inertia: FloatArray) -> list[float]:
    J = inertia.tolist()
    return [J[0][0], J[1][1], J[2][2], J[0][1], J[0][2], J[1][2]]


# Choice by a text: `nominal`, `typical`, `typical:SEED`, or the path of a plant file.

IDEAL = "ideal"
_TYPICAL = re.compile(rf"{TYPICAL}(?::([0-9]{{1,18}}))?")


def plant_named(text: str, robot: RobotModel, data: PowerData) -> Plant:
    """The plant that a text names; `typical` is `typical:0`. Raises SettingsError,
    DescriptionFileError.
    """
    if text == NOMINAL:
        return nominal_plant(robot, data)
    drawn = _TYPICAL.fullmatch(text)
    if drawn:
        return typical_plant(robot, data, int(drawn[1] or 0))
    if is_path(text):
        return read_plant(text, robot, data)
    raise SettingsError(
        f"plant is {text[:80]!r}: known are {NOMINAL}, {TYPICAL}, {TYPICAL}:SEED and the path of "
        "a .yaml file"
    )


def ideal_plant(robot: RobotModel, data: PowerData) -> Plant:
    """What the ideal backend is: a robot without physics on the nominal circuit."""
    return replace(nominal_plant(robot, data), name=IDEAL)
