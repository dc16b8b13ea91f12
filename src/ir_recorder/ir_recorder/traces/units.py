"""Headings of columns as people write them: "power [kW]", "time_ms", "joint_a1 (deg)"; all become
SI.
"""

from __future__ import annotations

import math
import re

from ir_recorder.errors import TraceError

FACTORS: dict[str, float] = {
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
    "h": 3600.0,
    "rad": 1.0,
    "mrad": 1e-3,
    "deg": math.radians(1.0),
    "rad/s": 1.0,
    "mrad/s": 1e-3,
    "deg/s": math.radians(1.0),
    "rad/s^2": 1.0,
    "deg/s^2": math.radians(1.0),
    "nm": 1.0,
    "w": 1.0,
    "kw": 1e3,
    "j": 1.0,
    "kj": 1e3,
    "wh": 3600.0,
    "kwh": 3.6e6,
    "v": 1.0,
    "a": 1.0,
}
"""SI value of one of each unit, by its lower-case name."""

_BRACKETS = re.compile(r"^(?P<name>[^\[\(]+?)\s*[\[\(]\s*(?P<unit>[^\]\)]+?)\s*[\]\)]$")
_ENDING = re.compile(r"^(?P<name>.+)_(?P<unit>[a-zA-Z]+)$")


def factor(unit: str, where: str) -> float:
    """What a value in this unit is multiplied by; TraceError names the known units."""
    known = FACTORS.get(unit.strip().lower().replace("²", "^2").replace("s2", "s^2"))
    if known is None:
        raise TraceError(f"{where}: unit {unit[:20]!r} is unknown, known are {', '.join(FACTORS)}")
    return known


def parsed(heading: str, where: str) -> tuple[str, float]:
    """Name and factor of a heading; without a unit the values are SI."""
    heading = heading.strip()
    found = _BRACKETS.match(heading)
    if found:
        return found["name"].strip(), factor(found["unit"], where)
    found = _ENDING.match(heading)
    if found and found["unit"].lower() in FACTORS and found["unit"].lower() not in ("v", "a"):
        return found["name"], FACTORS[found["unit"].lower()]
    return heading, 1.0
