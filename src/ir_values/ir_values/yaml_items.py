"""Typed reading of a YAML tree: every refusal is one sentence with file, line, value, bound and
unit.

An `Item` is a value in its place ("equipment[2].bodies[0].size"); it is asked for what the reader
expects there.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NoReturn

import numpy as np

from ir_values.arrays import FloatArray
from ir_values.errors import (
    DescriptionFileError,
    InvalidValueError,
    UnknownNameError,
    listed,
    shown,
)
from ir_values.yaml_tree import Node, Scalar, parse_yaml

NAME_LENGTH = 64
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_.\-]*")
_INTEGER = re.compile(r"[-+]?(0x[0-9A-Fa-f]{1,8}|[0-9]{1,18})")
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]{1,3})?")
_NOT_FINITE = re.compile(r"[-+]?\.?(nan|inf|infinity)", re.IGNORECASE)


_THOUSANDTHS = {"m": ("lengths", "mm"), "kg": ("masses", "g")}


def in_thousandths(value: float, low: float, high: float, unit: str) -> str:
    """Whether a value out of bounds is in mm or g: "; lengths are in m, is it 1.2?", "" where it is
    not.
    """
    meant = value / 1000.0
    if unit not in _THOUSANDTHS or value == 0.0 or not low <= meant <= high:
        return ""
    return (
        f"; {_THOUSANDTHS[unit][0]} are in {unit}: {meant:g} for {value:g} {_THOUSANDTHS[unit][1]}?"
    )


def decimal_comma(key: str) -> str:
    """What an unknown key of digits comes from."""
    return "; a decimal comma? decimals have a point" if key.isdigit() else ""


def read_items(text: str, source: str, error: type[DescriptionFileError]) -> Item:
    """Return the root of the text's only document."""
    return Item(parse_yaml(text, source, error), source, error, "")


