"""What was heard as values of the stream: bounded texts, and numbers that JSON has."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from ir_msgs_py.checks import one_line
from ir_msgs_py.plc import OperatingMode, PlcInputs, PlcOutputs
from ir_recorder.analysis.shares import mode_name
from ir_recorder.report.series import Json

TEXT = 200  # characters
MOST_MACHINES = 100
_MODE = "operating_mode"


def number(value: float, digits: int = 3) -> float | None:
    """A number to so many digits; None for what JSON has no word for."""
    return round(float(value), digits) if math.isfinite(value) else None


def text(value: object) -> str:
    """One bounded line."""
    return one_line(str(value), TEXT)


def power_values(messages: Sequence[Any]) -> dict[str, Json]:
    """Readings of the mains meter since the last record: lowest and highest watts, the rest of the
    last.
    """
    last = messages[-1]
    watts = [float(m.power) for m in messages if math.isfinite(m.power)]
    return {
        "w": [number(min(watts), 1), number(max(watts), 1)] if watts else None,
        "energy": number(last.energy, 1),
        "mode": mode_name(int(last.mode)),
        "target": mode_name(int(last.target_mode)),
        "plant": text(last.plant),
    }


def levels(message: Any, kind: type[PlcInputs] | type[PlcOutputs]) -> dict[str, Json]:
    """Bits of a message by name, and the operating mode by its name."""
    names = [field.name for field in fields(kind) if field.name not in (_MODE, "stamp_ns")]
    number = int(message.operating_mode)
    mode = OperatingMode(number).name if number in set(OperatingMode) else str(number)
    return {**{name: bool(getattr(message, name)) for name in names}, _MODE: mode}


def states_of(message: Any) -> tuple[tuple[str, str], ...]:
    """Machines with their states as recordings have them, "shut>open" while they change."""
    rows = zip(message.equipment, message.states, message.next, strict=False)
    return tuple((name, f"{state}>{next_}" if next_ else state) for name, state, next_ in rows)


def machines(message: Any) -> list[dict[str, Json]]:
    """States of the machines, and what they change to."""
    rows = zip(message.equipment, message.states, message.next, strict=False)
    return [
        {"name": text(name), "state": text(state), "next": text(next_)}
        for name, state, next_ in list(rows)[:MOST_MACHINES]
    ]
