"""What makes the runs of an arena: cells, models and OMPL are loaded before the first of them is
timed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import Any

from ir_msgs_py.options import PlanOptions
from ir_planner import Goal, Planner, PlannerError
from ir_planner.search.with_ompl import charge_to
from ir_studies.arena.entries import Entry
from ir_studies.arena.one_run import one_run
from ir_studies.arena.processor_time import charged, excuse, others_time, processor_time
from ir_studies.arena.settings import PORTFOLIO, ArenaSettings
from ir_studies.arena.tasks import read_by, tasks_of
from ir_studies.work import Row
from ir_studies.work.read_files import refuse_others

_STARTS = 2  # looks at what it takes to start a process of OMPL, after the first, which loads it


def maker(settings: Mapping[str, Any]) -> Callable[[Mapping[str, Any]], Row]:
    """Rows of entries, with everything loaded that is loaded once; `read` of the settings: what
    must be the same here. WorkerError where it is not.
    """
    read: dict[str, Any] = {  # JSON knows no tuples
        key: tuple(value) if isinstance(value, list) else value for key, value in settings.items()
    }
    given = read.pop("read", {})
    arena = ArenaSettings(**read)
    refuse_others(given, read_by(arena.cells) if given else {})
    charge_to(charged)
    excuse(0.0)
    warm_up(arena)
    few = replace(arena, cells=arena.cells[:1], loads=arena.loads[:1], tasks=())
    start = min(warm_up(few) for _ in range(_STARTS))
    excuse(start)

    def row_of(words: Mapping[str, Any]) -> Row:
        entry = Entry(**words)
        return {**one_run(entry, arena, planner_of(entry.cell), processor_time), "start_s": start}

    return row_of


def warm_up(settings: ArenaSettings) -> float:
    """What is loaded once is loaded before anything is timed: cells, models with every load, OMPL.
    The least that a process of OMPL ran [s] for a question with next to nothing to check: what it
    takes to start one.
    """
    least = math.inf
    for cell in settings.cells:
        planner = planner_of(cell)
        start, there = next(iter(tasks_of(planner.cell).values()))
        goal = Goal(configuration=start + 1e-3 * (there - start))
        for load in settings.loads:
            for name in settings.planners:
                planner_id = "" if name == PORTFOLIO else name
                options = PlanOptions(
                    planner_id=planner_id,
                    max_iterations=10,
                    planning_time=120.0,
                    safety_distance=0.0,  # an end of a task may be near something
                    load=load,
                )
                begin = others_time()
                with suppress(PlannerError):
                    planner.plan_regional(start, goal, options)
                if others_time() > begin:
                    least = min(least, others_time() - begin)
    return least if math.isfinite(least) else 0.0


@cache
def planner_of(cell: str) -> Planner:
    """One planner per cell."""
    planner = Planner(processor_time)
    planner.set_cell("", cell)
    return planner
