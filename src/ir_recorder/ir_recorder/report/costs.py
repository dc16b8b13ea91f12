"""What joules cost: price, currency, shifts and the grid's CO2, from a file or as assumed.

::

    format: ir_costs/1
    price: 0.24            # per kWh
    currency: EUR
    grid: 0.35             # kg CO2 per kWh
    shift_hours: 8.0
    shifts_per_day: 2
    days_per_year: 240
    parts_per_cycle: 1
    availability: 0.85     # share of a shift in which cycles run
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from ir_description import DescriptionFileError
from ir_description.files import plain_yaml
from ir_msgs_py.errors import InvalidValueError, MsgsError
from ir_msgs_py.file_roots import ANYWHERE, FileRoots
from ir_msgs_py.settings import Setting, check_settings, describe, setting
from ir_recorder.errors import CostsError

FORMAT = "ir_costs/1"
_CURRENCY_MAX = 12  # characters
J_PER_KWH = 3.6e6
_DAY = 24.0  # h


@dataclass(frozen=True)
class Costs:
    """Price, shifts and grid."""

    price: float = setting(
        0.20, "Price of a kilowatt-hour, taxes as you count them.", minimum=0.0, maximum=1e4
    )
    currency: str = setting("EUR", "Currency of the price.")
    grid: float = setting(
        0.35,
        "CO2 of the grid, for a mix of coal, gas and renewables.",
        unit="kg/kWh",
        minimum=0.0,
        maximum=10.0,
    )
    shift_hours: float = setting(8.0, "Length of a shift.", unit="h", minimum=0.1, maximum=24.0)
    shifts_per_day: float = setting(2.0, "Shifts a day.", minimum=0.1, maximum=24.0)
    days_per_year: float = setting(240.0, "Days of production a year.", minimum=1.0, maximum=366.0)
    parts_per_cycle: float = setting(
        1.0, "Parts that leave the cell with each cycle.", minimum=0.01, maximum=1e6
    )
    availability: float = setting(
        0.85, "Share of a shift in which cycles run one after the other.", minimum=0.01, maximum=1.0
    )
    given: tuple[str, ...] = setting((), "Names that a file gave; the others are assumptions.")

    def __post_init__(self) -> None:
        check_settings(self)
        if self.shift_hours * self.shifts_per_day > _DAY:
            raise InvalidValueError(
                f"shift_hours is {self.shift_hours:g} h and shifts_per_day "
                f"{self.shifts_per_day:g}: together they must be at most {_DAY:g} h a day"
            )

    def money(self, energy: float) -> float:
        """Price of so many joules."""
        return energy / J_PER_KWH * self.price

    def co2(self, energy: float) -> float:
        """kg of CO2 for so many joules."""
        return energy / J_PER_KWH * self.grid

    def cycles_per_shift(self, seconds: float) -> float:
        """Cycles of so many seconds in a shift."""
        return self.shift_hours * 3600.0 * self.availability / seconds

    def cycles_per_year(self, seconds: float) -> float:
        """Cycles of so many seconds in a year."""
        return self.cycles_per_shift(seconds) * self.shifts_per_day * self.days_per_year


SETTINGS: tuple[Setting, ...] = tuple(each for each in describe(Costs) if each.name != "given")
NAMES = tuple(each.name for each in SETTINGS)
_WORDS = ("currency",)


def read_costs(path: str | Path, roots: FileRoots = ANYWHERE) -> Costs:
    """The costs of a file below `roots`; CostsError with the key that is wrong."""
    try:
        tree = plain_yaml(roots.inside(path))
    except DescriptionFileError as error:
        raise CostsError(str(error)) from error
    except (MsgsError, OSError) as error:
        raise CostsError(f"{path}: {error}") from error
    if not isinstance(tree, dict) or tree.get("format") != FORMAT:
        raise CostsError(f"{path}: is no file of costs, which begins with format: {FORMAT}")
    values = {str(key): value for key, value in tree.items() if key != "format"}
    for key, value in values.items():
        values[key] = _checked(f"{path}: {key[:40]}", key, value)
    try:
        return replace(Costs(), **values, given=tuple(values))
    except MsgsError as error:
        raise CostsError(f"{path}: {error}") from error


def _checked(where: str, key: str, value: object) -> float | str:
    if key not in NAMES:
        raise CostsError(f"{where} is unknown, known are {', '.join(NAMES)}")
    if key in _WORDS:
        if (
            not isinstance(value, str)
            or not 0 < len(value.strip()) <= _CURRENCY_MAX
            or not value.isprintable()
        ):
            raise CostsError(
                f"{where} must be a text of at most {_CURRENCY_MAX} characters in one line"
            )
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise CostsError(f"{where} is {str(value)[:40]!r}, it must be a number")
    return float(value)
