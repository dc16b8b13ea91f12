"""Results and workers hold what they read against what the study has read: cells, tasks, builds."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from ir_description import cell_to_yaml, load_cell
from ir_description.cell import Task
from ir_recorder.recording.arithmetic import arithmetic
from ir_studies import Means, run_arena
from ir_studies.arena import ArenaSettings
from ir_studies.arena.one_run import row_maker as arena_maker
from ir_studies.errors import StudyError
from ir_studies.statistics.runs import row_maker as statistics_maker
from ir_studies.work import fingerprint
from ir_studies.work.results import digest_of_tasks, refuse_others, task_digests

PROBE = "from ir_recorder.recording.arithmetic import arithmetic; print(arithmetic())"


def test_a_task_with_another_goal_is_refused_and_a_new_one_is_taken(
    tmp_path: Path, command: tuple[str, ...]
) -> None:
    cell = load_cell("open")
    file = tmp_path / "mine.yaml"

    def run(*tasks: Task) -> None:
        file.write_text(cell_to_yaml(replace(cell, tasks=tasks)))
        settings = ArenaSettings(
            cells=(str(file),), planners=("sbl",), tasks=("home->p1",), seeds=1
        )
        run_arena(settings, tmp_path / "out", Means(1, command=command))

    first, second = cell.tasks[:2]
    run(first)
    run(second, first)
    with pytest.raises(StudyError, match="results of another task home->p1 of"):
        run(replace(first, goal=first.goal + 1e-9), second)


def test_a_task_more_or_another_one_changes_what_pairs_are_drawn_from() -> None:
    cell = load_cell("open")
    assert set(task_digests("open", cell)) == {f"task {task.name} of open" for task in cell.tasks}
    assert digest_of_tasks("open", cell) == digest_of_tasks("open", load_cell("open"))
    assert digest_of_tasks("open", cell) != digest_of_tasks("open", load_cell("table_columns"))


def test_a_worker_that_reads_another_file_than_the_study_refuses() -> None:
    with pytest.raises(StudyError, match="cell open is not here what the study has read"):
        arena_maker({"cells": ["open"], "read": {"open": "0"}})
    with pytest.raises(StudyError, match="tasks of open is not here what the study has read"):
        statistics_maker({"cell": "open", "read": {"tasks of open": "0"}})
    refuse_others({"open": "1"}, {"open": "1", "more": "2"})


def test_sources_count_by_their_names_and_their_content(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "ir_of_a_test"
    folder.mkdir()
    (folder / "__init__.py").touch()
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(fingerprint, "PACKAGES", ("ir_of_a_test",))
    found = [fingerprint.sources()]
    for name, text in (("a.py", "1"), ("a.py", "2"), ("b.yaml", "2")):
        (folder / name).write_text(text)
        found.append(fingerprint.sources())
    assert len(set(found)) == 4
    (folder / "notes.txt").write_text("what no result depends on")
    assert fingerprint.sources() == found[-1]


def test_an_old_processor_has_the_same_arithmetic() -> None:
    def said(**environment: str) -> str:
        words = {**os.environ, "OPENBLAS_NUM_THREADS": "1", **environment}
        done = subprocess.run(
            [sys.executable, "-c", PROBE], env=words, capture_output=True, check=True
        )
        return done.stdout.decode().strip()

    older = said(OPENBLAS_CORETYPE="Nehalem", NPY_DISABLE_CPU_FEATURES="X86_V4")
    assert older == arithmetic()
