"""Power modes of the controller: their table, their costs and times, and the mains meter.

The table `MODES` lists the modes, shallow to deep; everything else about them is read off it. A new
mode to rest in is one row there, its numbers in ir_msgs/PowerMode, its times in `TransitionTimes`,
and its watts and PROFIenergy number in the controller's data (ir_description).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ir_values.arrays import FloatArray, at_least, finite, read_only, set_field
from ir_values.errors import InvalidValueError
from ir_values.settings import check_settings, setting


class Mode(IntEnum):
    """Modes and the transitions between them; numbers of ir_msgs/PowerMode."""

    STAND_ON_MOTORS = 0
    MOVING = 1
    STAND_ON_BRAKES = 2
    BUS_POWER_OFF = 3
    HIBERNATION = 4
    TO_BRAKES = 10
    FROM_BRAKES = 11
    TO_BUS_POWER_OFF = 12
    FROM_BUS_POWER_OFF = 13
    TO_HIBERNATION = 14
    FROM_HIBERNATION = 15
    EMERGENCY_STOP = 20


class ModeRow(NamedTuple):
    """A mode that can last. depth: 0 for motors on. entering, leaving: its transitions, itself for
    none.

    bit: the PLC bit that asks for it, "" for none. on_the_network: whether the controller answers
    in it and while leaving it. drives_on: whether the drive bus is up in it and in its transitions.
    """

    mode: Mode
    depth: int
    entering: Mode
    leaving: Mode
    bit: str = ""
    on_the_network: bool = True
    drives_on: bool = False

    @property
    def name(self) -> str:
        """Name of the mode as sentences have it."""
        return self.mode.name.replace("_", " ").capitalize()


MODES = (
    ModeRow(Mode.STAND_ON_MOTORS, 0, Mode.STAND_ON_MOTORS, Mode.STAND_ON_MOTORS, drives_on=True),
    ModeRow(Mode.STAND_ON_BRAKES, 1, Mode.TO_BRAKES, Mode.FROM_BRAKES, drives_on=True),
    ModeRow(Mode.BUS_POWER_OFF, 2, Mode.TO_BUS_POWER_OFF, Mode.FROM_BUS_POWER_OFF, bit="ab"),
    ModeRow(
        Mode.HIBERNATION,
        3,
        Mode.TO_HIBERNATION,
        Mode.FROM_HIBERNATION,
        bit="hib",
        on_the_network=False,
    ),
)
RESTS = MODES[1:]
"""Modes that have to be entered and left."""
ROW = {row.mode: row for row in MODES}
REST_MODES = tuple(row.mode.name for row in MODES)
"""Modes that a pause can be spent in, shallow to deep; the names that people type."""
DEEPER = ">"
"""Between the modes of a pause that goes through several."""
READY = frozenset({Mode.STAND_ON_MOTORS, Mode.MOVING})
"""Modes in which the motors follow commands."""
OFF_THE_NETWORK = frozenset(
    m for row in RESTS if not row.on_the_network for m in (row.mode, row.leaving)
)
"""Modes in which the controller does not answer."""
DRIVES_ON = READY | {
    m for row in RESTS if row.drives_on for m in (row.mode, row.entering, row.leaving)
}
"""Modes with the drive bus up: a movement may be asked for, a load draws its watts_drive_bus."""
REST_OF_BIT = {row.bit: row.mode for row in RESTS if row.bit}
"""The mode that each PLC bit of the power management asks for."""


def drive_bus_up(name: str) -> bool:
    """Whether the drive bus is up in the mode of this name, by `DRIVES_ON`."""
    return any(mode.name == name for mode in DRIVES_ON)


def modes_of(power_mode: str) -> tuple[Mode, ...]:
    """The modes of a pause, one after the other: "STAND_ON_BRAKES>BUS_POWER_OFF" goes deeper as
    soon as it can; none for "" and for standing on motors. Raises InvalidValueError for an unknown
    mode and for one that is not deeper than the one before.
    """
    names = power_mode.split(DEEPER) if power_mode else []
    for name in names:
        if name not in REST_MODES:
            known = ", ".join(REST_MODES)
            raise InvalidValueError(
                f"power mode {name[:40]!a} of the pause is unknown: known are {known}"
            )
    modes = tuple(Mode[name] for name in names)
    if any(ROW[b].depth <= ROW[a].depth for a, b in pairwise(modes)):
        raise InvalidValueError(
            f"power mode of the pause is {power_mode}: each must be deeper than the one before"
        )
    return tuple(mode for mode in modes if mode is not Mode.STAND_ON_MOTORS)


def deepest(power_mode: str) -> str:
    """Name of the last mode of a pause, in which most of it is spent."""
    return power_mode.rsplit(DEEPER, 1)[-1]


def checked_mode(number: int) -> Mode:
    """Return the mode of the number; an unknown one lists the known."""
    try:
        return Mode(number)
    except ValueError as error:
        known = ", ".join(f"{mode.value} {mode.name}" for mode in Mode)
        raise InvalidValueError(f"power mode is {number}: known are {known}") from error


# How long a rest takes, alone and as the last of several.


class RestTimes(NamedTuple):
    """Seconds of a mode to rest in: from asking for it until it is reached (enter), at least in it
    (stay), and back to motors on (leave).
    """

    enter: float
    stay: float
    leave: float

    @property
    def busy(self) -> float:
        """Seconds from asking for the mode until it can be left."""
        return self.enter + self.stay

    @property
    def shortest(self) -> float:
        """Shortest pause [s] that can be spent in the mode."""
        return self.busy + self.leave

    def wake_at(self, end: float) -> float:
        """When the robot is woken from the mode to be ready at `end` [s]."""
        return end - self.leave


def shortest_pause(rests: Sequence[RestTimes]) -> float:
    """Shortest pause [s] that can be spent in modes one after the other, each asked for as soon as
    the one before can be left; 0 for none.
    """
    return sum(rest.busy for rest in rests) + rests[-1].leave if rests else 0.0


PAUSE_ROUNDING = 1e-6
"""s by which a pause may be shorter than its modes take, for the rounding of sums: one that is
exactly as long as they need can be spent in them.
"""


# Cost of a power mode in the terms of PROFIenergy, and the reading of the mains meter.


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

    @property
    def times(self) -> RestTimes:
        """Its times alone."""
        return RestTimes(
            self.time_to_pause, self.time_min_length_of_stay, self.regular_time_to_operate
        )


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
    [V]; burnt_power [W]; joint_power (n,) [W] at the DC link; joint_torque (n,) [Nm] of the motor
    at the joint; joint_current (n,) [A] of the motors and joint_temperature (n,) [deg C] of the
    gears, empty where the plant has none; rectifier_loss [W]; tool_power [W], a part of base_power;
    plant: what is simulated.
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


# Times into and out of the power modes, and the shortest stay in each: parameters of the driver,
# which reports them. Planner and program runner have parameters of the same names, PREFIX and the
# field's, for the time in which no driver reports.

PREFIX = "transitions."  # of the parameters
_WEEK = 604_800.0


def _seconds(default: float, sentence: str) -> float:
    return setting(default, sentence, unit="s", minimum=0.0, maximum=_WEEK)


@dataclass(frozen=True)
class TransitionTimes:
    """Seconds into a rest (enter), out of it to motors on (leave), and at least in it
    (minimum_stay).
    """

    stand_on_brakes_enter: float = _seconds(0.3, "Motors to brakes.")
    stand_on_brakes_leave: float = _seconds(0.7, "Brakes to motors.")
    stand_on_brakes_minimum_stay: float = _seconds(1.0, "Shortest stay on brakes.")
    bus_power_off_enter: float = _seconds(3.0, "Into Bus Power Off.")
    bus_power_off_leave: float = _seconds(20.0, "Bus Power Off to motors.")
    bus_power_off_minimum_stay: float = _seconds(2.0, "Shortest Bus Power Off.")
    hibernation_enter: float = _seconds(60.0, "Into hibernation.")
    hibernation_leave: float = _seconds(120.0, "Hibernation to motors.")
    hibernation_minimum_stay: float = _seconds(120.0, "Shortest hibernation.")

    def __post_init__(self) -> None:
        check_settings(self)

    def enter(self, mode: str) -> float:
        """Time [s] into a mode from standing on motors."""
        return self._of(mode, "enter")

    def leave(self, mode: str) -> float:
        """Time [s] from a mode to motors on."""
        return self._of(mode, "leave")

    def minimum_stay(self, mode: str) -> float:
        """Shortest stay [s] in a mode."""
        return self._of(mode, "minimum_stay")

    def _of(self, mode: str, what: str) -> float:
        return 0.0 if mode == "STAND_ON_MOTORS" else float(getattr(self, f"{mode.lower()}_{what}"))

    def rest(self, mode: str) -> RestTimes:
        """All three times of a mode."""
        return RestTimes(self.enter(mode), self.minimum_stay(mode), self.leave(mode))

    def of(self, mode: Mode) -> PowerMode:
        """A mode to rest in with its times alone."""
        rest = self.rest(mode.name)
        return PowerMode(
            mode=mode,
            time_min_pause=rest.shortest,
            time_to_pause=rest.enter,
            regular_time_to_operate=rest.leave,
            time_min_length_of_stay=rest.stay,
        )
