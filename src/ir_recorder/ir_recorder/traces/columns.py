"""Columns of a table: headings with units, and mapping files where headings don't say."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ir_description import DescriptionFileError
from ir_description.files import plain_yaml
from ir_recorder.errors import RecorderError
from ir_recorder.traces.trace import ENERGY, POWER, TIME
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError

# Headings of columns as people write them: "power [kW]", "time_ms", "joint_a1 (deg)"; all become
# SI.

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
    "\N{DEGREE SIGN}": math.radians(1.0),
    "degree": math.radians(1.0),
    "degrees": math.radians(1.0),
    "rad/s": 1.0,
    "mrad/s": 1e-3,
    "deg/s": math.radians(1.0),
    "\N{DEGREE SIGN}/s": math.radians(1.0),
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
    "mv": 1e-3,
    "a": 1.0,
    "ma": 1e-3,
}
"""SI value of one of each unit, by its lower-case name."""

_BRACKETS = re.compile(r"^(?P<name>[^\[\(]+?)\s*[\[\(]\s*(?P<unit>[^\]\)]+?)\s*[\]\)]$")
_INDEX = re.compile(r"\s*[\[\(]\s*(?P<number>\d+)\s*[\]\)]")  # of a vector: actual_q[0]
_ENDING = re.compile(r"^(?P<name>.+)_(?P<unit>[a-zA-Z]+)$")


def factor(unit: str, where: str) -> float:
    """What a value in this unit is multiplied by; RecorderError names the known units."""
    known = FACTORS.get(unit.strip().lower().replace("²", "^2").replace("s2", "s^2"))
    if known is None:
        raise RecorderError(
            f"{where}: unit {unit[:20]!r} is unknown, known are {', '.join(FACTORS)}"
        )
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


def split_unit(heading: str) -> tuple[str, str]:
    """Name and unit of a heading, in brackets or behind the last "_" where it is a known one; ""
    where there is none. The number of an entry in brackets is a part of the name, behind a "_".
    """
    heading = _INDEX.sub(r"_\g<number>", heading.strip())
    found = _BRACKETS.match(heading)
    if found:
        return found["name"].strip(), found["unit"].strip()
    found = _ENDING.match(heading)
    if found and len(found["unit"]) > 1 and found["unit"].lower() in FACTORS:
        return found["name"], found["unit"]
    return heading, ""


# A small file that says what the columns of a trace are, where their headings do not.
#
# ::
#
# format: ir_trace/1 columns: time: {column: "t", unit: ms} power: {column: "P total", unit: kW}
# clock_offset: 0.12     # s, added to the file's time power_is: mean         # of the time since
# the row before, or: sample

FORMAT = "ir_trace/1"
_STEP_MAX = 3600.0  # s
_MOST_FACTORS = 4  # of a product: voltage, current, share
_KEYS = ("format", "columns", "clock_offset", "power_is", "topic", "joints")


@dataclass(frozen=True)
class Column:
    """A column of a file: its heading, and what its values are multiplied by; or the product of
    several, each with its own factor. number: of the column, from 1 on, instead of its heading.
    """

    heading: str
    factor: float = 1.0
    others: tuple[Column, ...] = ()
    number: int = 0


@dataclass(frozen=True)
class TraceMapping:
    """Columns of a file by the names that they mean; empty: the headings say it themselves.

    clock_offset [s] is added to the file's time, NaN where it is to be found by comparing. sampled:
    power is the value of an instant, else the mean since the row before. step [s]: between rows of
    a file without a column of time; NaN: it has one. Of a bag, topic: of its joint states; joints:
    their names in the order of messages that name none.
    """

    columns: Mapping[str, Column] = field(default_factory=lambda: MappingProxyType({}))
    clock_offset: float = math.nan
    sampled: bool = False
    step: float = math.nan
    topic: str = ""
    joints: tuple[str, ...] = ()


def read_mapping(path: Path) -> TraceMapping:
    """The mapping of a file; RecorderError with the key that is wrong."""
    try:
        tree = plain_yaml(path)
    except DescriptionFileError as error:
        raise RecorderError(str(error)) from error
    except InvalidValueError as error:
        raise RecorderError(f"{path}: {error}") from error
    if not isinstance(tree, dict) or tree.get("format") != FORMAT:
        raise RecorderError(f"{path}: is no mapping of a trace, which begins with format: {FORMAT}")
    unknown = [str(key)[:40] for key in tree if key not in _KEYS]
    if unknown:
        raise RecorderError(f"{path}: key {unknown[0]!r} is unknown, known are {', '.join(_KEYS)}")
    meaning = tree.get("power_is", "mean")
    if meaning not in ("mean", "sample"):
        raise RecorderError(f"{path}: power_is is {str(meaning)[:40]!r}, it must be mean or sample")
    topic, joints = _of_bag(path, tree)
    columns = tree.get("columns", {} if topic or joints else None)
    needed = bool(columns) or not (topic or joints)
    if not isinstance(columns, dict) or (needed and TIME not in columns):
        raise RecorderError(f"{path}: columns must name at least time")
    step = _step(f"{path}: {TIME}", columns.get(TIME))
    return TraceMapping(
        MappingProxyType(
            {
                str(name): _column(f"{path}: {name}", each)
                for name, each in columns.items()
                if name != TIME or math.isnan(step)
            }
        ),
        _offset(path, tree),
        meaning == "sample",
        step,
        topic,
        joints,
    )


def _of_bag(path: Path, tree: Mapping[str, Any]) -> tuple[str, tuple[str, ...]]:
    """Topic and names of the joint states of a bag, as far as they are given."""
    topic = tree.get("topic", "")
    joints = tree.get("joints", [])
    if not isinstance(topic, str):
        raise RecorderError(f"{path}: topic is {str(topic)[:40]!r}, it must be the name of one")
    names = isinstance(joints, list) and all(isinstance(each, str) and each for each in joints)
    if not names or len(set(joints)) < len(joints):
        raise RecorderError(f"{path}: joints must be a list of names, each once")
    return topic, tuple(joints)


def _step(where: str, tree: Any) -> float:
    """Seconds between rows of a file without time, NaN where a column has it."""
    if not isinstance(tree, dict) or "step" not in tree:
        return math.nan
    step = tree["step"]
    if not set(tree) <= {"step", "unit"} or not isinstance(step, int | float) or step is True:
        raise RecorderError(f"{where[:200]}: must be {{step: number, unit: unit}}")
    seconds = step * factor(str(tree.get("unit", "s")), where)
    if not 0.0 < seconds <= _STEP_MAX:
        raise RecorderError(f"{where[:200]}: step is {seconds:g} s, must be in (0, {_STEP_MAX:g}]")
    return float(seconds)


def _column(where: str, tree: Any) -> Column:
    if isinstance(tree, str):
        return Column(tree, _in_heading(tree))
    if _is_number(tree):
        return Column(f"number {tree}", number=int(tree))
    if isinstance(tree, dict) and set(tree) == {"product"}:
        parts = tree["product"]
        if not isinstance(parts, list) or not 2 <= len(parts) <= _MOST_FACTORS:
            raise RecorderError(
                f"{where[:200]}: product must be a list of 2 to {_MOST_FACTORS} columns"
            )
        first, *others = (_column(where, each) for each in parts)
        return replace(first, others=tuple(others))
    if not isinstance(tree, dict) or not set(tree) <= {"column", "unit"} or "column" not in tree:
        raise RecorderError(
            f"{where[:200]}: must be {{column: heading, unit: unit}} or {{product: [.., ..]}}"
        )
    given = "unit" in tree
    if _is_number(tree["column"]):
        number = int(tree["column"])
        scale = factor(str(tree["unit"]), where) if given else 1.0
        return Column(f"number {number}", scale, number=number)
    heading = str(tree["column"])
    return Column(heading, factor(str(tree["unit"]), where) if given else _in_heading(heading))


def _is_number(tree: Any) -> bool:
    """Whether a column is given by its number."""
    return isinstance(tree, int) and not isinstance(tree, bool)


def _in_heading(heading: str) -> float:
    """What the unit in a heading's brackets means; 1 where there is none that is known."""
    found = _BRACKETS.match(heading.strip())
    return FACTORS.get(found["unit"].lower(), 1.0) if found else 1.0


