"""Values of KRL: numbers, texts, structures and arrays, and frames as poses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from ir_description.poses import abc_from_rotation, pose_of, rotation_from_abc
from ir_krl.errors import KrlRunError, SourcePlace
from ir_values.arrays import FloatArray

# Values of KRL: numbers, truth values, texts, enumeration values, structures and arrays.

Types: TypeAlias = Mapping[str, Mapping[str, str]]
"""What the components of structures are, by the names of the types; "" is an aggregate's."""


@dataclass(frozen=True)
class Symbol:
    """A value of an enumeration: #BASE."""

    name: str

    def __str__(self) -> str:
        return f"#{self.name}"


@dataclass(eq=True)
class Structure:
    """Components by name; `kind` is the type where the text or a declaration gives it (E6POS), else
    "".
    """

    fields: dict[str, Value]
    kind: str = ""

    def copied(self) -> Structure:
        """A value of its own: KRL assigns by value."""
        return Structure({name: copied(value) for name, value in self.fields.items()}, self.kind)


@dataclass(eq=True)
class Array:
    """Elements by their indices, which begin with 1; what was never set is not there. sizes: how
    many there are in each direction, as declared; () where nobody says it.
    """

    elements: dict[tuple[int, ...], Value] = field(default_factory=dict)
    kind: str = ""
    sizes: tuple[int, ...] = ()

    def copied(self) -> Array:
        """A value of its own."""
        elements = {index: copied(value) for index, value in self.elements.items()}
        return Array(elements, self.kind, self.sizes)

    def check(self, index: tuple[int, ...], name: str, place: SourcePlace) -> None:
        """Raise KrlRunError for an index that isn't within the declared sizes."""
        written = ", ".join(map(str, index))
        if any(one < 1 for one in index):
            raise KrlRunError(
                f"{name}[{written}]: the first element is [1]; give what decides the index, where "
                "that is known on the controller only, --set 'NAME=…'",
                place,
            )
        if not self.sizes:
            return
        declared = ", ".join(map(str, self.sizes))
        row = self.kind == "CHAR" and len(index) == len(self.sizes) - 1  # NAME[1,] is a text
        if len(index) != len(self.sizes) - row or any(
            one > size for one, size in zip(index, self.sizes, strict=False)
        ):
            raise KrlRunError(
                f"{name}[{written}] isn't in {name}[{declared}] as it is declared: a controller "
                "stops there; declare more elements or mend the index",
                place,
            )


@dataclass(frozen=True)
class Unknown:
    """What a name holds that nobody has given a value; what a routine returns that nobody gave.
    kind: the type of the variable, where it is declared.
    """

    name: str
    kind: str = ""

    @property
    def remedy(self) -> str:
        """What helps."""
        if self.name.startswith("$"):
            return f"it is known on the controller only, --set '{self.name}=…' gives one"
        return f"give the file that sets it, or --set '{self.name}=…'"

    def refusal(self, what: str) -> str:
        """Why something that needs a value can't be done."""
        return f"{self.name} has no value, and {what} needs one: {self.remedy}"

    def __str__(self) -> str:
        return f"{self.name}, which has no value: {self.remedy}"


Value: TypeAlias = bool | int | float | str | Symbol | Structure | Array | Unknown


def copied(value: Value) -> Value:
    """The value itself, or a copy of what could be changed from elsewhere."""
    return value.copied() if isinstance(value, Structure | Array) else value


_NO_LETTER = chr(0)
_LETTERS = 256  # that a CHAR may be
INT_MAX = 2**31 - 1
INT_MIN = -(2**31)
REAL_MAX = 3.4e38


def real(value: float) -> float:
    """The REAL of single precision that is nearest to a number: what a controller computes with."""
    with np.errstate(over="ignore"):
        return float(np.float32(value))


