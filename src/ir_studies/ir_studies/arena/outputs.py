"""What an arena leaves behind: the table, the database of Planner Arena, the page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ir_msgs_py.file_roots import ANYWHERE
from ir_recorder.report.step_table import PARQUET_START, write_columns
from ir_studies.arena.page import write_page
from ir_studies.arena.planner_arena import write_database
from ir_studies.arena.settings import ArenaSettings
from ir_studies.arena.table import Run, columns

_CSV_START = b"planner,"


def write_outputs(
    runs: Sequence[Run], settings: ArenaSettings, folder: Path, *, parquet: bool
) -> tuple[Path, ...]:
    """Write table.csv, table.parquet where that is asked for, arena.db and index.html.

    Raises RecorderError for files that can't be written, or replaced.
    """
    table = columns(runs)
    written = [write_columns(table, folder / "table.csv", _CSV_START, ANYWHERE)]
    if parquet:
        written.append(write_columns(table, folder / "table.parquet", PARQUET_START, ANYWHERE))
    written.append(write_database(runs, settings, folder / "arena.db").absolute())
    written.append(write_page(runs, settings, folder / "index.html"))
    return tuple(written)
