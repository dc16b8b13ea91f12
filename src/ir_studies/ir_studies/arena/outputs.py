"""What an arena leaves behind: its settings, the table, the database of Planner Arena, the page."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from ir_msgs_py.file_roots import ANYWHERE
from ir_recorder.report.files import write_output
from ir_recorder.report.step_table import PARQUET_START, write_columns
from ir_studies.arena.page import write_page
from ir_studies.arena.planner_arena import write_database
from ir_studies.arena.settings import FORMAT, ArenaSettings, read_settings, settings_text
from ir_studies.arena.table import Run, columns
from ir_studies.errors import SettingsError

_CSV_START = b"planner,"


def write_outputs(
    runs: Sequence[Run], settings: ArenaSettings, folder: Path, missing: int = 0, *, parquet: bool
) -> tuple[Path, ...]:
    """Write table.csv, table.parquet where that is asked for, arena.db and index.html. missing:
    runs that were not made yet.

    Raises RecorderError for files that can't be written, or replaced.
    """
    table = columns(runs)
    written = [write_columns(table, folder / "table.csv", _CSV_START, ANYWHERE)]
    if parquet:
        written.append(write_columns(table, folder / "table.parquet", PARQUET_START, ANYWHERE))
    written.append(write_database(runs, settings, folder / "arena.db").absolute())
    written.append(write_page(runs, settings, folder / "index.html", missing))
    return tuple(written)


def write_settings(settings: ArenaSettings, folder: Path) -> Path:
    """Write settings.yaml, with which the same arena is run again; one that says the same stays as
    it is. RecorderError for a file that can't be written, or is something else.
    """
    path = folder / "settings.yaml"
    with suppress(SettingsError):
        if read_settings(path) == settings:
            return path.absolute()
    content = settings_text(settings, folder.absolute())
    return write_output(path, content.encode(), f"format: {FORMAT}".encode(), ANYWHERE)
