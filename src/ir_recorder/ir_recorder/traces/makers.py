"""Columns of logs as controllers name them: whose they are, and in which units.

A unit in a heading counts. Without one the unit is the documented one of the maker's format (UR's
RTDE: rad, s and A; KUKA's AIPos and $AXIS_ACT: degrees, IPOC: ms; ABB's EGM: degrees, tm: ms).
Plain names as A1 or J1 are of no format: they are degrees where that is proved, as axis 2 or 3
would turn farther than an arm can if they were rad. Whatever is taken is said.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from ir_recorder.errors import RecorderError
from ir_recorder.traces.columns import (
    TIMES,
    Column,
    TraceMapping,
    factor,
    split_unit,
    without_time,
)
from ir_recorder.traces.trace import CURRENT, POWER, TIME, VELOCITY
from ir_values.arrays import FloatArray

_TURN = 2.0 * math.pi
_ARM = (1, 2)  # the second and third joint: no arm turns them farther than a turn from zero


@dataclass(frozen=True)
class _Family:
    """Headings of all joints: `name` with {} for the number, which begins at `first`; unit "" where
    no document gives it; time: heading and unit of the column of time in this format.
    """

    name: str
    first: int
    unit: str
    of: str
    time: tuple[str, str] = ("", "")
    more: tuple[tuple[str, str, str], ...] = ()  # further columns: name, ending, unit
    power: tuple[str, ...] = ()  # columns in V and A whose product is W


_RTDE = (("actual_qd_{}", VELOCITY, "rad/s"), ("actual_current_{}", CURRENT, "a"))
_RTDE_POWER = ("actual_robot_voltage", "actual_robot_current")
_RTDE_CLOCK = ("timestamp", "s")
_FAMILIES = (
    _Family("actual_q_{}", 0, "rad", "UR's RTDE", _RTDE_CLOCK, _RTDE, _RTDE_POWER),
    _Family("actual_q{}", 0, "rad", "UR's RTDE", _RTDE_CLOCK),
    _Family("actual_q_{}", 1, "rad", "UR's RTDE", _RTDE_CLOCK, _RTDE, _RTDE_POWER),
    *(
        _Family(f"aipos{sign}a{{}}", 1, "deg", "KUKA's RSI", ("ipoc", "ms"))
        for sign in (".", "_", " ", "")
    ),
    *(
        _Family(f"{word}{sign}a{{}}", 1, "deg", "KUKA's $AXIS_ACT", ("ipoc", "ms"))
        for word in ("$axis_act", "axis_act", "axisact")
        for sign in (".", "_", " ")
    ),
    *(
        _Family(f"feedback{path}{{}}", first, "deg", "ABB's EGM", (f"header{path[:1]}tm", "ms"))
        for path in (".joints.joints.", ".joints.", "_joints_joints_", "_joints_")
        for first in (0, 1)
    ),
    *(
        _Family(name, first, "", "")
        for name in (
            "a{}",
            "j{}",
            "joint{}",
            "joint_{}",
            "joint {}",
            "axis{}",
            "axis_{}",
            "q{}",
            "q_{}",
        )
        for first in (1, 0)
    ),
)


@dataclass(frozen=True, eq=False)
class MakersColumns:
    """What a log's headings mean; joints: those whose unit the values have to prove."""

    mapping: TraceMapping
    joints: tuple[str, ...]
    headings: tuple[str, ...]
    note: str

    def proved(
        self, columns: Mapping[str, FloatArray], where: str
    ) -> tuple[dict[str, FloatArray], str]:
        """The columns in SI, and a sentence on their units. RecorderError where nothing proves a
        unit.
        """
        if not self.joints:
            return dict(columns), self.note
        arm = [self.joints[k] for k in _ARM if k < len(self.joints)]
        reached = {name: float(np.nanmax(np.abs(columns[name]), initial=0.0)) for name in arm}
        name = max(reached, key=lambda each: reached[each])
        heading = self.headings[self.joints.index(name)]
        if not reached[name] > _TURN:
            raise RecorderError(
                f"{where}: {self.headings[0]} .. {self.headings[-1]} have no unit, and nothing "
                f"proves one: write it into the headings, as {self.headings[0]} [deg], or into a "
                "mapping (--mapping)"
            )
        degrees = math.radians(1.0)
        found = {
            each: values * degrees if each in self.joints else values
            for each, values in columns.items()
        }
        why = f"{heading} reaches {reached[name]:.4g}, which in rad is more than a turn"
        return found, f"{self.note}, in degrees: {why}"


