"""What a person sees: a progress line, and tables."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import TextIO

SHOWN_ELEMENTS = 128
"""Longer arrays of a message end in "..." unless --full asks for all, as in ros2cli."""


class Progress:
    """Steps with their seconds; on a terminal the running step's line is kept up to date."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stdout if stream is None else stream
        self._live = self._stream.isatty()
        self._began = time.monotonic()
        self._title = ""

    def begin(self, title: str) -> None:
        """Start a step."""
        self._title = title
        self._began = time.monotonic()
        self.update("")

    def update(self, detail: str) -> None:
        """Show how far the running step is; quiet where the output is not a terminal."""
        if self._live:
            self._stream.write(f"\r\x1b[2K  … {self._title} {detail}")
            self._stream.flush()

    def end(self, detail: str = "") -> None:
        """Close the running step with what came out of it."""
        seconds = time.monotonic() - self._began
        start = "\r\x1b[2K" if self._live else ""
        self._stream.write(
            f"{start}  {seconds:6.1f} s  {self._title}{': ' if detail else ''}{detail}\n"
        )
        self._stream.flush()

    def say(self, text: str) -> None:
        """Write a line between steps."""
        self._stream.write(text + "\n")
        self._stream.flush()


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Text table: first column to the left, the others to the right."""
    cells = [list(header), *[list(row) for row in rows]]
    widths = [max(len(row[column]) for row in cells) for column in range(len(header))]
    lines = [
        "  ".join(
            cell.ljust(width) if column == 0 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in cells
    ]
    lines.insert(1, "  ".join("-" * width for width in widths))
    return "\n".join(lines)
