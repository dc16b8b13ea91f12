"""Names and numbers in a written program: what a controller takes, and which outputs and inputs."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from ir_krl.errors import KrlError

# Names as the controller takes them: letters, digits and _, at most 24 characters, no word of
# KRL.

NAME_MAX = 24
_NAME = re.compile(rf"[A-Za-z][A-Za-z0-9_]{{0,{NAME_MAX - 1}}}")
# what a written program calls its variables
_OWN = re.compile(r"XHOME|XSTART|XM\d+_\d+|IR_\w*|XP\d+|FP\d+|PPDAT\d+|LCPDAT\d+")
_WORDS = """
ANIN ANOUT AND AXIS BOOL BRAKE B_AND B_EXOR B_NOT B_OR CASE CAST_FROM CAST_TO CHANNEL CHAR CIRC
CIRC_REL CONFIRM CONST CONST_VEL CONTINUE CCLOSE COPEN CREAD CWRITE C_DIS C_ORI C_PTP C_SPL C_VEL
DECL DEF DEFAULT DEFDAT DEFFCT DELAY DISTANCE DO E6AXIS E6POS ELSE END ENDDAT ENDFCT ENDFOR ENDIF
ENDLOOP ENDSPLINE ENDSWITCH ENDWHILE ENUM EXIT EXOR EXT EXTFCT FALSE FOR FRAME GLOBAL GOTO HALT IF
IMPORT INT INTERRUPT IS LIN LIN_REL LOAD LOOP MAXIMUM MINIMUM NOT OFF ON OR PATH POS PRIO PTP
PTP_REL PTP_SPLINE PUBLIC PULSE REAL REPEAT RESUME RETURN SCIRC SEC SIGNAL SLIN SLIN_REL SPL SPLINE
SPTP START STEP STOP STRUC SWITCH THEN TIME_BLOCK TO TRIGGER TRUE UNTIL WAIT WHEN WHILE WITH
"""
KEYWORDS = frozenset(_WORDS.split())


def check_name(name: str) -> None:
    """Raise KrlError for the name of a program that the controller doesn't take."""
    if not _NAME.fullmatch(name):
        raise KrlError(
            f"the program's name is {name[:40]!r}: a letter, then letters, digits and _, "
            f"at most {NAME_MAX} characters"
        )
    if name.upper() in KEYWORDS:
        raise KrlError(f"the program's name is {name!r}, a word of KRL")


class SignalNames:
    """The names of a cell's signals in one program: as they are where the controller takes them."""

    def __init__(self, program: str) -> None:
        self._taken = {program.upper()}
        self._known: dict[str, str] = {}

    def of(self, signal: str) -> str:
        """The same for the same signal, without regard to its case; another one for every other."""
        key = signal.upper()
        if key not in self._known:
            self._known[key] = self._new(re.sub(r"[^A-Z0-9_]", "_", key))
            self._taken.add(self._known[key])
        return self._known[key]

    def _new(self, name: str) -> str:
        if not _NAME.fullmatch(name[:NAME_MAX]) or name in KEYWORDS or _OWN.fullmatch(name):
            name = f"S_{name}"
        found = name[:NAME_MAX]
        k = 1
        while found in self._taken:
            k += 1
            ending = f"_{k}"
            found = name[: NAME_MAX - len(ending)] + ending
        return found


# Which $OUT and $IN a signal has: the cell's numbers, else the lowest that nobody has.

NUMBER_MAX = 8192
WIDTHS = {"IR_PAUSE": 8}
"""Outputs of a program's own that are a group, and how many they are."""
OUTPUT = "$OUT"
INPUT = "$IN"


@dataclass(frozen=True)
class Numbers:
    """What the cell says of its outputs and inputs, by the names of its signals."""

    outputs: Mapping[str, int] = field(default_factory=dict)
    inputs: Mapping[str, int] = field(default_factory=dict)


class Wiring:
    """The outputs and inputs of one program, each declared once."""

    def __init__(self, program: str, numbers: Numbers) -> None:
        self._names = SignalNames(program)
        self._given = {OUTPUT: _upper(numbers.outputs), INPUT: _upper(numbers.inputs)}
        self._declared: dict[tuple[str, str], tuple[str, int, int]] = {}
        self.assumed: list[str] = []

    def output(self, signal: str) -> str:
        """What the program calls a signal that it sets."""
        return self._declare(OUTPUT, signal, self._names.of(f"{signal}"), 1)

    def input(self, signal: str) -> str:
        """What the program calls a signal that it waits for."""
        return self._declare(INPUT, signal, self._names.of(signal), 1)

    def own(self, kind: str, name: str, count: int = 1) -> str:
        """A signal of the program's own, `count` bits wide, under its own name."""
        return self._declare(kind, name, name, count)

    def declarations(self) -> Iterator[str]:
        """Lines of the data list."""
        for (kind, _), (name, first, count) in self._declared.items():
            last = f" TO {kind}[{first + count - 1}]" if count > 1 else ""
            yield f"SIGNAL {name} {kind}[{first}]{last}"

    def number(self, kind: str, name: str) -> int:
        """The first number of a declared signal."""
        return self._declared[kind, name.upper()][1]

    def _declare(self, kind: str, signal: str, name: str, count: int) -> str:
        key = (kind, signal.upper())
        if key not in self._declared:
            given = self._given[kind].get(signal.upper(), 0)
            first = given or self._free(kind, count)
            self._check_alone(kind, signal, first, count)
            if any(a[0] == name for k, a in self._declared.items() if k[0] != kind):
                name = self._names.of(f"{signal}_{'in' if kind == INPUT else 'out'}")
            self._declared[key] = (name, first, count)
            if not given:
                self.assumed.append(f"{name} {kind}[{first}]")
        return self._declared[key][0]

    def _check_alone(self, kind: str, signal: str, first: int, count: int) -> None:
        """Raise KrlError for a group whose numbers another signal has, or that no controller
        has.
        """
        numbers = range(first, first + count)
        for name, number in self._given[kind].items():
            if number in numbers and name != signal.upper():
                raise KrlError(
                    f"{signal} takes {kind}[{first}] to {kind}[{numbers[-1]}], but {name} has "
                    f"{kind}[{number}]: give one of them another number in the cell file"
                )
        if numbers[-1] > NUMBER_MAX:
            raise KrlError(f"{signal}: {kind}[{numbers[-1]}] is above {NUMBER_MAX}")

    def _free(self, kind: str, count: int) -> int:
        taken: set[int] = set()
        for name, number in self._given[kind].items():
            taken |= set(range(number, number + WIDTHS.get(name, 1)))
        for (other, _), (_, first, width) in self._declared.items():
            taken |= set(range(first, first + width)) if other == kind else set()
        first = 1
        while taken & set(range(first, first + count)):
            first += 1
        return first


def _upper(numbers: Mapping[str, int]) -> dict[str, int]:
    return {name.upper(): number for name, number in numbers.items() if number}
