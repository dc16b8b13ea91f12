"""Errors of the house, as one tree, and the sentences that they share.

::

    IrError
    ├── InvalidValueError (ValueError)     out of bounds, not finite or of another shape
    │   ├── TrajectoryError                a point of a trajectory; knows point and joint
    │   │   └── JointNamesError            unknown, missing or double joint
    │   └── PoseError                      a pose that means nothing; knows the code of the answer
    ├── DescriptionError
    │   ├── UnknownNameError (LookupError) a name that is not known; the sentence lists the known
    │   └── DescriptionFileError           a file that is not what it claims: path, line, sentence
    │       ├── CellFileError
    │       └── RobotFileError
    ├── FileRefusedError                   a file outside of the allowed folders, or of another kind
    ├── UnknownTypeError                   no such message, service or action type
    ├── ServiceUnavailableError            no node offers what a script asks for
    ├── CallTimedOutError                  offered, but no answer in time
    ├── CallGivenUpError                   whoever asked does not want the answer any more
    └── RequestRefusedError                answered with a status that is not SUCCESS; carries it

A class exists where somebody catches it differently from its neighbours.
"""

from __future__ import annotations

from collections.abc import Iterable


class IrError(Exception):
    """Root of the errors of the house."""


class InvalidValueError(IrError, ValueError):
    """A value that a field cannot hold; the sentence names the field, the value and its bound."""


class TrajectoryError(InvalidValueError):
    """A trajectory that cannot be followed.

    point and joint are the 0-based indices at fault, None where the whole trajectory is.
    """

    def __init__(self, sentence: str, point: int | None = None, joint: int | None = None) -> None:
        super().__init__(sentence)
        self.point = point
        self.joint = joint


class JointNamesError(TrajectoryError):
    """Joint names that are not the expected set."""


class PoseError(InvalidValueError):
    """A pose that cannot be used; `code` is the status code that answers it."""

    def __init__(self, sentence: str, code: int) -> None:
        super().__init__(sentence)
        self.code = code


class FileRefusedError(IrError):
    """A file that may not be read or written; the sentence names the path and the allowed
    folders.
    """


class UnknownTypeError(IrError):
    """No interface of this name is installed."""


class ServiceUnavailableError(IrError):
    """No node offers this service or action."""


class CallTimedOutError(IrError):
    """The node is there but did not answer in time."""


class CallGivenUpError(IrError):
    """The caller gave the call up before it was answered."""


class RequestRefusedError(IrError):
    """The node answered, with a status other than SUCCESS."""

    def __init__(self, sentence: str, code: int) -> None:
        super().__init__(sentence)
        self.code = code


class DescriptionError(IrError):
    """A file or a name that describes nothing: of a robot, a cell, settings."""


class UnknownNameError(DescriptionError, LookupError):
    """A name that is not known; the sentence lists the known ones."""

    def __init__(self, what: str, name: object, known: Iterable[str]) -> None:
        self.known = tuple(known)
        self._what = what
        self._name = name
        super().__init__(unknown_name(what, name, self.known))

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


def unknown_name(what: str, name: object, known: Iterable[str]) -> str:
    """The sentence for a name that is not known: "cell 'x' is unknown; known are a, b"."""
    return f"{what} {shown(name)} is unknown; known are {listed(known)}"


def shown(value: object, limit: int = 60) -> str:
    """The value as it may stand in a message or a log: quoted, one line of printable characters,
    bounded.
    """
    text = " ".join(repr(value).split("\n"))
    return text if len(text) <= limit else f"{text[: limit - 4]}...{text[-1]}"


def listed(names: Iterable[str], limit: int = 20) -> str:
    """Names as a list for a sentence, cut after `limit`."""
    names = list(names)
    if not names:
        return "none"
    rest = len(names) - limit
    return ", ".join(names[:limit]) + (f" and {rest} more" if rest > 0 else "")


SENTENCE_MAX = 4000  # characters: the longest sentence of the project's own has about 1,500


def one_line(text: str, limit: int = SENTENCE_MAX) -> str:
    """The text as it may stand in answers, logs and diagnostics: one line, bounded, every control
    character and lone surrogate escaped.
    """
    safe = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text[: limit + 1])
    return safe if len(safe) <= limit else f"{safe[: limit - 3]}..."
