"""Errors in a KRL program, each with the file, the line and the column."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SourcePlace:
    """Where something stands: file as the caller named it, line and column from 1; 0 where
    unknown.
    """

    file: str = ""
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}" if self.line else self.file


class KrlError(Exception):
    """A program that can't be read, run or written: `place` and a sentence.

    Raised itself for a text that is no KRL, or a construct of KRL that isn't read here.
    """

    def __init__(self, message: str, place: SourcePlace | None = None) -> None:
        self.place = place or SourcePlace()
        self.reason = message
        super().__init__(f"{self.place}: {message}" if str(self.place) else message)


class KrlRunError(KrlError):
    """A program that can't be followed: a name without a value, a signal that isn't given, a wrong
    type.
    """


class KrlMotionError(KrlError):
    """A motion that the robot can't do: out of reach, past a limit, through a singularity."""
