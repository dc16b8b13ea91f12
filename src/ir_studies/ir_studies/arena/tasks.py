"""What an arena asks in a cell: its tasks, there and back."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from ir_description import Cell, cell_hash, load_cell
from ir_msgs_py.arrays import FloatArray
from ir_studies.work.read_files import task_digests


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
