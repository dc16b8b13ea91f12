"""The runs of an arena: every planner on every task with every seed, in an order that treats all
alike.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass

from ir_description import load_cell
from ir_studies.arena.settings import MOST_RUNS, ArenaSettings
from ir_studies.arena.tasks import tasks_of
from ir_studies.errors import SettingsError
from ir_studies.work import Job


@dataclass(frozen=True)
class Entry:
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


def entries(settings: ArenaSettings) -> list[Entry]:
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


def _entries(settings: ArenaSettings, tasks: Mapping[str, list[str]]) -> Iterator[Entry]:
    for seed in range(settings.seeds):
        for cell, names in tasks.items():
            for task in names:
                for load in settings.loads:
                    for timing in settings.timings:
                        for planner in settings.planners:
                            yield Entry(planner, cell, task, seed, load, timing)