def _offset(path: Path, tree: Mapping[str, Any]) -> float:
    offset = tree.get("clock_offset", math.nan)
    if isinstance(offset, bool) or not isinstance(offset, int | float) or math.isinf(offset):
        raise RecorderError(
            f"{path}: clock_offset is {str(offset)[:40]!r}, it must be a number of seconds"
        )
    return float(offset)


# Which columns of a table are read: by their names, with a unit or without, or by a mapping.

Wanted = Callable[[str], bool]
"""Whether a column of this name is read where no mapping names the columns."""


def chosen(
    headings: Sequence[str], where: str, wanted: Wanted, mapping: TraceMapping
) -> dict[str, tuple[int, float]]:
    """Place and factor to SI of each column by its name; RecorderError without a time, or with two
    of a name.
    """
    if mapping.columns:
        places = _mapped(headings, where, mapping)
    else:
        places = _by_heading(headings, where, wanted, timed=math.isnan(mapping.step))
    if TIME not in places and math.isnan(mapping.step):
        raise RecorderError(f"{where}: {without_time(headings)}")
    return places


def _mapped(
    headings: Sequence[str], where: str, mapping: TraceMapping
) -> dict[str, tuple[int, float]]:
    places: dict[str, tuple[int, float]] = {}
    for name, column in _all_columns(mapping):
        if column.number:
            if not 1 <= column.number <= len(headings):
                raise RecorderError(
                    f"{where}: there is no column {column.number}, there are {len(headings)}"
                )
            places[name] = column.number - 1, column.factor
            continue
        if column.heading not in headings:
            raise RecorderError(
                f"{where}: there is no column {column.heading[:80]!r}, {_known(headings)}"
            )
        if headings.count(column.heading) > 1:
            raise RecorderError(f"{where}: column {column.heading[:80]} is there twice")
        places[name] = headings.index(column.heading), column.factor
    return places


