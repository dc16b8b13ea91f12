"""Routines of several files: those of the same file come first, as on the controller."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath

from ir_krl.errors import KrlRunError
from ir_krl.language import Routine, Source, place_of


def module_of(file: str) -> str:
    """The module that a file belongs to: a .src and its .dat have one."""
    return PurePath(file).stem.upper()


class Routines:
    """All routines of the sources. Raises KrlRunError where a file has two of one name, or two
    files begin with one of the same name, which other files then can't call.
    """

    def __init__(self, sources: Sequence[Source]) -> None:
        self._found: dict[str, list[Routine]] = {}
        leading = {source.routines[0] for source in sources if source.routines}
        for source in sources:
            for one in source.routines:
                others = self._found.setdefault(one.name, [])
                if any(other.file == one.file or {other, one} <= leading for other in others):
                    raise KrlRunError(f"{one.name} is defined twice", place_of(one.body, one.file))
                others.insert(0 if one in leading else len(others), one)

    @property
    def names(self) -> list[str]:
        """In the order in which they are defined."""
        return list(self._found)

    def named(self, name: str, file: str = "") -> Routine | None:
        """The routine that a call in `file` means."""
        there = self._found.get(name, [])
        return next((one for one in there if one.file == file), there[0] if there else None)
