"""Values of KRL: numbers, truth values, texts, enumeration values, structures and arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

from ir_krl.errors import KrlRunError, Place


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
    """Elements by their indices, which begin with 1; what was never set is not there."""

    elements: dict[tuple[int, ...], Value] = field(default_factory=dict)
    kind: str = ""

    def copied(self) -> Array:
        """A value of its own."""
        return Array({index: copied(value) for index, value in self.elements.items()}, self.kind)


Value: TypeAlias = bool | int | float | str | Symbol | Structure | Array


def copied(value: Value) -> Value:
    """The value itself, or a copy of what could be changed from elsewhere."""
    return value.copied() if isinstance(value, Structure | Array) else value


INT_MAX = 2**31 - 1
REAL_MAX = 3.4e38


def in_range(value: int | float, place: Place) -> int | float:
    """An INT of 32 bits or a REAL of single range, as the controller has them. Raises
    KrlRunError.
    """
    if isinstance(value, int) and abs(value) > INT_MAX:
        raise KrlRunError(
            f"an INT is at most {INT_MAX}; this one has {value.bit_length()} bits", place
        )
    if isinstance(value, float) and not abs(value) <= REAL_MAX:
        raise KrlRunError(f"a REAL is at most {REAL_MAX:g}; this one is {value:g}", place)
    return value


def number(value: Value, what: str, place: Place) -> float:
    """An INT or a REAL as a float. Raises KrlRunError."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise KrlRunError(f"{what} is {kind_of(value)}, not a number", place)
    return float(value)


def integer(value: Value, what: str, place: Place) -> int:
    """An INT, or a REAL rounded as KRL does. Raises KrlRunError."""
    return round(number(value, what, place))


def truth(value: Value, what: str, place: Place) -> bool:
    """A BOOL. Raises KrlRunError."""
    if not isinstance(value, bool):
        raise KrlRunError(f"{what} is {kind_of(value)}, not TRUE or FALSE", place)
    return value


def kind_of(value: Value) -> str:
    """What a sentence calls the value."""
    match value:
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


def typed(kind: str, value: Value) -> Value:
    """A value as its declaration calls it: REAL X=3 is 3.0, an aggregate takes the type's name."""
    if isinstance(value, Structure) and not value.kind:
        return Structure(value.fields, kind)
    if kind == "REAL" and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if kind == "INT" and isinstance(value, float):
        return round(value)
    return value
