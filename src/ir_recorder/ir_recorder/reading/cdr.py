"""Columns out of many CDR messages of one type at once, without ROS.

A topic at 500 Hz has messages of one layout: the offsets are found by walking the first one, then
every field of all messages is one strided view. Messages of another layout (a longer text, an empty
array) form their own group. Source: OMG CDR (XCDR1, little endian), alignment counted after the
four bytes of the encapsulation header.

Reading takes time and memory in proportion to the bytes, whatever their definition says: an element
has at least one byte, a layout is walked once, and what is walked and compared is bounded.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ir_recorder.errors import ReadError
from ir_recorder.format.schemas import TEXTS, Field, definitions_of, short_name
from ir_values.arrays import FloatArray, IntArray

_DTYPES = {"bool": "u1", "byte": "u1", "char": "u1", "int8": "i1", "uint8": "u1"} | {
    f"{kind}{bits}": f"<{kind[0]}{bits // 8}"
    for kind in ("int", "uint", "float")
    for bits in (16, 32, 64)
}
_HEADER = 4  # bytes: encapsulation kind and options
_LITTLE_ENDIAN = 1  # kind CDR_LE
_ENCAPSULATION = 1  # place of the byte with the kind
MOST_LAYOUTS = 2000  # a topic at a fixed rate has a few
MOST_WALKED = 64 * 2**20  # bytes of the paths of a topic's values; a plan of 100,000 points has 50
_VALUE = 32  # bytes that a value counts beside its path
MOST_COMPARED = 1 << 30  # bytes of lengths that are compared, and beyond these
MOST_PASSES = 20  # times the bytes of the messages
_LENGTH = struct.Struct("<I")
AXES_MAX = 16  # of a robot with its external axes


@dataclass(frozen=True, slots=True)
class _Leaf:
    """Where a field stands in the bytes: `count` values of a dtype, or a text of `count` bytes."""

    path: str
    dtype: str  # "" for a text
    offset: int
    count: int


@dataclass(frozen=True)
class _Layout:
    leaves: dict[str, _Leaf]
    lengths: tuple[int, ...]  # offsets of the words that decide the layout
    end: int  # of the last field


class TooManyValuesError(ReadError):
    """Messages of more values or layouts than are read of a topic."""


class _Budget:
    """What may be done for the messages of a topic; beyond that the sentence is an error."""

    def __init__(self, most: int, sentence: str) -> None:
        self._left = most
        self._sentence = sentence

    def spend(self, amount: int) -> None:
        """Do so much."""
        self._left -= amount
        if self._left < 0:
            raise TooManyValuesError(self._sentence)


class _UnfitError(ReadError):
    """A message that doesn't fit its definition; lengths: offsets of the words that decided it."""

    def __init__(self, sentence: str, lengths: Sequence[int]) -> None:
        super().__init__(sentence)
        self.lengths = lengths