def makers_columns(
    headings: Sequence[str],
    joint_names: Sequence[str],
    where: str,
    time: Column | None = None,
    step: float = math.nan,
) -> MakersColumns | None:
    """The columns of a known family of headings that has all joints, or that of the power of UR's
    RTDE without any; None where there is none.

    time: the column of that name, where there is one; a maker's own clock comes before it, as logs
    number their rows so. step [s]: between rows of a file without time; NaN: it has one.

    RecorderError for a joint that the robot doesn't have, and for a time without a unit.
    """
    places = _by_name(headings)
    nearly = ""
    for family in _FAMILIES:
        found = [places.get(family.name.format(family.first + k)) for k in range(len(joint_names))]
        if not joint_names or None in found:
            nearly = nearly or _missing(family, found)
            continue
        own = [heading for heading in found if heading is not None]
        extra = places.get(family.name.format(family.first + len(joint_names)))
        if extra is not None:
            there = ", ".join(joint_names)
            raise RecorderError(f"{where}: {extra} is no joint of the robot, which has {there}")
        return _columns(family, own, joint_names, places, where, _clock(family, places, time, step))
    if nearly:
        raise RecorderError(f"{where}: {nearly}")
    return _metered(places, where)


def _clock(
    family: _Family, places: Mapping[str, str], time: Column | None, step: float
) -> Column | None:
    """The column of a file's own name for its time, where it counts; the empty one where rows are a
    step [s] apart.
    """
    if not math.isnan(step):
        return Column("")
    own = bool(family.time[0]) and family.time[0] in places
    return None if own else time


def _metered(places: Mapping[str, str], where: str) -> MakersColumns | None:
    """Time and power of a log of UR's RTDE without joints; None where it has not both."""
    clock, unit = _RTDE_CLOCK
    if clock not in places or not set(_RTDE_POWER) <= set(places):
        return None
    volts, *others = (_with_unit(places[name], where) for name in _RTDE_POWER)
    power = replace(volts, others=tuple(others))
    columns = {TIME: _with_unit(places[clock], where, unit), POWER: power}
    said = f"{places[clock]} is taken as time, {' times '.join(_RTDE_POWER)} as power"
    return MakersColumns(TraceMapping(MappingProxyType(columns)), (), (), said)


def _missing(family: _Family, found: Sequence[str | None]) -> str:
    """What a maker's format lacks where it has most joints of the robot."""
    there = [heading for heading in found if heading is not None]
    if not family.of or 2 * len(there) <= len(found):
        return ""
    missing = family.name.format(family.first + found.index(None))
    return f"there is {there[0]} and no {missing}: the robot has {len(found)} joints"


def _columns(
    family: _Family,
    own: Sequence[str],
    joint_names: Sequence[str],
    places: Mapping[str, str],
    where: str,
    time: Column | None,
) -> MakersColumns:
    units = [split_unit(heading)[1] or family.unit for heading in own]
    unproved = "" in units
    if unproved and any(units):
        raise RecorderError(f"{where}: only some of {own[0]} .. {own[-1]} have a unit")
    clock = time or _time(family, places, where)
    columns = {TIME: clock} if clock.heading else {}
    for name, heading, unit in zip(joint_names, own, units, strict=True):
        columns[name] = Column(heading, factor(unit, f"{where}: {heading}") if unit else 1.0)
    columns.update(_further(family, joint_names, places, where))
    said = f"{own[0]} .. {own[-1]} are taken as positions of {joint_names[0]} .. {joint_names[-1]}"
    if time is None and "time" in places and clock.heading != places["time"]:
        said += f", {clock.heading} as time, not {places['time']}"
    if family.of and not split_unit(own[0])[1]:
        said += f", in {family.unit} as {family.of} gives them"
    return MakersColumns(
        TraceMapping(MappingProxyType(columns)),
        tuple(joint_names) if unproved else (),
        tuple(own),
        said,
    )


def _further(
    family: _Family, joint_names: Sequence[str], places: Mapping[str, str], where: str
) -> Iterator[tuple[str, Column]]:
    """Speeds and currents that the format has of all joints, and its power."""
    if family.power and set(family.power) <= set(places):
        volts, *others = (_with_unit(places[name], where) for name in family.power)
        yield POWER, replace(volts, others=tuple(others))
    for pattern, ending, unit in family.more:
        found = [places.get(pattern.format(family.first + k)) for k in range(len(joint_names))]
        own = [heading for heading in found if heading is not None]
        if len(own) == len(joint_names):
            for name, heading in zip(joint_names, own, strict=True):
                yield f"{name}{ending}", _with_unit(heading, where, unit)


def _with_unit(heading: str, where: str, usual: str = "") -> Column:
    """A column in the unit of its heading; else in the usual one, "" in SI."""
    unit = split_unit(heading)[1] or usual
    return Column(heading, factor(unit, f"{where}: {heading}") if unit else 1.0)


def _time(family: _Family, places: Mapping[str, str], where: str) -> Column:
    heading, unit = family.time
    if heading in places:
        return _with_unit(places[heading], where, unit)
    found = next((places[name] for name in TIMES if name in places), None)
    if found is None or not split_unit(found)[1]:
        raise RecorderError(f"{where}: {without_time(list(places.values()))}")
    return _with_unit(found, where)


def _by_name(headings: Sequence[str]) -> dict[str, str]:
    """Headings by their lower-case names without a unit; those that stand twice are none."""
    found: dict[str, str] = {}
    twice = set()
    for heading in headings:
        name = split_unit(heading)[0].lower()
        if name in found:
            twice.add(name)
        found[name] = heading
    return {name: heading for name, heading in found.items() if name not in twice and name}
