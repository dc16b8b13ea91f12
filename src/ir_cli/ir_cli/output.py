"""Output of the commands: tables, JSON and CSV, and lines that show progress."""

from __future__ import annotations

import argparse
import csv
import json
import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TextIO

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


Row = Mapping[str, Any]
Columns = Mapping[str, tuple[str, Callable[[Any], str]]]  # title and format by key
NOTHING = "-"


def add_formats(parser: argparse.ArgumentParser, comma: bool = True) -> None:
    """--json, and --csv where the answer is a table."""
    formats = parser.add_mutually_exclusive_group()
    formats.add_argument("--json", action="store_true", help="print the answer as JSON")
    if comma:
        formats.add_argument("--csv", action="store_true", help="print the table as CSV, SI units")


def print_json(answer: Mapping[str, Any]) -> None:
    """One JSON document; what is not finite is null."""
    sys.stdout.write(json.dumps(_plain(answer), indent=1, allow_nan=False) + "\n")


def print_csv(rows: Sequence[Row]) -> None:
    """Rows with the same keys."""
    writer = csv.DictWriter(sys.stdout, list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(_plain(dict(row)) for row in rows)


def print_table(rows: Sequence[Row], columns: Columns) -> None:
    """Rows as text."""
    titles = [title for title, _ in columns.values()]
    cells = [[shown(row[key]) for key, (_, shown) in columns.items()] for row in rows]
    sys.stdout.write(table(titles, cells) + "\n")


def number(digits: int, scale: float = 1.0) -> Callable[[Any], str]:
    """A format of numbers; nothing where there is none."""

    def shown(value: Any) -> str:
        return (
            NOTHING
            if value is None or not math.isfinite(value)
            else f"{round(scale * value, digits) + 0.0:.{digits}f}"
        )

    return shown


def kilowatt_hours(value: Any) -> str:
    """Energy [kWh] as it is paid for; Wh below one."""
    if value is None or not math.isfinite(value):
        return NOTHING
    return f"{value:.2f} kWh" if abs(value) >= 1.0 else f"{1e3 * value:.3g} Wh"


def text(value: Any) -> str:
    """A format of words."""
    return str(value) or NOTHING


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value


class ProgressLine:
    """One line on stderr that is kept up to date, and gone at the end; quiet where nobody looks."""

    def __init__(self) -> None:
        self._stream = sys.stderr
        self._live = self._stream.isatty()

    def __enter__(self) -> ProgressLine:
        return self

    def __exit__(self, *_: object) -> None:
        self._write("")

    def show(self, phase: str, done: int, total: int, cost: float, left: str = "") -> None:
        """Phase, steps done of all, cost of the best answer so far (0, inf: none yet), time left in
        words.
        """
        best = f", best {cost:.0f}" if math.isfinite(cost) and cost > 0.0 else ""
        self._write(f"… {phase} {done} of {total}{best}{left}")

    def _write(self, line: str) -> None:
        if self._live:
            self._stream.write(f"\r\x1b[2K{line}")
            self._stream.flush()


class _Renamed(argparse.Action):
    """An old name of an option: it does what the new one does, and says so on stderr."""

    def __init__(self, *arguments: Any, new: argparse.Action, **settings: Any) -> None:
        super().__init__(*arguments, **settings)
        self._new = new

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        name = self._new.option_strings[-1] if self._new.option_strings else self._new.metavar
        sys.stderr.write(f"ir: {option_string} is now {name}\n")
        self._new(parser, namespace, values, option_string)


def add_renamed(parser: argparse.ArgumentParser, old: str, new: argparse.Action) -> None:
    """Keep an old name of an option, without help."""
    parser.add_argument(
        old,
        dest=new.dest,
        action=_Renamed,
        new=new,
        nargs=new.nargs,
        type=new.type or str,
        choices=new.choices,
        default=argparse.SUPPRESS,
        help=argparse.SUPPRESS,
    )