class Columns:
    """Fields of N messages by path ("header.stamp.sec", "position").

    unfit: gets the rows that don't fit their definition, which lack all fields then; None: they are
    a ReadError, as are messages of too many values or layouts.
    """

    def __init__(
        self,
        messages: Sequence[bytes],
        type_name: str,
        schema: str,
        unfit: list[int] | None = None,
    ) -> None:
        definitions = definitions_of(type_name, schema)
        self.count = len(messages)
        self._groups: list[tuple[IntArray, NDArray[np.uint8], _Layout]] = []
        sizes = np.array([len(message) for message in messages], dtype=np.int64)
        walked = _Budget(
            MOST_WALKED,
            f"its messages have too many values: more than {MOST_WALKED:,} bytes of their paths",
        )
        compared = _Budget(
            MOST_COMPARED + MOST_PASSES * int(sizes.sum()),
            f"its messages have too many layouts for {MOST_PASSES} passes over them",
        )
        order = np.argsort(sizes, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(sizes[order])) + 1):
            joined = b"".join(messages[int(i)] for i in rows)
            block = np.frombuffer(joined, dtype=np.uint8).reshape(len(rows), sizes[rows[:1]].sum())
            left = np.arange(len(rows))
            while len(left):
                layout: _Layout | None = None
                try:
                    layout = _layout(bytes(block[left[0]]), definitions, type_name, walked)
                    lengths = layout.lengths
                except _UnfitError as error:
                    if unfit is None:
                        raise
                    lengths = tuple(error.lengths)
                same = _alike(block, left, lengths, compared)
                members = left[same]
                left = left[~same]
                if layout is None:
                    unfit += rows[members].tolist()
                elif len(self._groups) == MOST_LAYOUTS:
                    raise ReadError(f"its messages have more than {MOST_LAYOUTS} different layouts")
                else:
                    own = block if len(members) == len(block) else block[members]
                    self._groups.append((rows[members], own, layout))

    def numbers(self, path: str, width: int | None = None) -> FloatArray:
        """A numeric field as (N,), or (N, width) for an array; missing values are NaN."""
        out = np.full(self.count if width is None else (self.count, width), np.nan)
        for rows, block, layout in self._groups:
            leaf = layout.leaves.get(path)
            if leaf is None:
                continue
            _check_kind(leaf, numeric=True)
            values = _values(block, leaf)
            if width is None:
                out[rows] = values[:, 0] if leaf.count else np.nan
            else:
                used = min(width, leaf.count)
                out[rows, :used] = values[:, :used]
        return out

    def by_axis(self, path: str, least: int) -> FloatArray:
        """A numeric array with a value per axis as (N, n): n is the longest one of up to AXES_MAX,
        `least` at least; missing values are NaN.
        """
        leaves = (layout.leaves.get(path) for _, _, layout in self._groups)
        longest = max((leaf.count for leaf in leaves if leaf is not None), default=0)
        return self.numbers(path, max(least, min(longest, AXES_MAX)))

    def integers(self, path: str) -> IntArray:
        """A whole-number field as (N,); 0 where it is missing. Raises ReadError for another one."""
        out = np.zeros(self.count, dtype=np.int64)
        for rows, block, layout in self._groups:
            leaf = layout.leaves.get(path)
            if leaf is not None and leaf.count:
                _check_kind(leaf, numeric=True)
                values = _values(block, leaf)[:, 0]
                if values.dtype.kind == "f":
                    raise ReadError(f"its field {path} is {leaf.dtype}, must be whole numbers")
                out[rows] = values
        return out

    def texts(self, path: str) -> list[str]:
        """A text field of every message; "" where it is missing."""
        out = [""] * self.count
        for rows, block, layout in self._groups:
            leaf = layout.leaves.get(path)
            if leaf is None:
                continue
            _check_kind(leaf, numeric=False)
            part = np.ascontiguousarray(block[:, leaf.offset : leaf.offset + leaf.count])
            for row, data in zip(rows, part, strict=True):
                out[row] = data.tobytes().rstrip(b"\0").decode(errors="replace")
        return out

    def require(self, *paths: str) -> None:
        """ReadError where a message has no such field: its definition is another type's."""
        for path in paths:
            if any(path not in layout.leaves for _, _, layout in self._groups):
                raise ReadError(f"its definition has no field {path}")

    def lengths(self, path: str) -> set[int]:
        """How many values a field has, over all messages."""
        leaves = (layout.leaves.get(path) for _, _, layout in self._groups)
        return {leaf.count if leaf is not None else 0 for leaf in leaves}

    def ends(self) -> IntArray:
        """Offset (N,) behind the last field of each message; what follows is padding."""
        out = np.zeros(self.count, dtype=np.int64)
        for rows, _, layout in self._groups:
            out[rows] = layout.end
        return out

    def is_constant(self, path: str) -> bool:
        """Whether a field has the same bytes in all messages."""
        first: bytes | None = None
        for _, block, layout in self._groups:
            leaf = layout.leaves.get(path)
            if leaf is None:
                return False
            size = np.dtype(leaf.dtype or "u1").itemsize * leaf.count
            part = block[:, leaf.offset : leaf.offset + size]
            if not (part == part[0]).all():
                return False
            own = part[0].tobytes()
            if first not in (None, own):
                return False
            first = own
        return True

    def stamps(self) -> IntArray:
        """The stamps of the headers as (N,) nanoseconds."""
        seconds = self.integers("header.stamp.sec")
        return seconds * 1_000_000_000 + self.integers("header.stamp.nanosec")


MOST_JOINTS = 64  # that a message of joint states names


def joint_groups(columns: Columns) -> dict[tuple[str, ...], IntArray]:
    """Rows of messages of joint states by the joints that they name, most joints first; those that
    name none are last.
    """
    named = [columns.texts(f"name[{k}]") for k in range(MOST_JOINTS)]
    groups: dict[tuple[str, ...], list[int]] = {}
    for row, names in enumerate(zip(*named, strict=True)):
        groups.setdefault(tuple(name for name in names if name), []).append(row)
    order = sorted(groups, key=lambda names: (-len(names), -len(groups[names])))
    return {names: np.array(groups[names], dtype=np.int64) for names in order}


def one_robot(groups: Mapping[tuple[str, ...], IntArray]) -> list[tuple[str, ...]]:
    """Of `joint_groups` those of the robot, which has most joints: its names in each order that
    messages have them. Raises ReadError where messages name as many others, or one of them twice.
    """
    first = next(iter(groups), ())
    most = [names for names in groups if len(names) == len(first)]
    if not first or any(sorted(names) != sorted(first) for names in most):
        raise ReadError("its joint states name other joints from message to message")
    if len(set(first)) < len(first):
        raise ReadError(f"its joint states name a joint twice: {', '.join(first)[:200]}")
    return most


