"""Values that a program is followed with, and stubs of routines that it lacks."""

from __future__ import annotations

from collections.abc import Iterable

from ir_krl.errors import KrlError
from ir_krl.language import SourceFile, parse
from ir_krl.run import UnknownRoutine

SETTINGS = "--set"


def settings_of(lines: Iterable[str], name: str = SETTINGS) -> SourceFile:
    """Lines NAME=VALUE as a data list; `name` is the file that complaints carry. Raises KrlError
    for a line that is none.
    """
    kept = [line.strip() for line in lines]
    for line in kept:
        if line and not line.startswith((";", "&")) and "=" not in line:
            raise KrlError(f"{name}: {line[:60]!r} is no NAME=VALUE")
    return parse("\n".join(["DEFDAT SETTINGS", *kept, "ENDDAT", ""]), name)


def stubs(unknown: Iterable[UnknownRoutine]) -> str:
    """Routines of these names that do nothing, to be filled in."""
    return "\n".join(line for one in unknown for line in _stub(one))


def _stub(one: UnknownRoutine) -> list[str]:
    names = [f"A{k + 1}" for k in range(one.arguments)]
    head = f"{one.name}({', '.join(f'{name}:IN' for name in names)})"
    comment = "; what it moves, waits for and sets"
    if one.function:
        return [f"GLOBAL DEFFCT REAL {head}", comment, "RETURN 0", "ENDFCT", ""]
    return [f"GLOBAL DEF {head}", comment, "END", ""]
