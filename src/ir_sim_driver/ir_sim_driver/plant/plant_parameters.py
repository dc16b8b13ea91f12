"""Parameters of a plant: its robot, drives, gears, DC link and standing watts, as figures of its
own.

`nominal` has the figures of the data and none of the terms that the data do not know. Formulas and
sources: docs/plant.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from ir_description import InvalidValueError, PowerData, RobotModel
from ir_description.robot import RestTable, torque_constants
from ir_msgs_py.modes import MODES, Mode
from ir_values.arrays import FloatArray

NOMINAL = "nominal"
HEAT_CAPACITY = 4.0
"""J/K of gear, oil and housing per Nm of peak torque (an estimate): 26 kJ/K at A1, about 55 kg of
steel.
"""
TIME_CONSTANT = 3600.0
"""s in which a gear warms up (an estimate; robots are warm after one to two hours)."""
TIME_CONSTANT_MIN = 10.0
"""s: no gear cools faster, and the steps in which its temperature is followed, 0.1 s, are short
beside it.
"""
REFERENCE_TEMPERATURE = 40.0
"""deg C of the gears to which the friction of the data belongs (an estimate: half warm)."""
AMBIENT = 20.0
"""deg C of the hall."""


def _checked(owner: object, n: int | None = None) -> None:
    """Store every figure as a finite float or, where it is an array, as a read-only one of n."""
    for field in fields(owner):  # type: ignore[arg-type]
        value = np.array(getattr(owner, field.name), dtype=np.float64)
        if n is not None and value.shape != (n,):
            raise InvalidValueError(f"{field.name} has shape {value.shape}, must have {n} entries")
        if not np.isfinite(value).all():
            raise InvalidValueError(f"{field.name} is not finite")
        value.setflags(write=False)
        object.__setattr__(owner, field.name, value if value.ndim else float(value))


@dataclass(frozen=True, eq=False)
class DriveFigures:
    """Servo drives of n axes, each (n,), at the motor.

    torque_constant [Nm/A rms]; copper [W/Nm^2]; inverter [W/A]: conduction and switching in
    proportion to the current; switching [W]: whatever the current, while motors are on; iron_linear
    [W s/rad], iron_square [W s^2/rad^2]: hysteresis and eddy currents.
    """

    torque_constant: FloatArray
    copper: FloatArray
    inverter: FloatArray
    switching: FloatArray
    iron_linear: FloatArray
    iron_square: FloatArray

    def __post_init__(self) -> None:
        _checked(self, len(self.copper))


@dataclass(frozen=True, eq=False)
class GearFigures:
    """Friction and temperature of n gears, each (n,), at the joint.

    viscous [Nm s/rad] at the reference temperature, coulomb [Nm]; load_driven, load_back: friction
    as a share of the torque that goes through the gear, where the motor drives and where it is
    driven; stribeck [Nm]: more at rest, and gone over stribeck_speed [rad/s]; viscous_per_kelvin
    [1/K]: how fast the viscous part falls; capacity [J/K], conductance [W/K]; ambient, start [deg
    C].
    """

    viscous: FloatArray
    coulomb: FloatArray
    load_driven: FloatArray
    load_back: FloatArray
    stribeck: FloatArray
    stribeck_speed: FloatArray
    viscous_per_kelvin: FloatArray
    capacity: FloatArray
    conductance: FloatArray
    ambient: FloatArray
    start: FloatArray

    def __post_init__(self) -> None:
        _checked(self, len(self.viscous))
        fast = np.flatnonzero(self.conductance * TIME_CONSTANT_MIN > self.capacity)
        if fast.size:
            k = int(fast[0])
            C = self.capacity[k]
            G = self.conductance[k]
            raise InvalidValueError(
                f"gear {k + 1} of {C:g} J/K and {G:g} W/K cools with a time constant of "
                f"{C / G:.3g} s, must be at least {TIME_CONSTANT_MIN:g} s"
            )


@dataclass(frozen=True)
class LinkFigures:
    """DC link and its supply: capacitance [F], mains [V] rectified, chopper_on and chopper_off [V],
    resistor [ohm], rectifier_drop [V] and rectifier_resistance [ohm] in series with what the mains
    give; discharge_rate [1/s]: by which the voltage falls while the drive bus is off.
    """

    capacitance: float
    mains: float
    chopper_on: float
    chopper_off: float
    resistor: float
    rectifier_drop: float
    rectifier_resistance: float
    discharge_rate: float = 0.0

    def __post_init__(self) -> None:
        _checked(self)
        if not self.mains < self.chopper_off <= self.chopper_on:
            raise InvalidValueError(
                f"the chopper switches on at {self.chopper_on:g} V and off at "
                f"{self.chopper_off:g} V: they "
                f"must be above the mains, {self.mains:g} V, and in this order"
            )


@dataclass(frozen=True)
class StandingWatts:
    """Watts [W] of the controller by mode and of the drives while motors are on; tool: factor on
    the data's watts of the tool; rest_table: what the mains give at rest by posture and load,
    where that was measured.
    """

    controller: Mapping[Mode, float]
    drives: float
    tool: float = 1.0
    rest_table: RestTable | None = None


@dataclass(frozen=True, eq=False)
class Plant:
    """All figures of a plant. robot: its masses, inertias and counterbalance count; its friction
    and copper losses do not, those of `gears` and `drives` do. name: what answers and recordings
    say.
    """

    name: str
    robot: RobotModel
    drives: DriveFigures
    gears: GearFigures
    link: LinkFigures
    watts: StandingWatts


def standing_watts(data: PowerData) -> StandingWatts:
    """What the data say."""
    controller = {row.mode: data.resting(row.mode.name).controller_watts for row in MODES}
    watts = data.drives_and_brake_release
    return StandingWatts(controller, watts, rest_table=data.rest_table)


def nominal_plant(robot: RobotModel, data: PowerData) -> Plant:
    """The plant that is the model: every term that the data do not know is zero."""
    n = len(robot.joint_names)
    none = np.zeros(len(robot.joint_names))
    capacity = HEAT_CAPACITY * np.array(robot.envelope_torque)[:, 0]
    drives = DriveFigures(
        torque_constants(robot, data.dc_link.voltage),
        np.array(robot.copper_loss),
        none,
        none,
        none,
        none,
    )
    gears = GearFigures(
        np.array(robot.friction_viscous),
        np.array(robot.friction_coulomb),
        load_driven=none,
        load_back=none,
        stribeck=none,
        stribeck_speed=np.full(n, 0.05),
        viscous_per_kelvin=none,
        capacity=capacity,
        conductance=capacity / TIME_CONSTANT,
        ambient=np.full(n, AMBIENT),
        start=np.full(n, AMBIENT),
    )
    link = data.dc_link
    circuit = LinkFigures(
        link.capacitance,
        link.voltage,
        link.chopper_on,
        link.chopper_on,
        link.brake_resistor,
        0.0,
        0.0,
        link.discharge_rate,
    )
    return Plant(NOMINAL, robot, drives, gears, circuit, standing_watts(data))
