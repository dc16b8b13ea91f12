"""Numbers as text: units, digits, thousands and durations."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable
from html import escape
from unicodedata import category

from ir_msgs_py.modes import Mode

DASH = "–"
ENGLISH = "en"
LOCALES = (ENGLISH, "de")
"""Of CSV files: decimals with a point and commas between columns, or a comma and semicolons."""
_MODES = re.compile(
    rf"\b(?:{'|'.join(mode.name for mode in Mode if '_' in mode.name)}|HIBERNATION)\b"
)
_NO_JOULES = 1e-3  # J
_UNSEEN = ("Cc", "Cf", "Cs")  # categories of Unicode: control, format, surrogate


def _fixed(value: float, digits: int) -> str:
    """So many decimals, thousands apart, and no sign before a zero."""
    shown = f"{value:,.{digits}f}".replace(",", " ")
    return shown if any(digit in shown for digit in "123456789") else shown.removeprefix("-")


def significant(value: float, digits: int) -> str:
    """So many significant digits without an exponent, thousands apart."""
    if value == 0.0:
        return "0"
    rounded = float(f"{value:.{digits}g}")
    decimals = max(digits - 1 - math.floor(math.log10(abs(rounded))), 0)
    shown = _fixed(rounded, decimals)
    return shown.rstrip("0").rstrip(".") if decimals else shown


def joules(value: float) -> str:
    """Whole joules ("1 235 J"), from 10 kJ on "12.3 kJ"."""
    if not math.isfinite(value):
        return DASH
    if abs(value) >= 10_000.0:
        return f"{_fixed(value / 1000.0, 1)} kJ"
    return f"{_fixed(value, 0)} J"


def watts(value: float) -> str:
    """Watts without decimals, below 10 W with one."""
    if not math.isfinite(value):
        return DASH
    return f"{_fixed(value, 0 if abs(value) >= 10.0 else 1)} W"


def kilowatt_hours(value: float) -> str:
    """Joules as kWh with three significant digits, whole ones from 100 on, Wh below 1 kWh, and
    joules below 0.01 Wh.
    """
    if not math.isfinite(value):
        return DASH
    if _NO_JOULES <= abs(value) < 36.0:
        return f"{significant(value, 3)} J"
    kwh = value / 3.6e6 if abs(value) >= _NO_JOULES else 0.0
    if abs(kwh) < 1.0:
        return f"{significant(1e3 * kwh, 3)} Wh"
    return f"{_fixed(kwh, 0) if abs(kwh) >= 100.0 else significant(kwh, 3)} kWh"


def watt_hours(value: float) -> str:
    """Joules as Wh with three significant digits: for a column whose figures are far apart; less
    than a millijoule, which sums of many joules leave over, is 0.
    """
    if not math.isfinite(value):
        return DASH
    return f"{significant(value / 3600.0, 3) if abs(value) >= _NO_JOULES else 0} Wh"


def yearly_kilowatt_hours(value: float) -> str:
    """Joules of a year as kWh with three significant digits, whole ones from 100 on: for a column
    whose figures are far apart.
    """
    if not math.isfinite(value) or abs(value) >= 3.6e6:
        return kilowatt_hours(value)
    return f"{significant(value / 3.6e6, 3) if abs(value) >= _NO_JOULES else 0} kWh"


def kilograms(value: float) -> str:
    """kg with three significant digits, whole ones from 100 on."""
    if not math.isfinite(value):
        return DASH
    return f"{_fixed(value, 0) if abs(value) >= 100.0 else significant(value, 3)} kg"


def seconds(value: float) -> str:
    """Seconds with two decimals, from ten minutes on as minutes."""
    if not math.isfinite(value):
        return DASH
    return f"{value:.2f} s" if value < 600.0 else f"{value / 60.0:.1f} min"


def whole(value: float) -> str:
    """A whole number, its thousands apart."""
    return f"{value:,.0f}".replace(",", " ")


def millimetres(value: float) -> str:
    """Metres as millimetres."""
    return f"{_fixed(value * 1000.0, 1)} mm" if math.isfinite(value) else DASH


def percent(value: float) -> str:
    """A ratio as a signed percentage."""
    if not math.isfinite(value):
        return DASH
    shown = f"{value * 100.0:+.2f}"
    return "0.00 %" if shown in ("+0.00", "-0.00") else f"{shown} %"


def share(part: float, whole: float) -> str:
    """A part of a whole as a percentage of three significant digits."""
    known = whole > 0.0 and math.isfinite(part)
    return f"{significant(100.0 * part / whole, 3)} %" if known else DASH


def number(value: float, unit: str) -> str:
    """A number with its unit: lengths in mm, the rest with four significant digits."""
    if not math.isfinite(value):
        return DASH
    if unit == "m":
        return millimetres(value)
    shown = significant(value, 4) if abs(value) < 1e3 else _fixed(value, 0)
    return f"{shown} {unit}".strip()


def interval(low: float, high: float, unit: str) -> str:
    """Bounds as bounds: "at most 5.0 mm", "at least 20.0 mm", "520 J to 545 J"."""
    if math.isinf(low) and math.isfinite(high):
        return f"at most {number(high, unit)}"
    if math.isinf(high) and math.isfinite(low):
        return f"at least {number(low, unit)}"
    if math.isfinite(low) and math.isfinite(high):
        return f"{number(low, unit)} to {number(high, unit)}"
    return DASH


def span_of(low: float, high: float, show: Callable[[float], str]) -> str:
    """Two ends with their unit, once where it is the same: "609 to 839 kWh"; no end is broken
    across lines.
    """
    first = show(low)
    last = show(high)
    number_of, apart, unit = first.rpartition(" ")
    if apart and unit.isalpha() and last.endswith(f" {unit}"):
        first = number_of
    return " to ".join(end.replace(" ", "\u00a0") for end in (first, last))


def mode_words(name: str) -> str:
    """A mode's name as words: "bus power off"."""
    return name.lower().replace("_", " ")


def modes_as_words(words: str) -> str:
    """A sentence or label, names of modes in it as words."""
    return _MODES.sub(lambda match: mode_words(match[0]), words)


def text(value: object) -> str:
    """Anything as HTML text; characters that steer a terminal or the direction of writing are
    replaced.
    """
    seen = "".join(
        "\ufffd" if category(c) in _UNSEEN and c not in "\n\t" else c for c in str(value)
    )
    return escape(seen, quote=True)


def add_locale(parser: argparse.ArgumentParser) -> None:
    """Adds --locale: how tables write their decimals."""
    words = "of a .csv: de writes decimals with a comma and columns apart by semicolons (en)"
    parser.add_argument("--locale", choices=LOCALES, default=ENGLISH, help=words)
