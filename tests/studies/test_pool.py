"""Worker processes: they end with who started them, whatever they do, and are kept from batch to
batch.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from ir_studies.errors import StudyError
from ir_studies.work import Job, StudyJob
from ir_studies.work.pool import Pool

TASK = StudyJob("arena", {}, 60.0)
HANGS = """
import re, sys
sys.path[:0] = {path!r}
from ir_studies.work.lifeline import tie
tie()
print(input() and "{{}}", flush=True)
open({mark!r}, "w").write(str(__import__("os").getpid()))
re.match("(a+)+$", "a" * 60 + "b")  # for years, and with the interpreter locked
"""
STARTS = """
import sys
sys.path[:0] = {path!r}
from ir_studies.work import Job, StudyJob
from ir_studies.work.pool import Pool
pool = Pool(StudyJob("arena", {{}}, 3600.0), 1, (sys.executable, {worker!r}))
list(pool.rows([Job("a")]))
"""
ECHO = """
import os, sys
input()
print("{}", flush=True)
for line in sys.stdin:
    print('{"pid": %d}' % os.getpid(), flush=True)
    if len(sys.argv) > 1 and "die" in line:
        os._exit(1)
"""


@pytest.mark.long
def test_a_worker_that_hangs_ends_with_a_study_that_was_killed(
    tmp_path: Path, wait_for: Any
) -> None:
    mark = tmp_path / "pid"
    worker = tmp_path / "hangs.py"
    worker.write_text(HANGS.format(path=sys.path, mark=str(mark)))
    study = subprocess.Popen(
        [sys.executable, "-c", STARTS.format(path=sys.path, worker=str(worker))]
    )
    try:
        pid = wait_for(lambda: mark.exists() and mark.read_text(), what="the worker hangs")
        assert Path(f"/proc/{pid}/stat").exists()
    finally:
        study.send_signal(signal.SIGKILL)
        study.wait()

    def gone() -> bool:
        try:
            return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
        except OSError:
            return True

    wait_for(gone, what="the worker has ended")


def test_workers_are_kept_from_batch_to_batch_until_the_pool_closes() -> None:
    with Pool(TASK, 1, (sys.executable, "-S", "-c", ECHO)) as pool:
        pids = {row["pid"] for _ in range(3) for _, row in pool.rows([Job("a"), Job("b")])}
        assert len(pids) == 1
        assert list(pool.rows([])) == []
    assert not Path(f"/proc/{pids.pop()}").exists()


def test_who_takes_one_row_only_gets_the_next_ones_later() -> None:
    with Pool(TASK, 1, (sys.executable, "-S", "-c", ECHO)) as pool:
        for _ in range(3):
            job, row = next(pool.rows([Job("a")]))
            assert (job.key, row["outcome"]) == ("a", "answered")


def test_a_worker_that_died_while_it_waited_is_replaced() -> None:
    with Pool(TASK, 1, (sys.executable, "-S", "-c", ECHO, "x")) as pool:
        for _ in range(3):
            rows = list(pool.rows([Job("a", {"die": 1}), Job("b")]))
            assert [job.key for job, _ in rows] == ["a", "b"]
            assert all(row["outcome"] == "answered" for _, row in rows)


def test_why_a_worker_cannot_begin_is_said_at_once() -> None:
    text = "the cell is not here"
    refuses = f'input(); print(\'{{"refused": "{text}"}}\', flush=True)'
    with (
        Pool(TASK, 2, (sys.executable, "-S", "-c", refuses)) as pool,
        pytest.raises(StudyError, match=f"a worker can't begin: {text}"),
    ):
        list(pool.rows([Job("a"), Job("b")]))


def test_workers_add_up_with_one_thread_whatever_the_environment_says(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "7")
    says = (
        "import os; input(); print('{}', flush=True); input(); "
        "print('{\"n\": ' + os.environ['OPENBLAS_NUM_THREADS'] + '}', flush=True)"
    )
    with Pool(TASK, 1, (sys.executable, "-S", "-c", says)) as pool:
        [(_, row)] = pool.rows([Job("a")])
    assert row["n"] == 1
