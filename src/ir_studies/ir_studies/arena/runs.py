"""The whole arena: what is not yet in the folder is run, then table, database and page are written."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path

from ir_description import cell_hash, load_cell
from ir_studies.arena.entries import Entry, entries
from ir_studies.arena.figures import figures
from ir_studies.arena.outputs import write_outputs
from ir_studies.arena.settings import ArenaSettings
from ir_studies.arena.table import Run
from ir_studies.errors import StudyError
from ir_studies.work import Means, Results, Task

_COLUMNS = ("planner", "solved", "count", "first", "final", "cost_ratio", "duration", "energy", "lost")


@dataclass(frozen=True)
class Finished:
    """Runs in the order of the settings, and the files that were written."""

    runs: tuple[Run, ...]
    files: tuple[Path, ...]

    @property
    def summary(self) -> str:
        """How many were solved, in a sentence."""
        return f"{sum(run.solved for run in self.runs)} of {len(self.runs)} runs solved"

    @property
    def summed_up(self) -> str:
        """A row of CSV per planner."""
        lines = [",".join(_COLUMNS)]
        for planner in dict.fromkeys(run.entry.planner for run in self.runs):
            found = figures(planner, self.runs)
            lines.append(",".join(str(getattr(found, name)) for name in _COLUMNS))
        return "\n".join(lines) + "\n"


def run_arena(
    settings: ArenaSettings,
    folder: str | Path,
    means: Means | None = None,
    *,
    parquet: bool = False,
) -> Finished:
    """Run what the folder has no result of; interrupted, it goes on where it ended. Raises StudyError."""
    if parquet and find_spec("pyarrow") is None:
        raise StudyError("a Parquet file needs pyarrow: pip install pyarrow")
    means = means or Means()
    wanted = {entry.key: entry for entry in entries(settings)}
    cells = {name: cell_hash(load_cell(name)) for name in settings.cells}
    task = Task("arena", asdict(settings), settings.seconds + settings.hang_after)
    with Results(Path(folder), "arena", settings.budget, cells) as results:
        missing = [entry.job for entry in wanted.values() if entry.key not in results.rows]
        done = len(wanted) - len(missing)
        with means.makers(task) as makers:
            for job, row in makers.rows(missing):
                results.add(job, row)
                done += 1
                means.progress(_words(wanted[job.key]), done, len(wanted), "")
        runs = tuple(Run(entry, results.rows[key]) for key, entry in wanted.items())
    return Finished(runs, write_outputs(runs, settings, Path(folder), parquet=parquet))


def _words(entry: Entry) -> str:
    return f"{entry.cell} {entry.task} by {entry.planner}, seed {entry.seed}: run"
