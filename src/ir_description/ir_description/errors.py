"""What can go wrong with a description, as one tree.

::

    DescriptionError
    ├── UnknownNameError       a name that nobody has; the sentence lists the known ones (also a
    LookupError) └── DescriptionFileError   a file that can't be read as what it claims: path, line,
    sentence
        ├── CellFileError
        └── RobotFileError

A value that no robot, load or cell can have raises InvalidValueError of ir_msgs_py.errors, as
everywhere.
"""

from __future__ import annotations

from collections.abc import Iterable


class DescriptionError(Exception):
    """Root of all errors of this package."""


class UnknownNameError(DescriptionError, LookupError):
    """A name that is not known; the sentence lists the known ones."""

    def __init__(self, what: str, name: object, known: Iterable[str]) -> None:
        self.known = tuple(known)
        self._what = what
        self._name = name
        super().__init__(f"{what} {shown(name)} is unknown; known are {listed(self.known)}")

    def __reduce__(self) -> tuple[type[UnknownNameError], tuple[object, ...]]:
        return type(self), (self._what, self._name, self.known)


class DescriptionFileError(DescriptionError):
    """`path:line: sentence`; line 0 means the file as a whole."""

    def __init__(self, path: str, line: int, sentence: str) -> None:
        self.path = path
        self.line = line
        self.sentence = sentence
        super().__init__(f"{path}:{line}: {sentence}" if line else f"{path}: {sentence}")

    def __reduce__(self) -> tuple[type[DescriptionFileError], tuple[str, int, str]]:
        return type(self), (self.path, self.line, self.sentence)


class CellFileError(DescriptionFileError):
    """A cell file that is not a cell."""


class RobotFileError(DescriptionFileError):
    """A robot or power data file that is not one."""


def shown(value: object, limit: int = 60) -> str:
    """The value as it may stand in a message or a log: quoted, one line of printable characters,
    bounded.
    """
    text = repr(value)
    return text if len(text) <= limit else f"{text[: limit - 4]}...{text[-1]}"


def listed(names: Iterable[str], limit: int = 20) -> str:
    """Names as a list for a sentence, cut after `limit`."""
    names = list(names)
    if not names:
        return "none"
    rest = len(names) - limit
    return ", ".join(names[:limit]) + (f" and {rest} more" if rest > 0 else "")
