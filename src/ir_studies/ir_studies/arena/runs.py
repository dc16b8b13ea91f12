"""An arena from its settings to its files; interrupted, it goes on where it ended."""

from __future__ import annotations

import json
import os
import platform
import sqlite3
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path

from ir_recorder.report.files import write_output
from ir_recorder.report.step_table import PARQUET_START, write_columns
from ir_studies.arena.figures import ArenaRun, asked_alike, blocked_and_free, columns, figures
from ir_studies.arena.page import write_page
from ir_studies.arena.settings import (
    FORMAT,
    ArenaEntry,
    ArenaSettings,
    entries,
    read_by,
    read_settings,
    settings_text,
)
from ir_studies.errors import SettingsError, StoppedError, StudyError
from ir_studies.work import Means, Results, StudyJob
from ir_values.files import ANYWHERE

# Files of an arena: table, page, and a database of Planner Arena as OMPL's scripts write it.

_TABLES = """
CREATE TABLE experiments (id INTEGER PRIMARY KEY AUTOINCREMENT, name VARCHAR(512), totaltime REAL,
  timelimit REAL, memorylimit REAL, runcount INTEGER, version VARCHAR(128), hostname VARCHAR(1024),
  cpuinfo TEXT, date DATETIME, seed VARCHAR(24), setup TEXT);
CREATE TABLE plannerConfigs (id INTEGER PRIMARY KEY AUTOINCREMENT, name VARCHAR(512) NOT NULL, settings TEXT);
CREATE TABLE enums (name VARCHAR(512), value INTEGER, description TEXT, PRIMARY KEY (name, value));
CREATE TABLE runs (id INTEGER PRIMARY KEY AUTOINCREMENT, experimentid INTEGER, plannerid INTEGER,
  time REAL, solved BOOLEAN, correct_solution BOOLEAN, time_to_first_solution REAL, solution_cost REAL,
  solution_duration REAL, solution_energy REAL, movement_cost REAL, solution_clearance REAL, free_ptp BOOLEAN,
  iterations INTEGER, status ENUM,
  FOREIGN KEY (experimentid) REFERENCES experiments(id) ON DELETE CASCADE,
  FOREIGN KEY (plannerid) REFERENCES plannerConfigs(id) ON DELETE CASCADE);
CREATE TABLE progress (runid INTEGER, time REAL, best_cost REAL, PRIMARY KEY (runid, time),
  FOREIGN KEY (runid) REFERENCES runs(id) ON DELETE CASCADE);
CREATE VIEW bestPlannerConfigsPerExperiment AS
  SELECT plannerid, experimentid, AVG(solved) AS avg_solved, AVG(time) AS avg_total_time
  FROM runs GROUP BY plannerid, experimentid ORDER BY avg_solved DESC, avg_total_time;
CREATE VIEW bestPlannerConfigs AS
  SELECT plannerid, AVG(solved) AS avg_solved, AVG(time) AS avg_total_time
  FROM runs GROUP BY plannerid ORDER BY avg_solved DESC, avg_total_time;
"""  # noqa: E501
_STATUS = ("answered", "died", "cut")


def write_database(runs: Sequence[ArenaRun], settings: ArenaSettings, path: Path) -> Path:
    """Write the database in place of an earlier one. StudyError where that can't be done."""
    part = path.with_name(path.name + ".part")
    try:
        part.unlink(missing_ok=True)
        with closing(sqlite3.connect(part)) as database, database:
            database.executescript(_TABLES)
            database.executemany(
                "INSERT INTO enums VALUES ('status', ?, ?)", list(enumerate(_STATUS))
            )
            _fill(database, runs, settings)
        os.replace(part, path)
    except (OSError, sqlite3.Error) as error:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise StudyError(f"{path} can't be written: {error}") from error
    return path


def _fill(database: sqlite3.Connection, runs: Sequence[ArenaRun], settings: ArenaSettings) -> None:
    planners: dict[str, int] = {}
    for name in settings.planners:
        words = "INSERT INTO plannerConfigs (name, settings) VALUES (?, '')"
        planners[name] = int(database.execute(words, (name,)).lastrowid or 0)
    by_question: dict[tuple[str, ...], list[ArenaRun]] = {}
    for run in runs:
        by_question.setdefault(run.entry.question, []).append(run)
    for question, own in by_question.items():
        experiment = _experiment(database, question, own, settings)
        for run in own:
            _insert(database, run, experiment, planners[run.entry.planner])


def _experiment(
    database: sqlite3.Connection,
    question: Iterable[str],
    runs: Sequence[ArenaRun],
    settings: ArenaSettings,
) -> int:
    total = sum(run.number("total_s") for run in runs if run.number("total_s") > 0.0)
    values = (
        " ".join(part for part in question if part), total, settings.seconds, 0.0, settings.seeds,
        "ir_studies 0.1.0", platform.node(), platform.processor(),
        datetime.now(UTC).isoformat(" ", "seconds"), "0", json.dumps(settings.budget),
    )  # fmt: skip
    words = (
        "INSERT INTO experiments (name, totaltime, timelimit, memorylimit, runcount, version, "
        "hostname, cpuinfo, date, seed, setup) VALUES (?,?,?,?,?,?,?,?,?,?,?)"
    )
    return int(database.execute(words, values).lastrowid or 0)


def _insert(database: sqlite3.Connection, run: ArenaRun, experiment: int, planner: int) -> None:
    """Put a run and its progress into the database."""
    outcome = str(run.row.get("outcome", _STATUS[0]))
    figures = [
        run.number(name)
        for name in ("first_s", "cost_j", "duration_s", "energy_j", "movement_cost", "clearance_m")
    ]
    values = (
        experiment, planner, run.number("total_s"), run.solved, run.solved, *figures, run.free_ptp,
        int(run.number("requests")) if "requests" in run.row else 0, _STATUS.index(outcome),
    )  # fmt: skip
    words = (
        "INSERT INTO runs (experimentid, plannerid, time, solved, correct_solution, "
        "time_to_first_solution, solution_cost, solution_duration, solution_energy, "
        "movement_cost, solution_clearance, free_ptp, iterations, status) VALUES "
        f"({','.join('?' * 14)})"
    )
    key = database.execute(words, values).lastrowid
    database.executemany(
        "INSERT OR REPLACE INTO progress VALUES (?, ?, ?)",
        [(key, at, cost) for at, cost in run.progress],
    )


_CSV_START = b"planner,"


def write_outputs(
    runs: Sequence[ArenaRun],
    settings: ArenaSettings,
    folder: Path,
    missing: int = 0,
    *,
    parquet: bool,
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
    except (KeyboardInterrupt, StoppedError, StudyError):
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
