"""The power side of a controller as data: modes, transitions, DC link, PLC bits, Tables I and
II.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ir_description.robot.rest_table import RestTable
from ir_values.arrays import in_range
from ir_values.errors import InvalidValueError, UnknownNameError


@dataclass(frozen=True)
class ControllerMode:
    """One energy mode of the controller.

    controller_watts [W] without drives, tool and holding torque. time_to_pause [s] into the mode
    and regular_time_to_operate [s] back to motors on; minimum_stay [s] between them; time_min_pause
    [s] below which the mode is not worth entering; pe_mode_id is PROFIenergy's number.
    """

    name: str
    pe_mode_id: int
    controller_watts: float
    time_to_pause: float
    regular_time_to_operate: float
    minimum_stay: float
    time_min_pause: float

    def __post_init__(self) -> None:
        in_range(self.controller_watts, 0.0, 1e5, "W", f"controller_watts of {self.name}")
        for name in ("time_to_pause", "regular_time_to_operate", "minimum_stay", "time_min_pause"):
            in_range(getattr(self, name), 0.0, 1e6, "s", f"{name} of {self.name}")
        in_range(self.pe_mode_id, 0, 255, "", f"pe_mode_id of {self.name}")


@dataclass(frozen=True)
class DcLink:
    """Bus of the drives: the supply rectifies only; what the capacitors cannot take is
    dissipated. Where the drive bus is off the capacitors' voltage falls through bleed resistors.
    """

    capacitance: float  # F
    voltage: float  # V, rectified mains
    chopper_on: float  # V
    chopper_off: float  # V
    brake_resistor: float  # ohm
    discharge: float | None = None  # s, time constant of the voltage; None: the charge is kept

    def __post_init__(self) -> None:
        for name, unit in (("capacitance", "F"), ("voltage", "V"), ("brake_resistor", "ohm")):
            in_range(getattr(self, name), 0.0, 1e6, unit, name, open_low=True)
        if self.discharge is not None:
            in_range(self.discharge, 0.0, 1e6, "s", "discharge", open_low=True)
        if not self.voltage < self.chopper_off <= self.chopper_on:
            raise InvalidValueError(
                f"chopper switches off at {self.chopper_off:g} V and on at {self.chopper_on:g} "
                f"V, must be above {self.voltage:g} V and in this order"
            )

    @property
    def capacity_energy(self) -> float:
        """Energy [J] the capacitors take between the rectified mains and the brake chopper."""
        return (
            0.5
            * self.capacitance
            * (self.chopper_on * self.chopper_on - self.voltage * self.voltage)
        )

    @property
    def discharge_rate(self) -> float:
        """Share of the voltage that is lost in a second [1/s] where the drive bus is off."""
        return 0.0 if self.discharge is None else 1.0 / self.discharge

    def recharge(self, seconds: float) -> float:
        """J that the mains give to charge the capacitors again after so long with the drive bus
        off, begun at the mains' voltage.
        """
        whole = self.capacitance * self.voltage * self.voltage
        return -whole * math.expm1(-self.discharge_rate * seconds)


@dataclass(frozen=True)
class PlcBit:
    """One bit of the power management's byte; `excludes` names the bits that must be 0 with it."""

    bit: int
    name: str
    meaning: str
    excludes: tuple[str, ...] = ()


@dataclass(frozen=True)
class MeasuredPower:
    """A row of Table II: mains power [W] at machine home in a mode, with a payload [kg]."""

    payload: float
    mode: str
    watts: float


@dataclass(frozen=True)
class EnergyShare:
    """A row of Table I: a consumer's share [%] of the energy of a robotic line."""

    consumer: str
    percent: float