def in_range(value: int | float, place: SourcePlace) -> int | float:
    """An INT of 32 bits or a REAL of single precision, as the controller has them. Raises
    KrlRunError beyond their range, where a controller stops.
    """
    if isinstance(value, int):
        if not INT_MIN <= value <= INT_MAX:
            raise KrlRunError(
                f"an INT is from {INT_MIN} to {INT_MAX}; this one has {value.bit_length()} bits: a "
                "controller stops there, make it a REAL",
                place,
            )
        return value
    if not abs(value) <= REAL_MAX:
        raise KrlRunError(
            f"a REAL is at most {REAL_MAX:g}; this one is {value:g}: a controller stops there",
            place,
        )
    return real(value)


def number(value: Value, what: str, place: SourcePlace) -> float:
    """An INT or a REAL as a float. Raises KrlRunError."""
    if isinstance(value, Unknown):
        raise KrlRunError(value.refusal(what), place)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise KrlRunError(f"{what} is {kind_of(value)}, not a number", place)
    return float(value)


def integer(value: Value, what: str, place: SourcePlace) -> int:
    """An INT, or a REAL rounded as KRL does. Raises KrlRunError."""
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    return rounded(number(value, what, place))


def rounded(value: float) -> int:
    """A REAL as an INT: to the nearest, halves away from 0, as the controller assigns it."""
    return int(math.copysign(math.floor(abs(value) + 0.5), value))


def text_of(value: Value) -> str:
    """The text of a CHAR array, set whole or letter by letter, as far as its first letter that
    isn't set.
    """
    if isinstance(value, str):
        return value.partition(_NO_LETTER)[0]
    letters: list[str] = []
    while isinstance(value, Array) and (len(letters) + 1,) in value.elements:
        letter = value.elements[(len(letters) + 1,)]
        if not isinstance(letter, str) or letter == _NO_LETTER:
            break
        letters.append(letter)
    return "".join(letters)


def truth(value: Value, what: str, place: SourcePlace) -> bool:
    """A BOOL. Raises KrlRunError."""
    if isinstance(value, Unknown):
        raise KrlRunError(value.refusal(what), place)
    if not isinstance(value, bool):
        raise KrlRunError(f"{what} is {kind_of(value)}, not TRUE or FALSE", place)
    return value


def kind_of(value: Value) -> str:  # noqa: PLR0911 - one of each kind
    """What a sentence calls the value."""
    match value:
        case Unknown():
            return str(value)
        case bool():
            return "TRUE" if value else "FALSE"
        case int() | float():
            return f"the number {value:g}"
        case str():
            return f"the text {value[:40]!r}"
        case Symbol():
            return str(value)
        case Structure():
            return f"a structure of {', '.join(list(value.fields)[:8])}"
        case Array():
            return "an array"


def typed(kind: str, value: Value, types: Types) -> Value:
    """A value as a variable of the type `kind` holds it: 3 is 3.0 in a REAL and in X of a FRAME,
    2.5 is 3 in an INT, an aggregate takes the type's name. "" where the type isn't known.
    """
    match value:
        case Structure():
            among = _WIDER.get(kind, ())
            name = kind if value.kind in among else value.kind or kind
            parts = types.get(name, {})
            return Structure(
                {
                    part: typed(parts.get(part, ""), one, types)
                    for part, one in value.fields.items()
                    if not among or part in parts
                },
                name,
            )
        case Array():
            held_at = {index: typed(kind, one, types) for index, one in value.elements.items()}
            return Array(held_at, kind or value.kind, value.sizes)
        case int() | float() if not isinstance(value, bool):
            return _number_as(kind, value)
        case str() if kind == "INT" and len(value) == 1:  # a CHAR
            return ord(value)
    return value


def _number_as(kind: str, value: int | float) -> Value:
    """A number as a variable of the type `kind` holds it."""
    if kind == "REAL":
        return real(value)
    if kind == "INT":
        return in_range(rounded(value), SourcePlace()) if isinstance(value, float) else value
    if kind == "CHAR" and isinstance(value, int):
        if not 0 <= value < _LETTERS:
            raise KrlRunError(
                f"a CHAR is from 0 to {_LETTERS - 1}; this one is {value}", SourcePlace()
            )
        return chr(value)
    return value


