"""Files of an arena: table, page, and a database of Planner Arena as OMPL's scripts write it."""

from __future__ import annotations

import json
import os
import platform
import sqlite3
from collections.abc import Iterable, Sequence
from contextlib import closing, suppress
from datetime import UTC, datetime
from pathlib import Path

from ir_recorder.report.files import write_output
from ir_recorder.report.step_table import PARQUET_START, write_columns
from ir_studies.arena.figures import ArenaRun, columns
from ir_studies.arena.page import write_page
from ir_studies.arena.settings import FORMAT, ArenaSettings, read_settings, settings_text
from ir_studies.errors import FolderError, SettingsError
from ir_values.files import ANYWHERE

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
    """Write the database in place of an earlier one. FolderError where that can't be done."""
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
        raise FolderError(f"{path} can't be written: {error}") from error
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
