"""Expressions: operators of KRL on values, frames composed by the geometric operator."""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ir_krl.errors import KrlRunError, SourcePlace
from ir_krl.language import SyntaxTree, place_of
from ir_krl.run.memory import Memory, Step
from ir_krl.run.signals import SINGLE, TIMER, Signals
from ir_krl.run.system import STOPS_ADVANCE
from ir_krl.run.values import (
    FRAME_NAMES,
    INT_MAX,
    Array,
    Structure,
    Symbol,
    Value,
    copied,
    frame,
    in_range,
    integer,
    kind_of,
    number,
    pose,
    real,
    text_of,
    truth,
)

DIGITS_MAX = 12
_BITS = 32  # of an INT
_COMPARED: dict[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}

_LOGICAL: dict[str, Callable[[Any, Any], Any]] = {
    "AND": operator.and_,
    "OR": operator.or_,
    "EXOR": operator.xor,
}

Caller = Callable[[str, list[Any], SourcePlace], Value]
"""Calls a function: name, trees of its arguments, place."""


@dataclass
class Expressions:
    """Evaluates trees in a memory; `call` calls functions."""

    memory: Memory
    signals: Signals
    call: Caller
    file: str = ""

    def value(self, tree: SyntaxTree) -> Value:
        """The value of an expression. Raises KrlRunError with the place."""
        found: Value = getattr(self, f"_{tree.data}")(tree, place_of(tree, self.file))
        return found

    def number(self, tree: SyntaxTree, what: str) -> float:
        """A number [as written]."""
        return number(self.value(tree), what, place_of(tree, self.file))

    def truth(self, tree: SyntaxTree, what: str) -> bool:
        """TRUE or FALSE."""
        place = place_of(tree, self.file)
        return truth(self.memory.guess(self.value(tree), False, place), what, place)

    def path(self, access: SyntaxTree) -> tuple[Step, ...]:
        """Names and indices of an access; a signal's name becomes what it stands for."""
        steps: list[Step] = []
        for name, index in zip(access.children[::2], access.children[1::2], strict=True):
            steps.append((str(name), None if index is None else self.index(index)))
        return (
            self.signals.aliases.get(steps[0][0], tuple(steps)) if len(steps) == 1 else tuple(steps)
        )

    def index(self, tree: SyntaxTree) -> tuple[int, ...] | None:
        """Whole numbers of an index; None for []."""
        place = place_of(tree, self.file)
        guess = self.memory.guess
        found = tuple(
            integer(guess(self.value(one), 1, place), "the index", place)
            for one in tree.children
            if one is not None
        )
        return found or None

    def bound(self, tree: SyntaxTree) -> int:
        """A bound of FOR; one pass is followed where it isn't known."""
        place = place_of(tree, self.file)
        return integer(self.memory.guess(self.value(tree), 1, place), "a bound of FOR", place)

    def _access(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        path = self.path(tree)
        name, index = path[0]
        if index is None and name in self.signals.groups:
            return self.signals.group_value(name, place)
        if index is not None and name in SINGLE:
            return self.signals.read(name, index[0], place)
        if name in STOPS_ADVANCE:
            self.signals.stops(place, name)
        if name == TIMER and index is not None:
            self.signals.stands_still(index[0], place)
        return self.memory.get(path, place)

    def _call(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        name, *arguments = tree.children
        return self.call(str(name), arguments, place)

    def _number(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        text = str(tree.children[0])
        if text.isdigit() and len(text) > DIGITS_MAX:
            raise KrlRunError(
                f"an INT is at most {INT_MAX}; this one has {len(text)} digits", place
            )
        return in_range(int(text) if text.isdigit() else float(text), place)

    def _true(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        return True

    def _false(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        return False

    def _text(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        return str(tree.children[0])[1:-1]

    def _enum_value(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        return Symbol(str(tree.children[0])[1:].strip())

    def _bits(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        text = str(tree.children[0])[1:-1]
        try:
            bits = int(text[1:], 2 if text[0] == "B" else 16)
        except ValueError:
            raise KrlRunError(f"'{text}' is no bit pattern", place) from None
        signed = INT_MAX < bits < 1 << _BITS  # the highest bit is the sign
        return in_range(bits - (1 << _BITS) if signed else bits, place)

    def _aggregate(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        kind, *fields = tree.children
        values: dict[str, Value] = {}
        for field in fields:
            name, _, expression = field.children
            if str(name) in values:
                raise KrlRunError(f"component {name} is given twice", place_of(field, self.file))
            values[str(name)] = copied(self.value(expression))
        return Structure(values, str(kind) if kind is not None else "")

    def _signed(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        sign, operand = tree.children
        value = self.memory.guess(self.value(operand), 0, place)
        number(value, "what follows the sign", place)
        return in_range(-value, place) if sign == "-" else value  # type: ignore[operator]

    def _negated(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        word, operand = tree.children
        value = self.value(operand)
        value = self.memory.guess(value, 0 if word == "B_NOT" else False, place)
        if word == "B_NOT":
            return ~integer(value, "what B_NOT is applied to", place)
        return not truth(value, "what NOT is applied to", place)

    def _added(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        left, sign, right = tree.children
        a, b = self._numbers(left, right, str(sign))
        return in_range(a + b if sign == "+" else a - b, place)

    def _multiplied(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        left, sign, right = tree.children
        a, b = self._numbers(left, right, str(sign))
        if sign == "*":
            return in_range(a * b, place)
        if b == 0:
            raise KrlRunError(
                "division by 0: give what is known on the controller only, --set 'NAME=…'", place
            )
        if isinstance(a, int) and isinstance(b, int):
            whole = abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)  # towards zero
            return in_range(whole, place)
        return in_range(a / b, place)

    def _numbers(
        self, left: SyntaxTree, right: SyntaxTree, sign: str
    ) -> tuple[int | float, int | float]:
        values = []
        for side in (left, right):
            value = _counted(self.memory.guess(self.value(side), 0, place_of(side, self.file)))
            number(value, f"an operand of {sign}", place_of(side, self.file))
            values.append(value)
        return _alike(*values)

    def _joined(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        """AND, OR, EXOR of truth values; B_AND, B_OR, B_EXOR of the bits of whole numbers."""
        left, word, right = tree.children
        otherwise: Value = 0 if word.startswith("B_") else False
        a = self.memory.guess(self.value(left), otherwise, place)
        b = self.memory.guess(self.value(right), otherwise, place)
        what = _LOGICAL[str(word).removeprefix("B_")]
        wanted = int if word.startswith("B_") else bool
        if type(a) is wanted and type(b) is wanted:
            return wanted(what(a, b))
        raise KrlRunError(
            f"{word} joins {kind_of(a)} and {kind_of(b)}; a comparison is weaker: put it in "
            "brackets",
            place,
        )

    def _compared(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        left, sign, right = tree.children
        a = self.value(left)
        b = self.value(right)
        a, b = (self.memory.guess(one, _like(other), place) for one, other in ((a, b), (b, a)))
        a, b = _alike(a, b)
        if sign in ("==", "<>"):
            return (a == b) is (sign == "==")
        a = _counted(a)
        b = _counted(b)
        return _COMPARED[str(sign)](
            number(a, f"the left of {sign}", place), number(b, f"the right of {sign}", place)
        )

    def _composed(self, tree: SyntaxTree, place: SourcePlace) -> Value:
        first, second = tree.children
        a = self.value(first)
        b = self.value(second)
        result = frame(pose(a, "the left of :", place) @ pose(b, "the right of :", place))
        if isinstance(b, Structure):  # S, T and the external axes are those of the right side
            rest = {name: value for name, value in b.fields.items() if name not in FRAME_NAMES}
            result = Structure({**result.fields, **rest}, b.kind or "FRAME")
        return result


def same(a: Value, b: Value) -> bool:
    """Whether two values are equal, as == compares them."""
    left, right = _alike(a, b)
    return bool(left == right)


def _counted(value: Value) -> Value:
    """A letter as its number, which it is in sums and comparisons; another value as it is."""
    return ord(value) if isinstance(value, str) and len(value) == 1 else value


def _alike(a: Any, b: Any) -> tuple[Any, Any]:
    """Two operands: of an INT and a REAL both as REAL, of a letter and an INT both as numbers, of
    texts both whole.
    """
    if isinstance(a, float) and type(b) is int:
        return a, real(b)
    if isinstance(b, float) and type(a) is int:
        return real(a), b
    if isinstance(a, Array | str) and isinstance(b, Array | str):
        return text_of(a), text_of(b)
    if isinstance(a, str) and type(b) is int and len(a) == 1:
        return ord(a), b
    if isinstance(b, str) and type(a) is int and len(b) == 1:
        return a, ord(b)
    return a, b


def _like(value: Value) -> Value:
    """What an unknown value that is compared with this one is taken as."""
    if isinstance(value, str | Array):
        return ""
    return False if isinstance(value, bool) else 0
