"""What an arena asks in a cell: its tasks, there and back."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ir_description import Cell
from ir_msgs_py.arrays import FloatArray


def tasks_of(cell: Cell) -> Mapping[str, tuple[FloatArray, FloatArray]]:
    """Ends (n,) of every task, there and back: home->p1 and p1->home."""
    found: dict[str, tuple[FloatArray, FloatArray]] = {}
    for task in cell.tasks:
        start, goal = np.array(task.start), np.array(task.goal)
        first, _, last = task.name.partition("->")
        found[task.name] = start, goal
        found[f"{last}->{first}" if last else f"{task.name} back"] = goal, start
    return found
