"""Runs that hang, die or are interrupted: the table is complete, and the same after a resume."""

from __future__ import annotations

import csv
import json
import sqlite3
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

from ir_description import cell_to_yaml, load_cell
from ir_studies import Means
from ir_studies.arena import ArenaSettings, read_settings, run_arena
from ir_studies.arena.figures import columns
from ir_studies.arena.runs import FinishedArena
from ir_studies.errors import StudyError
from ir_studies.work.results import NAME

Fought = Callable[..., FinishedArena]


def table(finished: FinishedArena) -> list[dict[str, str]]:
    """Rows of table.csv."""
    with finished.files[0].open() as file:
        return list(csv.DictReader(file))


def outcomes(finished: FinishedArena) -> dict[str, set[object]]:
    """What became of the runs, by planner."""
    return {
        planner: {run.row["outcome"] for run in finished.runs if run.entry.planner == planner}
        for planner in dict.fromkeys(run.entry.planner for run in finished.runs)
    }


def test_what_hangs_is_cut_and_what_dies_is_tried_once_more(fought: Fought) -> None:
    finished = fought("sbl", "tree", "prm")
    assert outcomes(finished) == {"sbl": {"answered"}, "tree": {"answered"}, "prm": {"died"}}
    assert [row["solved"] for row in table(finished)] == ["1", "1", "0"] * 2
    assert {run.row["message"] for run in finished.runs if not run.solved} == {
        "twice the process died"
    }
    hanging = fought("rrt", folder="hanging", hang_after=1.0)
    assert outcomes(hanging) == {"rrt": {"cut"}}
    assert [row["solved"] for row in table(hanging)] == ["0"] * 2
    assert {run.row["message"] for run in hanging.runs} == {"no answer within 1.01 s"}


def test_the_table_as_parquet_has_the_same_columns(fought: Fought) -> None:
    finished = fought("sbl", "prm", parquet=True)
    stored = parquet.read_table(finished.files[1]).to_pydict()
    np.testing.assert_equal(stored, columns(finished.runs))
    assert stored["solved"] == [1, 0] * 2


def test_interrupted_and_resumed_it_gives_the_same_table(fought: Fought, tmp_path: Path) -> None:
    made: list[str] = []

    def interrupt(phase: str, done: int, of: int, best: str) -> None:
        made.append(phase)
        if len(made) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fought("sbl", "genetic", seeds=4, progress=interrupt)
    page = (tmp_path / "out" / "index.html").read_text()  # of what there was when it was stopped
    assert "so far 3 of 8 runs" in page
    with (tmp_path / "out" / "table.csv").open() as rows:
        assert len(list(csv.DictReader(rows))) == 3
    with (tmp_path / "out" / NAME).open("ab") as file:  # as a line that power loss cut
        file.write(b'{"key": "sbl|open|home->p1|3||sync')
    again: list[str] = []
    resumed = fought(
        "sbl", "genetic", seeds=4, progress=lambda phase, done, of, best: again.append(phase)
    )
    assert len(again) == len(set(again)) == 8 - 3
    assert set(made).isdisjoint(again)
    whole = fought("sbl", "genetic", seeds=4, folder="other")
    assert table(resumed) == table(whole)


def test_more_seeds_and_planners_are_added_to_a_folder(fought: Fought) -> None:
    fought("sbl", seeds=1)
    again: list[str] = []
    finished = fought("sbl", "genetic", progress=lambda phase, done, of, best: again.append(phase))
    assert len(again) == 3
    assert len(finished.runs) == 4


def test_the_settings_in_the_folder_run_the_same_arena(
    fought: Fought, tmp_path: Path, command: tuple[str, ...]
) -> None:
    finished = fought("sbl", "genetic")
    kept = finished.files[-1]
    settings = read_settings(kept)
    assert (settings.planners, settings.seconds, settings.tasks) == (
        ("sbl", "genetic"),
        0.01,
        ("home->p1",),
    )
    again = run_arena(settings, tmp_path / "again", Means(2, command=command))
    assert table(again) == table(finished)
    kept.write_text(kept.read_text() + "# mine\n")
    fought("sbl", "genetic")
    assert kept.read_text().endswith("# mine\n")  # it says the same
    fought("sbl")
    assert read_settings(kept).planners == ("sbl",)