@dataclass(frozen=True)
class PowerData:
    """All of a controller's power figures; tool watts belong to the tool (Load).

    table_2_robot: the robot that Table II was measured with, "" where there is no such table.
    rest_table: power at rest by posture and load, as it was measured; None, or of a mode that it
    does not know: motors hold by the model's torques, a saving mode draws the same at every
    posture, and what is attached adds its own watts.
    marks: how sure each figure is, by its place in the file.
    """

    name: str
    modes: tuple[ControllerMode, ...]
    operate_manual_pe_mode_id: int
    drives_and_brake_release: float  # W while the motors are on
    motors_to_brakes_in_program: float  # s
    motors_to_brakes_in_command: float  # s
    dc_link: DcLink
    plc_inputs: tuple[PlcBit, ...]
    plc_outputs: tuple[PlcBit, ...]
    wake_on_lan_ports: tuple[int, ...]
    table_2: tuple[MeasuredPower, ...]
    table_1: tuple[EnergyShare, ...]
    table_2_robot: str = ""
    rest_table: RestTable | None = None
    marks: Mapping[str, str] = field(default_factory=dict, repr=False, compare=False)

    def __post_init__(self) -> None:
        in_range(self.drives_and_brake_release, 0.0, 1e5, "W", "drives_and_brake_release")
        names = [mode.name for mode in self.modes]
        if len(set(names)) != len(names):
            raise InvalidValueError("a power mode is named twice")
        for row in self.table_2:
            self.mode(row.mode)
        for name in self.rest_table.modes if self.rest_table is not None else ():
            self.mode(name)

    @property
    def dc_link_capacity_energy(self) -> float:
        """Energy [J] that fits into the DC link before braking energy is dissipated."""
        return self.dc_link.capacity_energy

    @property
    def has_table(self) -> bool:
        """Whether there are modes to rest in; without, a robot that waits stands on its motors."""
        return len(self.modes) > 1

    @property
    def counted(self) -> bool:
        """Whether joules hold what the controller draws; else they are those of drives and tool."""
        return self.has_table or self.modes[0].controller_watts > 0.0

    def mode(self, name: str) -> ControllerMode:
        """Return the mode of that name. Raises UnknownNameError for one that the controller has
        not.
        """
        for mode in self.modes:
            if mode.name == name:
                return mode
        raise UnknownNameError("power mode", name, (mode.name for mode in self.modes))

    def resting(self, name: str) -> ControllerMode:
        """The mode of that name; where there is no table that of standing on motors."""
        return self.mode(name) if self.has_table else self.modes[0]

    def measured_rest(self, name: str) -> RestTable | None:
        """The table of measured rests, where it knows the mode of that name."""
        table = self.rest_table
        return table if table is not None and name in table.modes else None

    def rest_remark(self, posture: Sequence[float], load: float) -> str:
        """What the power of the saving modes at a posture (n,) [rad] with a load [kg] rests on, as
        a sentence.
        """
        if self.rest_table is None:
            return (
                "saving modes draw the same at every posture, and with a load its own watts more: "
                "no table by posture and load was measured"
            )
        beyond = self.rest_table.outside(posture, load)
        what = "saving modes draw"
        if self.modes[0].name in self.rest_table.modes:
            what = "motors that hold and saving modes draw"
        said = f"{what} by {len(self.rest_table.rows)} measured rests"
        return f"{said}, outside of them: {beyond}, their nearest values count" if beyond else said

    def measured(self, payload: float, mode: str) -> float:
        """Return Table II's watts for a payload of 0 or 155 kg in a mode. Raises UnknownNameError
        where the table has no such row.
        """
        for row in self.table_2:
            if row.payload == payload and row.mode == mode:
                return row.watts
        raise UnknownNameError(
            "row of Table II",
            f"{payload:g} kg {mode}",
            (f"{r.payload:g} kg {r.mode}" for r in self.table_2),
        )


NO_TABLE = "no_table"
"""Name of the figures of a controller whose power modes are not known."""
NEVER = 604_800.0
"""s until brakes close that no controller closes by itself: a week, the longest pause there is."""
USUAL_LINK = DcLink(
    capacitance=1e-3, voltage=560.0, chopper_on=688.0, chopper_off=668.0, brake_resistor=20.0
)
"""Of drives on 400 V mains (an estimate): 79 J of braking energy fit in."""


def without_table(
    watts: float = 0.0, link: DcLink = USUAL_LINK, marks: Mapping[str, str] | None = None
) -> PowerData:
    """A controller that only stands on motors, with `watts` [W] of its own (0: not counted)."""
    standing = ControllerMode("STAND_ON_MOTORS", 0xFF, watts, 0.0, 0.0, 0.0, 0.0)
    return PowerData(
        name=NO_TABLE,
        modes=(standing,),
        operate_manual_pe_mode_id=0xF0,
        drives_and_brake_release=0.0,
        motors_to_brakes_in_program=NEVER,
        motors_to_brakes_in_command=NEVER,
        dc_link=link,
        plc_inputs=(),
        plc_outputs=(),
        wake_on_lan_ports=(),
        table_2=(),
        table_1=(),
        marks=marks or {},
    )
