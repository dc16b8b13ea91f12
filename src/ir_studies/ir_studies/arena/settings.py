"""Settings of an arena from a YAML file, and the runs that follow from them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ir_description import Cell, DescriptionError, cell_hash, is_path, load_cell, load_power_data
from ir_msgs_py.options import ROBOTS_TIME_VALUE, TIMINGS
from ir_planner import PlannerError
from ir_planner.scene import scene_with
from ir_planner.search import SEARCHES, not_installed
from ir_studies.errors import SettingsError
from ir_studies.work import (
    Job,
    Placed,
    beside,
    checked_known,
    checked_numbers,
    read_text,
    settings_values,
)
from ir_studies.work.results import task_digests
from ir_values.arrays import FloatArray

# Tasks of a cell, there and back.


def tasks_of(cell: Cell) -> Mapping[str, tuple[FloatArray, FloatArray]]:
    """Ends (n,) of every task, there and back: home->p1 and p1->home, or where the cell has another
    task of that name, home->p1 back.
    """
    found: dict[str, tuple[FloatArray, FloatArray]] = {}
    named = {task.name for task in cell.tasks}
    for task in cell.tasks:
        start = np.array(task.start)
        goal = np.array(task.goal)
        first, _, last = task.name.partition("->")
        back = f"{last}->{first}"
        found[task.name] = start, goal
        found[back if last and back not in named else f"{task.name} back"] = goal, start
    return found


def read_by(names: Iterable[str]) -> dict[str, str]:
    """Digests of the cells, and of their tasks."""
    found: dict[str, str] = {}
    for name in names:
        cell = load_cell(name)
        found |= {name: cell_hash(cell), **task_digests(name, cell)}
    return found


FORMAT = "ir_arena/1"
PORTFOLIO = "portfolio"
"""The name of an empty planner_id."""
MOST_RUNS = 1_000_000

EXAMPLE = """\
format: ir_arena/1
planners: [portfolio, genetic, tree, sbl, kpiece, bkpiece, lbkpiece, prm, rrt, rrt_connect, aorrtc]
cells: [open, table_columns, cnc_door, deep_box]   # bundled, or files
tasks: []                    # names as home->p1; [] is all of them, there and back
seeds: 10
loads: [""]                  # what is attached: "" is the tool of the cell, none nothing
timings: [synchronous]       # and asynchronous
seconds: 1.0                 # of processor per run: the planner is asked again, with other seeds
requests: 0                  # per run at most; 0: as many as the seconds hold
max_iterations: 0            # work of the first request of a run; 0: the planner's default
further_iterations: 100000000   # of its other requests, for who can make better answers of it; 0: the same
safety_distance: 0.02        # m; less where an end of the task is nearer
time_value: 500.0            # W in J = energy of the drives + time_value x T; left out: each robot's own
hang_after: 60.0             # s of the wall beyond `seconds` after which a run is cut
"""  # noqa: E501


@dataclass(frozen=True)
class ArenaSettings:
    """The axes of the comparison, and what each run may cost; EXAMPLE says what each means."""

    cells: tuple[str, ...]
    planners: tuple[str, ...] = (PORTFOLIO,)
    tasks: tuple[str, ...] = ()
    seeds: int = 10
    loads: tuple[str, ...] = ("",)
    timings: tuple[str, ...] = ("synchronous",)
    seconds: float = 1.0
    requests: int = 0
    max_iterations: int = 0
    further_iterations: int = 100_000_000
    safety_distance: float = 0.02
    time_value: float = ROBOTS_TIME_VALUE
    hang_after: float = 60.0

    def __post_init__(self) -> None:
        for name in ("cells", "planners", "loads", "timings", "tasks"):
            _check_names(name, getattr(self, name), may_be_empty=name == "tasks")
        checked_known("planners", self.planners, (PORTFOLIO, *SEARCHES))
        checked_known("timings", self.timings, TIMINGS)
        priced = self.time_value != ROBOTS_TIME_VALUE
        checked_numbers(self, _WHOLE, (*_REAL, _PRICE) if priced else _REAL)
        lacking: dict[str, list[str]] = {}
        for name in self.planners:
            if name in SEARCHES:
                lacking.setdefault(not_installed(SEARCHES[name]), []).append(name)
        for how, names in lacking.items():
            if how:
                raise SettingsError(f"planners: {', '.join(names)}: {how}")
        self._check_cells()

    @property
    def budget(self) -> dict[str, Any]:
        """What the results of a run depend on beside the axes."""
        axes = ("cells", "planners", "tasks", "seeds", "loads", "timings", "hang_after")
        kept = {name: value for name, value in asdict(self).items() if name not in axes}
        if not self.further_iterations:
            del kept["further_iterations"]  # as results that were made before there was such a key
        return {**kept, "clock": "processor"}

    def work_of(self, request: int) -> int:
        """What a request of a run may cost, counted from 0; 0: the planner's default."""
        return (request and self.further_iterations) or self.max_iterations

    def _check_cells(self) -> None:
        known_tasks: list[str] = []
        for name in self.cells:
            try:
                cell = load_cell(name)
                for load in filter(None, self.loads):
                    scene_with(cell, load, load_power_data())
            except (DescriptionError, PlannerError, OSError) as error:
                raise SettingsError(f"cells: {name!r:.200}: {error}") from error
            if not cell.tasks:
                raise SettingsError(f"cells: {name!r:.200} has no tasks")
            known_tasks += tasks_of(cell)
        checked_known("tasks", self.tasks, known_tasks)


