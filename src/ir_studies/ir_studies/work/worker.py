"""Worker process: the task in one line of JSON, then a job per line in, a row per line out."""

from __future__ import annotations

import json
import os
import signal
import sys
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib import import_module
from typing import Any

from ir_studies.work.job import REFUSED, Row
from ir_studies.work.lifeline import tie

READY = {"ready": True}
MAKERS = {
    "arena": "ir_studies.arena.one_run",
    "layout": "ir_studies.layout.search",
    "statistics": "ir_studies.statistics.runs",
}
"""Modules by kind of study; each has `row_maker(settings)`, which loads what is loaded once and
returns what makes a row of a job.
"""
Maker = Callable[[Mapping[str, Any]], Row]


def maker_of(kind: str, settings: Mapping[str, Any]) -> Maker:
    """What makes the jobs of a study."""
    make: Maker = import_module(MAKERS[kind]).row_maker(settings)
    return make


def main() -> None:
    """Serve until the input ends. What libraries print goes to stderr."""
    # Ctrl-C is for who started it, who closes the input
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tie()
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    with suppress(BrokenPipeError):
        task = json.loads(sys.stdin.readline())
        try:
            make = maker_of(task["kind"], task["settings"])
        except (
            Exception
        ) as error:  # whatever it is: who started this has a sentence for people, not a death
            traceback.print_exc()
            answers.write(json.dumps({REFUSED: str(error) or repr(error)}) + "\n")
            return
        answers.write(json.dumps(READY) + "\n")
        for line in sys.stdin:
            answers.write(json.dumps(make(json.loads(line))) + "\n")


if __name__ == "__main__":
    main()
