"""What a power mode costs, in the terms of PROFIenergy, and the reading of the mains meter."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.checks import at_least, finite, read_only, set_field
from ir_msgs_py.errors import InvalidValueError
from ir_msgs_py.modes import Mode, checked_mode


@dataclass(frozen=True, kw_only=True)
class PowerMode:
    """One mode with its power [W], times [s] and energies [J]; break_even may be infinite: it never
    pays.

    power: at the mains with the present tool. time_min_pause: shortest pause for which it may be
    entered.
    time_to_pause, regular_time_to_operate: transition in and out. time_min_length_of_stay: in the
    mode itself. energy_to_pause, energy_to_operate: of the transitions. break_even: pause from
    which the mode saves energy against the next shallower one.
    """

    mode: Mode
    name: str = ""
    pe_mode_id: int = 0
    power: float = 0.0
    time_min_pause: float = 0.0
    time_to_pause: float = 0.0
    regular_time_to_operate: float = 0.0
    time_min_length_of_stay: float = 0.0
    energy_to_pause: float = 0.0
    energy_to_operate: float = 0.0
    break_even: float = 0.0

    def __post_init__(self) -> None:
        set_field(self, "mode", checked_mode(self.mode))
        set_field(self, "name", self.name or self.mode.name)
        if not 0 <= self.pe_mode_id <= 0xFF:
            raise InvalidValueError(f"pe_mode_id is {self.pe_mode_id}: it must be in 0 .. 255")
        for name in (
            "time_min_pause",
            "time_to_pause",
            "regular_time_to_operate",
            "time_min_length_of_stay",
        ):
            set_field(self, name, at_least(getattr(self, name), 0.0, f"{name} of {self.name}", "s"))
        for name in ("power", "energy_to_pause", "energy_to_operate"):
            set_field(self, name, finite(getattr(self, name), f"{name} of {self.name}"))
        if np.isnan(self.break_even):
            raise InvalidValueError(f"break_even of {self.name} is nan: it must be a number")


METER = (
    "time_to_target",
    "power",
    "energy",
    "base_power",
    "bus_voltage",
    "burnt_power",
    "rectifier_loss",
    "tool_power",
)
"""Numbers of a PowerState."""
AXES = ("joint_power", "joint_torque", "joint_current", "joint_temperature")
"""Arrays of a PowerState, one entry per axis."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PowerState:
    """What the mains meter reads; stamp_ns: node clock [ns].

    time_to_target [s], 0 when the target mode is reached; power [W]: mean since the last reading;
    energy [J] since the meter started; base_power [W] of controller, drives and tool; bus_voltage
    [V]; burnt_power [W]; joint_power (n,) [W] at the DC bus; joint_torque (n,) [Nm] of the motor at
    the joint; joint_current (n,) [A] of the motors and joint_temperature (n,) [deg C] of the gears,
    empty where the plant has none; rectifier_loss [W]; tool_power [W], a part of base_power; plant:
    what is simulated.
    """

    stamp_ns: int
    mode: Mode
    target_mode: Mode
    time_to_target: float = 0.0
    power: float = 0.0
    energy: float = 0.0
    base_power: float = 0.0
    bus_voltage: float = 0.0
    burnt_power: float = 0.0
    joint_power: FloatArray = field(default_factory=lambda: np.zeros(0))
    joint_torque: FloatArray = field(default_factory=lambda: np.zeros(0))
    joint_current: FloatArray = field(default_factory=lambda: np.zeros(0))
    joint_temperature: FloatArray = field(default_factory=lambda: np.zeros(0))
    rectifier_loss: float = 0.0
    tool_power: float = 0.0
    plant: str = ""

    def __post_init__(self) -> None:
        set_field(self, "mode", checked_mode(self.mode))
        set_field(self, "target_mode", checked_mode(self.target_mode))
        for name in METER:
            set_field(self, name, finite(getattr(self, name), name))
        for name in AXES:
            set_field(self, name, read_only(getattr(self, name), name, (None,)))
