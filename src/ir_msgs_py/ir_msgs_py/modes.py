"""Power modes of the controller as one table, shallow to deep; everything else about them is read
off it.

A new mode to rest in is one row here, its numbers in ir_msgs/PowerMode, its times in
ir_msgs_py.transitions, and its watts and PROFIenergy number in the controller's data
(ir_description).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise

from ir_msgs_py.errors import InvalidValueError


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


@dataclass(frozen=True)
class ModeRow:
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
"""Modes with the drive bus up: a movement may be asked for."""
REST_OF_BIT = {row.bit: row.mode for row in RESTS if row.bit}
"""The mode that each PLC bit of the power management asks for."""


def modes_of(power_mode: str) -> tuple[Mode, ...]:
    """The modes of a pause, one after the other: "STAND_ON_BRAKES>BUS_POWER_OFF" goes deeper as
    soon as it can; none for "" and for standing on motors.
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