_WHOLE = (
    ("seeds", 1, 100_000),
    ("requests", 0, 1_000_000),
    ("max_iterations", 0, 2**32 - 1),
    ("further_iterations", 0, 2**32 - 1),
)
_REAL = (
    ("seconds", 0.01, 86_400.0),
    ("safety_distance", 0.0, 1.0),
    ("hang_after", 1.0, 86_400.0),
)
_PRICE = ("time_value", 0.0, 1e6)


def read_settings(path: str | Path) -> ArenaSettings:
    """The settings of a YAML file; cell files count from its folder. SettingsError names the
    key.
    """
    content = read_text(path)
    try:
        return arena_settings(content, beside(path))
    except SettingsError as error:
        raise SettingsError(f"{path}: {error}") from error


def settings_text(settings: ArenaSettings, folder: Path | None = None) -> str:
    """A settings file with all keys; cell files as seen from a folder, None: by their whole
    paths.
    """
    values = {key: list(v) if isinstance(v, tuple) else v for key, v in asdict(settings).items()}
    if folder is not None:
        values["cells"] = [os.path.relpath(c, folder) if is_path(c) else c for c in settings.cells]
    lines = {"format": FORMAT, **values}
    return yaml.safe_dump(
        lines, sort_keys=False, default_flow_style=None, allow_unicode=True, width=100
    )


def arena_settings(content: str, placed: Placed) -> ArenaSettings:
    """The settings of a text. placed: where cells are; files are known by their whole paths,
    however and from wherever they are named. Raises SettingsError for settings that make no sense.
    """
    values = settings_values(content, FORMAT, [field.name for field in fields(ArenaSettings)])
    if "cells" not in values:
        raise SettingsError("cells are missing: names of bundled cells, or files")
    if isinstance(values["cells"], tuple):
        values["cells"] = tuple(
            _whole_path(placed(n)) if isinstance(n, str) else n for n in values["cells"]
        )
    return ArenaSettings(**values)


def _whole_path(name: str) -> str:
    return os.path.abspath(name) if is_path(name) else name


def _check_names(key: str, names: Any, *, may_be_empty: bool) -> None:
    if not isinstance(names, tuple) or not all(isinstance(name, str) for name in names):
        raise SettingsError(f"{key} is {names!r:.60}: it must be a list of names")
    if not names and not may_be_empty:
        raise SettingsError(f"{key} is empty")
    if len(set(names)) < len(names):
        raise SettingsError(f"{key} names one twice")


# Runs: every planner on every task with every seed, in an order that treats all alike.


@dataclass(frozen=True)
class ArenaEntry:
    """One run: a planner, a task of a cell as start->goal, a seed, what is attached, and the
    timing.
    """

    planner: str
    cell: str
    task: str
    seed: int
    load: str
    timing: str

    @property
    def key(self) -> str:
        """What it is known by in the results."""
        return "|".join(str(value) for value in asdict(self).values())

    @property
    def job(self) -> Job:
        """What a worker is given of it."""
        return Job(self.key, asdict(self))

    @property
    def question(self) -> tuple[str, str, str, str]:
        """What all planners and seeds are asked alike."""
        return self.cell, self.task, self.load, self.timing


def entries(settings: ArenaSettings) -> list[ArenaEntry]:
    """All runs; planners change fastest and seeds slowest, so that what is there early is a fair
    part.
    """
    tasks = {cell: _chosen(cell, settings.tasks) for cell in settings.cells}
    count = settings.seeds * sum(map(len, tasks.values()))
    count *= len(settings.loads) * len(settings.timings) * len(settings.planners)
    if count > MOST_RUNS:
        days = count * settings.seconds / 86_400.0
        raise SettingsError(
            f"these are {count} runs, {days:.1f} days of one core: at most {MOST_RUNS} are made"
        )
    return list(_entries(settings, tasks))


def _chosen(cell: str, names: tuple[str, ...]) -> list[str]:
    return [name for name in tasks_of(load_cell(cell)) if not names or name in names]


def _entries(settings: ArenaSettings, tasks: Mapping[str, list[str]]) -> Iterator[ArenaEntry]:
    for seed in range(settings.seeds):
        for cell, names in tasks.items():
            for task in names:
                for load in settings.loads:
                    for timing in settings.timings:
                        for planner in settings.planners:
                            yield ArenaEntry(planner, cell, task, seed, load, timing)