def by_name(columns: Columns, names: Sequence[str], *paths: str) -> list[FloatArray]:
    """Fields of joint states, each (N, n) in the order of `names`, in whichever order a message
    names these joints; missing values are NaN. Raises ReadError for other joints.
    """
    fields = [columns.numbers(path, len(names)) for path in paths]
    if all(columns.is_constant(f"name[{k}]") for k in range(len(names))):
        return fields
    for order, rows in joint_groups(columns).items():
        if sorted(order) != sorted(names):
            raise ReadError("its joint states name other joints from message to message")
        places = [order.index(name) for name in names]
        for values in fields:
            values[rows] = values[rows][:, places]
    return fields


def fitting(messages: Sequence[bytes], type_name: str, schema: str) -> list[int]:
    """Rows of the messages that fit the definition of their type. Raises ReadError where the
    definition or the number of values or layouts is more than is read.
    """
    unfit: list[int] = []
    Columns(messages, type_name, schema, unfit)
    left_out = set(unfit)
    return [row for row in range(len(messages)) if row not in left_out]


def _check_kind(leaf: _Leaf, numeric: bool) -> None:
    if bool(leaf.dtype) is not numeric:
        found, wanted = ("numbers", "a text") if leaf.dtype else ("a text", "numbers")
        raise ReadError(f"its field {leaf.path} is {found}, must be {wanted}")


def _values(block: NDArray[np.uint8], leaf: _Leaf) -> NDArray[np.generic]:
    dtype = np.dtype(leaf.dtype)
    part = np.ascontiguousarray(block[:, leaf.offset : leaf.offset + leaf.count * dtype.itemsize])
    return part.view(dtype).reshape(len(block), leaf.count)


def _alike(
    block: NDArray[np.uint8], rows: IntArray, lengths: Sequence[int], compared: _Budget
) -> NDArray[np.bool_]:
    """Which of the rows (N,) of a block (M, size) have the first one's words at these offsets, and
    its kind: their layout is the same.
    """
    size = block.shape[1]
    places = np.array(
        [at for at in (_ENCAPSULATION, *(o + k for o in lengths for k in range(4))) if at < size],
        dtype=np.int64,
    )
    compared.spend(len(rows) * len(places))
    words = block[np.ix_(rows, places)]
    alike: NDArray[np.bool_] = (words == words[0]).all(axis=1)
    return alike


def _layout(
    data: bytes, definitions: Mapping[str, tuple[Field, ...]], type_name: str, walked: _Budget
) -> _Layout:
    walker = _Walker(data, definitions, walked)
    name = short_name(type_name)
    if len(data) < _HEADER:
        raise _UnfitError(f"a message has {len(data)} bytes, CDR begins with {_HEADER}", ())
    if data[_ENCAPSULATION] != _LITTLE_ENDIAN:
        raise _UnfitError("a message isn't little-endian CDR", ())
    try:
        walker.structure(name, "")
    except (struct.error, KeyError) as error:
        raise _UnfitError(
            f"a message of type {name} with {len(data)} bytes doesn't fit its definition: "
            f"{error!r}",
            walker.lengths,
        ) from error
    return _Layout(walker.leaves, tuple(walker.lengths), walker.at)


class _Walker:
    """Goes through one message and notes where its fields stand; an element of it takes at least a
    byte of the message, and `walked` is told of each.
    """

    def __init__(
        self, data: bytes, definitions: Mapping[str, tuple[Field, ...]], walked: _Budget
    ) -> None:
        self._data = data
        self._definitions = definitions
        self._walked = walked
        self.at = _HEADER
        self.leaves: dict[str, _Leaf] = {}
        self.lengths: list[int] = []

    def structure(self, name: str, prefix: str) -> None:
        fields = self._definitions[name]
        self._walked.spend(len(prefix) + _VALUE)
        if not fields:
            self._advance(1)  # an empty structure has one byte in CDR
        for field in fields:
            path = f"{prefix}{field.name}"
            count = 1 if field.count is None else field.count
            if count < 0:
                count = self._length()
            if field.primitive and field.type not in TEXTS:
                self._numbers(path, _DTYPES[field.type], count)
            else:
                for index in range(count):
                    own = path if field.count is None else f"{path}[{index}]"
                    if field.primitive:
                        self._text(own)
                    else:
                        self.structure(field.type, f"{own}.")

    def _numbers(self, path: str, dtype: str, count: int) -> None:
        size = np.dtype(dtype).itemsize
        if count:
            self._align(size)
        self._note(_Leaf(path, dtype, self.at, count))
        self._advance(size * count)

    def _note(self, leaf: _Leaf) -> None:
        self._walked.spend(len(leaf.path) + _VALUE)
        self.leaves[leaf.path] = leaf

    def _text(self, path: str) -> None:
        length = self._length()
        self._note(_Leaf(path, "", self.at, length))
        self._advance(length)

    def _length(self) -> int:
        self._align(4)
        self.lengths.append(self.at)
        (length,) = _LENGTH.unpack_from(self._data, self.at)
        self.at += 4
        return int(length)

    def _align(self, size: int) -> None:
        self.at += (_HEADER - self.at) % size

    def _advance(self, size: int) -> None:
        self.at += size
        if self.at > len(self._data):
            raise struct.error(f"{self.at - len(self._data)} bytes are missing")
