"""What rows depend on beside their settings: files that every worker reads, known by their
digests.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from hashlib import sha256

from ir_description import Cell, Task
from ir_studies.errors import WorkerError

PLANT = "plant "
TASK = "task "
TASKS = "tasks of "
"""Before the name of what is no cell."""
_CHARACTERS = 16  # of a digest


def task_digests(name: str, cell: Cell) -> dict[str, str]:
    """A digest for every task of a cell; cell_hash leaves them out."""
    return {f"{TASK}{task.name} of {name}": _digest([task]) for task in cell.tasks}


def digest_of_tasks(name: str, cell: Cell) -> dict[str, str]:
    """One digest for all tasks of a cell, for what depends on their number."""
    return {f"{TASKS}{name}": _digest(cell.tasks)}


def title(name: str) -> str:
    """What a name stands for."""
    return name if name.startswith((PLANT, TASK, TASKS)) else f"cell {name}"


def refuse_others(given: Mapping[str, str], found: Mapping[str, str]) -> None:
    """WorkerError where this process reads something else than the study: an older file, or an
    edited one.
    """
    for name, digest in given.items():
        if found.get(name) != digest:
            raise WorkerError(f"{title(name)} is not here what the study has read")


def _digest(tasks: Sequence[Task]) -> str:
    ends = [(task.name, task.start.tolist(), task.goal.tolist()) for task in tasks]
    return sha256(repr(ends).encode()).hexdigest()[:_CHARACTERS]