@pytest.mark.parametrize("name", ["my cell.yaml", "größer | <b>.yaml"])
def test_a_cell_file_is_known_from_wherever_it_is_named(
    tmp_path: Path, command: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    cells = tmp_path / "my cells"
    settings = tmp_path / "arena.yaml"
    cells.mkdir()
    (cells / name).write_text(cell_to_yaml(load_cell("open")))
    head = "format: ir_arena/1\nplanners: [sbl, prm]\ntasks: [home->p1]\nseeds: 2\nseconds: 0.01\n"
    settings.write_text(head + f'cells: ["my cells/{name}"]\n')
    monkeypatch.chdir(tmp_path)
    first = run_arena(read_settings("arena.yaml"), "out", Means(2, command=command))
    assert "<b>.yaml" not in (tmp_path / "out" / "index.html").read_text()
    monkeypatch.chdir(cells)
    made: list[str] = []
    means = Means(2, progress=lambda phase, done, of, best: made.append(phase), command=command)
    for path in (settings, Path("../arena.yaml"), first.files[-1]):
        assert table(run_arena(read_settings(path), tmp_path / "out", means)) == table(first)
    assert made == []


def test_a_cell_that_changed_between_two_runs_is_refused(
    tmp_path: Path, command: tuple[str, ...]
) -> None:
    file = tmp_path / "cell.yaml"
    settings = tmp_path / "arena.yaml"
    file.write_text(cell_to_yaml(load_cell("open")))
    settings.write_text(
        "format: ir_arena/1\nplanners: [sbl]\ntasks: [home->p1]\nseeds: 1\nseconds: 0.01\n"
        "cells: [cell.yaml]\n"
    )
    run_arena(read_settings(settings), tmp_path / "out", Means(1, command=command))
    file.write_text(cell_to_yaml(load_cell("deep_box")).replace("name: deep_box", "name: open"))
    settings.write_text(settings.read_text().replace("tasks: [home->p1]\n", ""))
    with pytest.raises(StudyError, match="results of another cell"):
        run_arena(read_settings(settings), tmp_path / "out", Means(1, command=command))


def test_a_folder_of_other_settings_is_refused(fought: Fought, tmp_path: Path) -> None:
    fought("sbl")
    other = ArenaSettings(cells=("open",), planners=("sbl",), seconds=2.0)
    with pytest.raises(StudyError, match=r"results with seconds 0.01, the settings have 2.0"):
        run_arena(other, tmp_path / "out")


def test_a_folder_from_before_further_iterations_goes_on_with_none(
    tmp_path: Path, command: tuple[str, ...]
) -> None:
    settings = ArenaSettings(
        ("open",), ("sbl",), tasks=("home->p1",), seconds=0.01, further_iterations=0
    )
    first = run_arena(settings, tmp_path, Means(2, command=command))
    kept = (tmp_path / NAME).read_text()
    assert "further_iterations" not in kept
    assert table(run_arena(settings, tmp_path, Means(2, command=("false",)))) == table(first)
    with pytest.raises(StudyError, match="further_iterations"):
        run_arena(replace(settings, further_iterations=7), tmp_path)


def test_two_arenas_in_one_folder_are_one_too_many(fought: Fought) -> None:
    refused: list[str] = []

    def second(phase: str, done: int, of: int, best: str) -> None:
        with pytest.raises(StudyError) as error:
            fought("sbl")
        refused.append(str(error.value))

    fought("sbl", seeds=1, progress=second)
    assert "is in use by another study" in refused[0]


@pytest.mark.parametrize(
    "content", [b"\x00\xff", b"hello\n", b"[]\n", b'{"format": "ir_cell/1"}\n']
)
def test_a_file_of_something_else_is_refused_and_kept(
    fought: Fought, tmp_path: Path, content: bytes
) -> None:
    path = tmp_path / "out" / NAME
    path.parent.mkdir()
    path.write_bytes(content)
    with pytest.raises(StudyError, match="holds no results of an arena"):
        fought("sbl")
    assert path.read_bytes() == content


def test_a_folder_that_cannot_be_written_is_named(fought: Fought, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(StudyError, match="can't be written"):
        fought("sbl")


def test_what_lies_where_the_database_belongs_is_named(fought: Fought, tmp_path: Path) -> None:
    (tmp_path / "out" / "arena.db.part").mkdir(parents=True)
    with pytest.raises(StudyError, match=r"arena\.db can't be written"):
        fought("sbl", seeds=1)


def test_a_database_that_cannot_be_finished_leaves_nothing_behind(
    fought: Fought, tmp_path: Path
) -> None:
    (tmp_path / "out" / "arena.db").mkdir(parents=True)
    with pytest.raises(StudyError, match=r"arena\.db can't be written"):
        fought("sbl", seeds=1)
    assert not (tmp_path / "out" / "arena.db.part").exists()


def test_workers_that_never_start_end_the_arena(tmp_path: Path) -> None:
    settings = ArenaSettings(cells=("open",), tasks=("home->p1",), seeds=5)
    with pytest.raises(StudyError, match="a worker died before it could start"):
        run_arena(settings, tmp_path, Means(2, command=("false",)))


def test_no_worker_outlives_the_arena(fought: Fought, tmp_path: Path) -> None:
    def stop(phase: str, done: int, of: int, best: str) -> None:
        assert running(str(tmp_path))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fought("sbl", "rrt", progress=stop)
    assert running(str(tmp_path)) == []


def running(word: str) -> list[str]:
    """Command lines of this machine's processes that hold a word."""
    found = []
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):  # it has ended meanwhile
            found.append(file.read_text(errors="replace"))
    return [line for line in found if word in line]


def test_the_database_has_what_planner_arena_asks_for(fought: Fought) -> None:
    finished = fought("sbl", "prm")
    with sqlite3.connect(finished.files[1]) as database:
        names = dict(database.execute("SELECT id, name FROM plannerConfigs"))
        solved = database.execute(
            "SELECT plannerid, solved, solution_cost, status FROM runs"
        ).fetchall()
        assert {(names[planner], *rest) for planner, *rest in solved} == {
            ("sbl", 1, 1000.0, 0),
            ("sbl", 1, 1100.0, 0),
            ("prm", 0, None, 1),
        }
        progress = database.execute(
            "SELECT time, best_cost FROM progress ORDER BY runid, time"
        ).fetchall()
        assert progress == [(0.1, 2000.0), (0.2, 1000.0), (0.1, 2200.0), (0.2, 1100.0)]
        assert database.execute("SELECT name, timelimit, runcount FROM experiments").fetchall() == [
            ("open home->p1 synchronous", 0.01, 2)
        ]
        best = database.execute("SELECT plannerid, avg_solved FROM bestPlannerConfigs").fetchall()
        assert [(names[planner], solved) for planner, solved in best] == [
            ("sbl", 1.0),
            ("prm", 0.0),
        ]
        by_question = (
            "SELECT plannerid, experimentid, avg_solved FROM bestPlannerConfigsPerExperiment"
        )
        assert len(database.execute(by_question).fetchall()) == 2
        enums = dict(database.execute("SELECT value, description FROM enums WHERE name = 'status'"))
        assert enums == {0: "answered", 1: "died", 2: "cut"}


def test_the_page_holds_all_and_fetches_nothing(fought: Fought) -> None:
    finished = fought("sbl", "prm", "genetic")
    page = finished.files[2].read_text()
    assert all(planner in page for planner in ("sbl", "prm", "genetic"))
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert "https://" not in page
    assert "{{" not in page
    assert "3 planners, 1 cell, 1 movement, 2 seeds: 6 runs of 0.01 s of processor" in page
    data = json.loads(page.partition('id="data">')[2].partition("</script>")[0])
    assert (
        data["end"] == 0.01
    )  # though the runs took 0.3 s: what comes after the seconds doesn't count
    assert "<b>2</b> of 2" in page
    assert "<b>0</b> of 2" in page
    assert "NaN" not in page.partition('id="data">')[2].partition("</script>")[0]
