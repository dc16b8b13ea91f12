"""The levels between PLC and controller; names are the fields of ir_msgs/PlcInputs and PlcOutputs."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class OperatingMode(IntEnum):
    """Position of the mode switch."""

    T1 = 1
    T2 = 2
    AUT = 3
    EXT = 4


@dataclass(frozen=True)
class PlcInputs:
    """Levels from the PLC; operating_mode None leaves the switch as it is."""

    ab: bool = False
    hib: bool = False
    ks: bool = False
    emergency_stop: bool = False
    drives_on: bool = False
    drives_off: bool = False
    conf_mess: bool = False
    move_enable: bool = True
    operating_mode: OperatingMode | None = None


POWER_BITS = ("ab", "hib", "ks")
BITS = (*POWER_BITS, "emergency_stop", "drives_on", "drives_off", "conf_mess", "move_enable")


@dataclass(frozen=True)
class PlcOutputs:
    """Levels to the PLC. ab: bus off. bbs: ready to operate. alarm_stop: 1 while there is no emergency stop."""

    ab: bool
    bbs: bool
    drives_ready: bool
    alarm_stop: bool
    in_home: bool
    moving: bool
    operating_mode: OperatingMode


ALL_OFF = PlcOutputs(False, False, False, False, False, False, OperatingMode.EXT)
