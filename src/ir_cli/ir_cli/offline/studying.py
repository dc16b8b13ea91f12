"""What `ir study` and `ir arena` share: processes, where results go, progress, what Ctrl-C says."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

from ir_studies import Means
from ir_studies.work import MOST_WORKERS

from ..errors import InputError
from .output import ProgressLine

Made = TypeVar("Made")


class TimeLeft:
    """How long the rest of a phase takes when it goes on as since its first job of this run."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._phase = ""
        self._of = 0
        self._first = 0
        self._done = 0
        self._begun = clock()

    def words(self, phase: str, done: int, of: int) -> str:
        """The time left, or nothing where it isn't known yet."""
        now = self._clock()
        if (phase, of) != (self._phase, self._of) or done < self._done:
            self._phase = phase
            self._of = of
            self._first = done
            self._begun = now
        self._done = done
        if done in (self._first, of):
            return ""
        return (
            f", about {_rounded((now - self._begun) * (of - done) / (done - self._first))} "
            "for the others"
        )


def _rounded(seconds: float) -> str:
    """A duration as people say it."""
    for unit, name in ((3600.0, "h"), (60.0, "min")):
        if seconds >= 1.5 * unit:
            return f"{seconds / unit:.0f} {name}"
    return f"{max(seconds, 1.0):.0f} s"


def add_study(parser: argparse.ArgumentParser, folder: str) -> None:
    """SETTINGS.yaml, -o, --workers, --scheduler and --example."""
    parser.add_argument("settings", nargs="?", metavar="SETTINGS.yaml", help="what is asked")
    parser.add_argument(
        "-o", "--output", default=folder, metavar="FOLDER", help=f"results ({folder})"
    )
    words = f"processes, 1 to {MOST_WORKERS} (as many as cores)"
    parser.add_argument("--workers", type=int, default=0, metavar="N", help=words)
    words = "of a Dask cluster that makes the jobs instead, as tcp://127.0.0.1:8786"
    parser.add_argument("--scheduler", default="", metavar="ADDRESS", help=words)
    parser.add_argument(
        "--example", action="store_true", help="print a settings file with all keys, and end"
    )


def settings_of(arguments: argparse.Namespace, command: str) -> str:
    """The settings file. InputError where none is named."""
    if arguments.settings is None:
        raise InputError(f"SETTINGS.yaml is missing: {command} --example prints one")
    return str(arguments.settings)


def studied(arguments: argparse.Namespace, make: Callable[[Means], Made]) -> Made:
    """What `make` returns, with a line that says how far it is."""
    made = [0, 0]
    left = TimeLeft()
    if not 0 <= arguments.workers <= MOST_WORKERS:
        raise InputError(f"--workers is {arguments.workers}: it must be in 1 .. {MOST_WORKERS}")

    def show(phase: str, done: int, of: int, best: str) -> None:
        made[:] = done, of
        line.show(f"{best}; {phase}" if best else phase, done, of, 0.0, left.words(phase, done, of))

    try:
        with ProgressLine() as line:
            return make(Means(arguments.workers, arguments.scheduler, show))
    except KeyboardInterrupt:
        with suppress(BrokenPipeError):
            done = f" after {made[0]} of {made[1]}" if made[1] else ""
            sys.stderr.write(f"stopped{done}: the same command goes on from there\n")
        raise
