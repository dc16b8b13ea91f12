"""Plants as they come: figures drawn by seed, spread around the data as far as their confidence
marks say.

Each figure of the data is scaled by a factor of its own. Terms that the data do not know have the
values and the spread below. docs/plant.md has the sources and what is assumed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ir_description import PowerData, RobotModel
from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.plant.plant_parameters import (
    DriveFigures,
    GearFigures,
    LinkFigures,
    Plant,
    StandingWatts,
    nominal_plant,
)

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
    return Plant(
        f"{TYPICAL}:{seed}",
        _robot(robot, marks, draw),
        _drives(nominal, robot, marks, draw),
        _gears(nominal, robot, marks, draw),
        _link(nominal, data, power, draw),
        _watts(nominal, power, robot.n, draw),
    )


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
    )