class Item:
    """A value with its place in the file."""

    __slots__ = ("_content", "_error", "_source", "line", "where")

    def __init__(
        self, node: Node, source: str, error: type[DescriptionFileError], where: str
    ) -> None:
        self._content = node.content
        self._source = source
        self._error = error
        self.line = node.line
        self.where = where

    def fail(self, sentence: str) -> NoReturn:
        """Raise the file's error for this place; the sentence goes on after the name of the
        place.
        """
        raise self._error(
            self._source, self.line, f"{self.where} {sentence}" if self.where else sentence
        )

    @contextmanager
    def blamed(self) -> Iterator[None]:
        """Turn refusals of value types inside the block into an error of this place."""
        try:
            yield
        except (InvalidValueError, UnknownNameError) as error:
            raise self._error(
                self._source, self.line, f"{self.where}: {error}" if self.where else str(error)
            ) from error

    def table(self, required: Sequence[str] = (), optional: Sequence[str] = ()) -> Table:
        """Return the mapping here; unknown keys list the known ones, missing ones are named."""
        if not isinstance(self._content, dict):
            self.fail(f"must be a mapping (key: value) of {listed([*required, *optional])}")
        prefix = f"{self.where}." if self.where else ""
        known = [*required, *optional]
        items = {}
        for key, entry in self._content.items():
            if key not in known:
                place = self.where or "the file"
                meant = decimal_comma(key)
                raise self._error(
                    self._source,
                    entry.line,
                    f"{place} has the unknown key {shown(key)}; known are {listed(known)}{meant}",
                )
            items[key] = Item(entry.node, self._source, self._error, prefix + key)
        for key in required:
            if key not in items:
                self.fail(f"has no {key}" if self.where else f"the file has no {key}")
        return Table(self, items)

    def pairs(self) -> list[tuple[str, Item]]:
        """Return a mapping with free keys, in order of the file."""
        if not isinstance(self._content, dict):
            self.fail("must be a mapping (name: value)")
        found = []
        for key, entry in self._content.items():
            item = Item(entry.node, self._source, self._error, f"{self.where}.{shown(key)[1:-1]}")
            item.line = entry.line
            item._check_name(key)
            found.append((key, item))
        return found

    def list(self, low: int = 0, high: int = 100_000) -> list[Item]:
        """Return the list here, of low to high entries."""
        if not isinstance(self._content, list):
            wanted = f"a list of {low} entries" if low == high else "a list"
            self.fail(f"is {shown(self._scalar(wanted).text)}, must be {wanted}")
        if not low <= len(self._content) <= high:
            self.fail(
                f"has {len(self._content)} entries, must have "
                f"{low if low == high else f'{low} to {high}'}"
            )
        return [
            Item(node, self._source, self._error, f"{self.where}[{i}]")
            for i, node in enumerate(self._content)
        ]

    def holds(self, key: str) -> bool:
        """Whether this is a mapping with that key."""
        return isinstance(self._content, dict) and key in self._content

    @property
    def node(self) -> Node:
        """The value as it was read."""
        return Node(self.line, self._content)

    def is_mapping(self) -> bool:
        """Whether this is a mapping."""
        return isinstance(self._content, dict)

    def is_scalar(self) -> bool:
        """Whether this is a single value."""
        return isinstance(self._content, Scalar)

    def is_table(self) -> bool:
        """Whether this is a mapping."""
        return isinstance(self._content, dict)

    def text(self, length: int = 200) -> str:
        """Return one line of text of 1 to `length` printable characters."""
        scalar = self._scalar("text")
        if not 1 <= len(scalar.text) <= length:
            self.fail(f"has {len(scalar.text)} characters, must have 1 to {length}")
        if not scalar.text.isprintable():
            self.fail(f"is {shown(scalar.text)}, must be one line of printable characters")
        return scalar.text

    def name(self) -> str:
        """Return a name: a letter, then letters, digits, `_`, `.` and `-`, at most 64."""
        scalar = self._scalar("a name")
        self._check_name(scalar.text)
        return scalar.text

    def _check_name(self, text: str) -> None:
        if not 1 <= len(text) <= NAME_LENGTH:
            self.fail(f"is a name of {len(text)} characters, must have 1 to {NAME_LENGTH}")
        if not _NAME.fullmatch(text):
            self.fail(
                f"is {shown(text)}, must be a name: a letter of A to Z or a to z, then such, "
                "digits, _ . or -"
            )

    def choice(self, known: Sequence[str]) -> str:
        """Return one of the known words, whatever its case."""
        text = self._scalar("a word").text
        if text.upper() not in known and text not in known:
            self.fail(f"is {shown(text)}, must be one of {listed(known)}")
        return text if text in known else text.upper()

    def boolean(self) -> bool:
        """Return true or false."""
        scalar = self._scalar("true or false")
        if scalar.text not in ("true", "false"):
            self.fail(f"is {shown(scalar.text)}, must be true or false")
        return scalar.text == "true"

    def integer(self, low: int, high: int) -> int:
        """Return a whole number in [low, high]; 0x.. is hexadecimal."""
        scalar = self._scalar("a whole number")
        if not (scalar.plain and _INTEGER.fullmatch(scalar.text)):
            self.fail(f"is {shown(scalar.text)}, must be a whole number")
        value = int(scalar.text, 16 if "x" in scalar.text else 10)
        if not low <= value <= high:
            self.fail(f"is {scalar.text}, must be in [{low}, {high}]")
        return value

    def number(self, low: float, high: float, unit: str = "", *, above: bool = False) -> float:
        """Return a finite number in [low, high], or in (low, high] where `above`."""
        scalar = self._scalar("a number")
        text = scalar.text
        if scalar.plain and _NOT_FINITE.fullmatch(text):
            self.fail(f"is {text}, which is not finite")
        if not (scalar.plain and len(text) <= 64 and _NUMBER.fullmatch(text)):
            self.fail(f"is {shown(text)}, must be a number")
        value = float(text)
        if not math.isfinite(value):
            self.fail(f"is {shown(text)}, which is not finite")
        if not (low < value <= high if above else low <= value <= high):
            left = "(" if above else "["
            bounds = f"must be in {left}{low:g}, {high:g}]{_unit(unit)}"
            self.fail(f"is {text}{_unit(unit)}, {bounds}{in_thousandths(value, low, high, unit)}")
        return value

    def numbers(
        self, count: int, low: float, high: float, unit: str = "", *, above: bool = False
    ) -> FloatArray:
        """Return n = `count` numbers as an array (n,)."""
        values = [item.number(low, high, unit, above=above) for item in self.list(count, count)]
        return np.array(values, dtype=np.float64)

    def rows(
        self, columns: int, low: float, high: float, unit: str = "", *, count: tuple[int, int]
    ) -> FloatArray:
        """Return a list of R rows of n = `columns` numbers as an array (R, n)."""
        rows = [row.numbers(columns, low, high, unit) for row in self.list(*count)]
        return np.array(rows, dtype=np.float64).reshape(-1, columns)

    def _scalar(self, wanted: str) -> Scalar:
        if not isinstance(self._content, Scalar):
            self.fail(f"must be {wanted}")
        if self._content.plain and self._content.text in ("", "~", "null"):
            self.fail(f"is empty, must be {wanted}")
        return self._content


class Table:
    """A mapping whose keys are known."""

    __slots__ = ("_items", "item")

    def __init__(self, item: Item, items: dict[str, Item]) -> None:
        self.item = item
        self._items = items

    def __getitem__(self, key: str) -> Item:
        return self._items[key]

    def __contains__(self, key: str) -> bool:
        return key in self._items

    def joined(self, other: Table) -> Table:
        """Return a table of both, in the place of the other, whose items count where both have
        one.
        """
        return Table(other.item, {**self._items, **other._items})

    def get(self, key: str) -> Item | None:
        """Return the item, or None where the key is not given."""
        return self._items.get(key)

    def one_of(self, *keys: str) -> str:
        """Return which of the keys is given; exactly one must be."""
        given = [key for key in keys if key in self._items]
        if len(given) != 1:
            what = "none" if not given else " and ".join(given)
            self.item.fail(f"must have exactly one of {listed(keys)}, has {what}")
        return given[0]


def _unit(unit: str) -> str:
    return f" {unit}" if unit else ""