# FRAME values [mm, deg] to poses (4, 4) [m] and back, and what a position says beside its
# frame.

PLACE_NAMES = ("X", "Y", "Z")
ANGLE_NAMES = ("A", "B", "C")
FRAME_NAMES = (*PLACE_NAMES, *ANGLE_NAMES)
EXTERNAL_NAMES = ("E1", "E2", "E3", "E4", "E5", "E6")
AXIS_NAMES = ("A1", "A2", "A3", "A4", "A5", "A6")
RAIL_NAME = "E1"
"""The external axis that carries a robot on a rail; it counts in mm."""
_FRAME = dict.fromkeys(FRAME_NAMES, "REAL")
_POS = {**_FRAME, "S": "INT", "T": "INT"}
_AXIS = dict.fromkeys(AXIS_NAMES, "REAL")
_EXTERNAL = dict.fromkeys(EXTERNAL_NAMES, "REAL")
TYPES: Types = {
    "": _POS | _AXIS | _EXTERNAL,
    "FRAME": _FRAME,
    "POS": _POS,
    "E6POS": _POS | _EXTERNAL,
    "AXIS": _AXIS,
    "E6AXIS": _AXIS | _EXTERNAL,
    "LOAD": {"M": "REAL", "CM": "FRAME", "J": "INERTIA"},
    "INERTIA": dict.fromkeys(PLACE_NAMES, "REAL"),
    "CP": dict.fromkeys(("CP", "ORI1", "ORI2"), "REAL"),
    "PDAT": dict.fromkeys(("VEL", "ACC", "APO_DIST"), "REAL"),
    "LDAT": dict.fromkeys(("VEL", "ACC", "APO_DIST", "APO_FAC"), "REAL"),
}
"""Those that every controller has."""
_WIDER = {"FRAME": ("POS", "E6POS"), "POS": ("E6POS",), "AXIS": ("E6AXIS",)}
"""Whose values a variable of a type holds without the components that it has not itself."""
_MM = 1e-3  # m


def is_axis_value(value: Structure) -> bool:
    """Whether a structure holds axis angles: AXIS or E6AXIS."""
    return any(name in value.fields for name in AXIS_NAMES)


def components(value: Structure, names: tuple[str, ...], place: SourcePlace) -> dict[str, float]:
    """Those of `names` that are there, as numbers. Raises KrlRunError."""
    return {name: number(value.fields[name], name, place) for name in names if name in value.fields}


def pose(value: Value, what: str, place: SourcePlace) -> FloatArray:
    """The pose (4, 4) [m] of a FRAME, POS or E6POS; components that are missing are 0. Raises
    KrlRunError.
    """
    if isinstance(value, Unknown):
        raise KrlRunError(value.refusal(what), place)
    if not isinstance(value, Structure) or is_axis_value(value):
        raise KrlRunError(f"{what} is {kind_of(value)}, not a FRAME", place)
    found = components(value, FRAME_NAMES, place)
    xyz = [_MM * found.get(name, 0.0) for name in PLACE_NAMES]
    return pose_of(xyz, rotation_from_abc([found.get(name, 0.0) for name in ANGLE_NAMES]))


def frame(transform: FloatArray, kind: str = "FRAME") -> Structure:
    """The FRAME [mm, deg] of a pose (4, 4) [m]."""
    values = [*(transform[:3, 3] / _MM), *abc_from_rotation(transform[:3, :3])]
    return Structure(
        {name: real(value) for name, value in zip(FRAME_NAMES, values, strict=True)}, kind
    )


def rail(value: Structure, place: SourcePlace) -> float | None:
    """Where [m] a position has the rail; None: it doesn't say."""
    found = components(value, (RAIL_NAME,), place)
    return _MM * found[RAIL_NAME] if found else None


def axes(value: Structure, place: SourcePlace) -> dict[str, float]:
    """Axis angles [rad] by name."""
    return {
        name: float(np.radians(angle))
        for name, angle in components(value, AXIS_NAMES, place).items()
    }
