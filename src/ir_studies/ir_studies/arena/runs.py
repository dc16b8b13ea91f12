"""An arena from its settings to its files; interrupted, it goes on where it ended."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path

from ir_studies.arena.figures import ArenaRun, asked_alike, blocked_and_free, figures
from ir_studies.arena.planner_arena_database import write_outputs, write_settings
from ir_studies.arena.settings import ArenaEntry, ArenaSettings, entries, read_by
from ir_studies.errors import StoppedError, StudyError, WorkerError
from ir_studies.work import Means, Results, StudyJob

_COLUMNS = (
    "planner",
    "solved",
    "count",
    "first",
    "final",
    "cost_ratio",
    "duration",
    "energy",
    "lost",
)


@dataclass(frozen=True)
class FinishedArena:
    """Runs in the order of the settings, the files that were written, and what to know of them."""

    runs: tuple[ArenaRun, ...]
    files: tuple[Path, ...]
    remark: str = ""

    @property
    def summary(self) -> str:
        """How many were solved, in a sentence."""
        said = f"{sum(run.solved for run in self.runs)} of {len(self.runs)} runs solved"
        return f"{said}. {self.remark}" if self.remark else said

    @property
    def summed_up(self) -> str:
        """A row of CSV per planner: of the questions whose straight movement is blocked, then of
        the free.
        """
        lines = [",".join(("free_ptp", *_COLUMNS))]
        for free, own in enumerate(blocked_and_free(self.runs)):
            for planner in dict.fromkeys(run.entry.planner for run in own):
                found = figures(planner, own)
                lines.append(
                    ",".join(str(value) for value in (free, *(getattr(found, n) for n in _COLUMNS)))
                )
        return "\n".join(lines) + "\n"


def run_arena(
    settings: ArenaSettings,
    folder: str | Path,
    means: Means | None = None,
    *,
    parquet: bool = False,
) -> FinishedArena:
    """Run what the folder has no result of; interrupted, it writes what is known so far, and goes
    on from there the next time. Raises StudyError.
    """
    if parquet and find_spec("pyarrow") is None:
        raise StudyError("a Parquet file needs pyarrow: pip install pyarrow")
    means = means or Means()
    wanted = {entry.key: entry for entry in entries(settings)}
    read = read_by(settings.cells)
    task = StudyJob(
        "arena", {**asdict(settings), "read": read}, settings.seconds + settings.hang_after
    )
    with Results(Path(folder), "arena", settings.budget, read) as results:
        kept = write_settings(settings, Path(folder))
        missing = [entry.job for entry in wanted.values() if entry.key not in results.rows]
        begin = time.monotonic()
        before = len(wanted) - len(missing)

        def write() -> FinishedArena:
            known = [
                ArenaRun(entry, results.rows[k]) for k, entry in wanted.items() if k in results.rows
            ]
            runs = asked_alike(known)
            if not runs:
                return FinishedArena((), (kept,))
            written = write_outputs(
                runs, settings, Path(folder), len(wanted) - len(runs), parquet=parquet
            )
            return FinishedArena(runs, (*written, kept), results.remark)

        with _written_when_stopped(write), means.makers(task) as makers:
            for made, (job, row) in enumerate(makers.rows(missing), 1):
                results.add(job, row)
                left = (time.monotonic() - begin) / made * (len(missing) - made)
                means.progress(_words(wanted[job.key], left), before + made, len(wanted), "")
        return write()


@contextmanager
def _written_when_stopped(write: Callable[[], object]) -> Iterator[None]:
    """Where what is done inside is stopped, what is known so far is written before that goes on."""
    try:
        yield
    except (KeyboardInterrupt, StoppedError, WorkerError):
        write()
        raise


def _words(entry: ArenaEntry, left: float) -> str:
    cell = Path(entry.cell).name
    return f"{minutes(left)} left; {cell} {entry.task} by {entry.planner}, seed {entry.seed}: run"


def minutes(value: float) -> str:
    """Seconds as a person plans with them: 50 s, 12 min, 3.5 h."""
    if value < 99.5:
        return f"{value:.0f} s"
    return f"{value / 60.0:.0f} min" if value < 5_970.0 else f"{value / 3600.0:.1f} h"
