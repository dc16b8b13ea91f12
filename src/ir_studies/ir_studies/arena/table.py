"""Runs as a table: one row each, SI units, the unit in each name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

from ir_studies.arena.entries import Entry
from ir_studies.work import Row

NUMBERS = (
    "first_path_s", "first_s", "final_s", "duration_s", "energy_j", "drives_j", "cost_j", "movement_cost",  # noqa: E501
    "clearance_m", "safety_distance_m", "total_s",
)  # fmt: skip
TIMES = ("first_path_s", "first_s", "final_s", "total_s")
"""Columns that a clock wrote: where work ends a run, all others come again with the same seed."""
TEXTS = ("outcome", "message", "trajectory_id")
Cell = str | float | int


@dataclass(frozen=True)
class Run:
    """An entry with its row."""

    entry: Entry
    row: Row

    @property
    def solved(self) -> bool:
        """Whether a certified trajectory was found."""
        return bool(self.row.get("solved", False))

    @property
    def free_ptp(self) -> bool:
        """Whether the straight movement was free."""
        return bool(self.row.get("free_ptp", False))

    def number(self, name: str) -> float:
        """A figure, NaN where there is none."""
        value = self.row.get(name, math.nan)
        return float(value) if isinstance(value, int | float) else math.nan

    @property
    def progress(self) -> list[tuple[float, float]]:
        """Seconds and J of each answer that was better than those before."""
        found = self.row.get("progress", [])
        return [(pair[0], pair[1]) for pair in found] if isinstance(found, list) else []


def asked_alike(runs: Sequence[Run]) -> tuple[Run, ...]:
    """The runs, where one that was cut or died knows from others of its question whether the
    straight movement is free.
    """
    free = {run.entry.question for run in runs if run.free_ptp}
    return tuple(
        replace(run, row={**run.row, "free_ptp": True}) if run.entry.question in free else run
        for run in runs
    )


def columns(runs: Sequence[Run]) -> dict[str, list[Cell]]:
    """The table by its columns."""
    rows = [_cells(run) for run in runs]
    return {name: [row[name] for row in rows] for name in _cells(runs[0])} if rows else {}


def _cells(run: Run) -> dict[str, Cell]:
    return {
        **asdict(run.entry),
        "free_ptp": int(run.free_ptp),
        "solved": int(run.solved),
        **{name: run.number(name) for name in NUMBERS},
        "requests": int(run.number("requests")) if "requests" in run.row else 0,
        "truncated": int(bool(run.row.get("truncated", False))),
        **{name: str(run.row.get(name, "")) for name in TEXTS},
    }