def _by_heading(
    headings: Sequence[str], where: str, wanted: Wanted, *, timed: bool
) -> dict[str, tuple[int, float]]:
    """timed: a column says the time."""
    places: dict[str, tuple[int, float]] = {}
    for k, heading in enumerate(headings):
        name, scale = named(heading, where, wanted)
        if not wanted(name) or (name == TIME and not timed):
            continue
        if name in places:
            raise RecorderError(f"{where}: column {name} is there twice")
        places[name] = k, scale
    for name in (TIME, POWER, ENERGY) if timed else (POWER, ENERGY):
        found = other_writing(headings, where, name) if name not in places else None
        if found is not None:
            places[name] = found
    return places


TIMES = ("time", "zeit", "t", "timestamp")
"""What logs call their time; names other than the first need a unit."""


def without_time(headings: Sequence[str]) -> str:
    """What to do about a table in which no heading says that it is the time."""
    nearly = next((each for each in headings if split_unit(each)[0].lower() in TIMES), "")
    if nearly:
        return (
            f"column {nearly[:40]} has no unit: write it into the heading, as {nearly[:40]} [s], "
            "or into a mapping (--mapping)"
        )
    return (
        f"there is no column time, {_known(headings)}; of a file without it the rows per second "
        "are given by ir energy --rate, or their step by a mapping (--mapping): columns: "
        "{time: {step: 4, unit: ms}}"
    )


_TIMES = " x "  # between the name of a product and the number of its factor


def _all_columns(mapping: TraceMapping) -> Iterator[tuple[str, Column]]:
    """Every column of a mapping, the further ones of a product by names of their own."""
    for name, column in mapping.columns.items():
        yield name, column
        for number, other in enumerate(column.others):
            yield f"{name}{_TIMES}{number}", other


def multiplied(columns: Mapping[str, FloatArray], mapping: TraceMapping) -> dict[str, FloatArray]:
    """Columns with the factors of every product multiplied into it."""
    found = dict(columns)
    for name, column in mapping.columns.items():
        for number in range(len(column.others)):
            found[name] = found[name] * found.pop(f"{name}{_TIMES}{number}")
    return found


def named(heading: str, where: str, wanted: Wanted) -> tuple[str, float]:
    """Name and factor of a heading; a unit in brackets has to be known only where the name is
    wanted.
    """
    bare = heading.split("[")[0].split("(")[0].strip()
    if wanted(heading) or (bare != heading and not wanted(bare)):
        return heading, 1.0
    return parsed(heading, where)


def other_writing(headings: Sequence[str], where: str, name: str) -> tuple[int, float] | None:
    """Place and factor of the column of time, power or energy in capitals or, for the time, by
    another of TIMES: only with a unit. RecorderError where there are several.
    """
    known = TIMES if name == TIME else (name,)
    found = []
    for k, heading in enumerate(headings):
        written = _BRACKETS.match(heading) or _ENDING.match(heading)
        if written is not None and written["name"].strip().lower() in known:
            own, scale = parsed(heading, where)
            if own != heading:
                found.append((k, scale))
    if len(found) > 1:
        both = " and ".join(headings[k] for k, _ in found[:2])
        raise RecorderError(f"{where}: column {name} is there twice: {both[:80]}")
    return found[0] if found else None


def _known(headings: Sequence[str]) -> str:
    return f"there is: {', '.join(headings)[:200]}"
