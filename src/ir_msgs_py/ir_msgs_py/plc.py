"""Levels between the PLC and the robot's controller, and signals of the cell's machines.

The bits ab, hib and ks are those of the KR C4 power management by PLC; the others of its automatic
external interface.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from enum import IntEnum
from typing import Any

from ir_values.arrays import one_of
from ir_values.errors import InvalidValueError


class OperatingMode(IntEnum):
    """Operating modes of the controller; UNCHANGED only as an input."""

    UNCHANGED = 0
    T1 = 1
    T2 = 2
    AUT = 3
    EXT = 4


@dataclass(frozen=True)
class PlcInputs:
    """Levels from the PLC to the controller.

    ab: drive bus off. hib: hibernate. ks: cold start. Each needs the other two to be 0.
    """

    ab: bool = False
    hib: bool = False
    ks: bool = False
    emergency_stop: bool = False
    drives_on: bool = False
    drives_off: bool = False
    conf_mess: bool = False
    move_enable: bool = True
    operating_mode: OperatingMode = OperatingMode.UNCHANGED

    def __post_init__(self) -> None:
        if self.operating_mode not in set(OperatingMode):
            known = ", ".join(f"{mode.value} {mode.name}" for mode in OperatingMode)
            raise InvalidValueError(f"operating_mode is {self.operating_mode}: known are {known}")
        object.__setattr__(self, "operating_mode", OperatingMode(self.operating_mode))

    def with_bit(self, name: str, value: bool) -> PlcInputs:
        """Change one bit, or the operating mode by its name ("T1", only with True). Raises
        InvalidValueError for a name that is none.
        """
        one_of(name, PLC_INPUT_NAMES, "PLC input")
        if name not in OperatingMode.__members__:
            changes: dict[str, Any] = {name: bool(value)}
            return replace(self, **changes)
        if not value:
            raise InvalidValueError(
                f"operating mode {name} cannot be taken away: choose another one"
            )
        return replace(self, operating_mode=OperatingMode[name])


PLC_INPUT_NAMES = (
    *(field.name for field in fields(PlcInputs) if field.name != "operating_mode"),
    *(mode.name for mode in OperatingMode if mode is not OperatingMode.UNCHANGED),
)


@dataclass(frozen=True)
class PlcOutputs:
    """Levels from the controller to the PLC; stamp_ns: node clock [ns].

    ab: bus off. bbs: ready to operate. alarm_stop: no emergency stop. in_home: at machine home.
    """

    stamp_ns: int = 0
    ab: bool = False
    bbs: bool = False
    drives_ready: bool = False
    alarm_stop: bool = False
    in_home: bool = False
    moving: bool = False
    operating_mode: OperatingMode = OperatingMode.EXT

    def __post_init__(self) -> None:
        if self.operating_mode not in set(OperatingMode):
            raise InvalidValueError(
                f"operating_mode is {self.operating_mode}: it must be in 0 .. 4"
            )
        object.__setattr__(self, "operating_mode", OperatingMode(self.operating_mode))


@dataclass(frozen=True)
class Signal:
    """One signal of a machine of the cell: its level, awaited, set or reported; stamp_ns: node
    clock [ns].
    """

    name: str
    value: bool = True
    stamp_ns: int = 0

    def __post_init__(self) -> None:
        if not self.name or len(self.name) > 256 or not self.name.isprintable():
            raise InvalidValueError(
                f"name of a signal is {self.name[:40]!r}: it must be 1 to 256 printable characters"
            )

    @property
    def text(self) -> str:
        """The signal as a cell file has it: "name" or "not name"."""
        return self.name if self.value else f"not {self.name}"

    @classmethod
    def parse(cls, text: str) -> Signal:
        """Read what a program waits for or sets: "name" or "name=1", "name=0" or "not name". Raises
        InvalidValueError for another level.
        """
        if text.startswith("not "):
            return cls(text[4:].strip(), False)
        name, separator, level = text.partition("=")
        if separator and level.strip() not in ("0", "1"):
            raise InvalidValueError(
                f'signal "{text[:80]}" has level "{level[:20]}": known are 0, 1'
            )
        return cls(name.strip(), level.strip() != "0")
