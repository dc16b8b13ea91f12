"""The whole arena: what is not yet in the folder is run, then table, database and page are written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from ir_studies.arena.entries import Entry, entries
from ir_studies.arena.outputs import write_outputs
from ir_studies.arena.pool import COMMAND, Pool
from ir_studies.arena.results import Results
from ir_studies.arena.settings import ArenaSettings
from ir_studies.arena.table import Run
from ir_studies.errors import StudyError

Progress = Callable[[int, int, Entry], None]


@dataclass(frozen=True)
class Finished:
    """Runs in the order of the settings, and the files that were written."""

    runs: tuple[Run, ...]
    files: tuple[Path, ...]


def run_arena(
    settings: ArenaSettings,
    folder: str | Path,
    workers: int = 1,
    progress: Progress = lambda done, of, entry: None,
    *,
    parquet: bool = False,
    command: Sequence[str] = COMMAND,
) -> Finished:
    """Run what the folder has no result of, with so many processes; interrupted, it goes on where it ended.

    Raises StudyError. progress: called with the number of runs made, that of all, and the last one.
    """
    if parquet and find_spec("pyarrow") is None:
        raise StudyError("a Parquet file needs pyarrow: pip install pyarrow")
    wanted = entries(settings)
    with Results(Path(folder), settings) as results:
        missing = [entry for entry in wanted if entry.key not in results.rows]
        done = len(wanted) - len(missing)
        for entry, row in Pool(settings, workers, command).rows(missing):
            results.add(entry, row)
            done += 1
            progress(done, len(wanted), entry)
        runs = tuple(Run(entry, results.rows[entry.key]) for entry in wanted)
    return Finished(runs, write_outputs(runs, settings, Path(folder), parquet=parquet))
