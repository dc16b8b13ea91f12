"""The process that makes runs: settings and entries in as lines of JSON, one row out for each."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np

from ir_msgs_py.options import PlanOptions
from ir_planner import Goal, Planner, PlannerError
from ir_planner.search import SEARCHES
from ir_planner.search.with_ompl import needs_ompl
from ir_studies.arena.entries import Entry, tasks_of
from ir_studies.arena.one_run import Row, one_run
from ir_studies.arena.settings import PORTFOLIO, ArenaSettings

READY = {"ready": True}


def main() -> None:
    """Serve until the input ends. What libraries print goes to stderr."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for who started it, who closes the input
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    with suppress(BrokenPipeError):
        settings = _settings(json.loads(sys.stdin.readline()))
        warm_up(settings)
        answers.write(json.dumps(READY) + "\n")
        for line in sys.stdin:
            answers.write(json.dumps(row_of(Entry(**json.loads(line)), settings)) + "\n")


def _settings(read: dict[str, Any]) -> ArenaSettings:
    """From JSON, which knows no tuples."""
    values: dict[str, Any] = {
        key: tuple(value) if isinstance(value, list) else value for key, value in read.items()
    }
    return ArenaSettings(**values)


def row_of(entry: Entry, settings: ArenaSettings) -> Row:
    """The row of a run; what the planner refuses is a row too."""
    try:
        return one_run(entry, settings, planner_of(entry.cell), time.monotonic)
    except PlannerError as error:
        return {"solved": False, "message": str(error)}


def warm_up(settings: ArenaSettings) -> None:
    """What is loaded once is loaded before anything is timed: cells, models, OMPL."""
    for cell in settings.cells:
        planner = planner_of(cell)
        start = next(iter(tasks_of(planner.cell).values()))[0]
        for name in settings.planners:
            if name == PORTFOLIO or needs_ompl(SEARCHES[name]):
                planner_id = "" if name == PORTFOLIO else name
                options = PlanOptions(planner_id=planner_id, max_iterations=10, planning_time=120.0)
                with suppress(PlannerError):
                    goal = start + np.eye(len(start))[0] * 1e-3
                    planner.plan_regional(start, Goal(configuration=goal), options)


@cache
def planner_of(cell: str) -> Planner:
    """One planner per cell."""
    planner = Planner(time.monotonic)
    planner.set_cell("", cell)
    return planner


if __name__ == "__main__":
    main()
