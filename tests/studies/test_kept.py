"""In a worker of a cluster: processes of a study end with it, whatever they do, and those of others
go on.
"""

from __future__ import annotations

import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from ir_studies import StoppedError
from ir_studies.work import Job, Row, StudyJob
from ir_studies.work.cluster import IDLE_S, Kept, Stopped
from ir_studies.work.pool import Pool

WORKER = """
import os, sys, time
input()
print("{}", flush=True)
for line in sys.stdin:
    if "hang" in line:
        open(sys.argv[1], "w").write(str(os.getpid()))
        time.sleep(3600)
    print('{"pid": %d}' % os.getpid(), flush=True)
"""


class Threads:
    """What the threads of a worker of the cluster ask."""

    def __init__(self, folder: Path, idle: float = IDLE_S) -> None:
        self.kept = Kept(idle)
        self.mark = folder / "hangs"

    def pool(self, stopped: Stopped) -> Pool:
        command = (sys.executable, "-S", "-c", WORKER, str(self.mark))
        return Pool(StudyJob("layout", {}, 3600.0), 1, command, stopped)

    def row(self, study: str, **words: Any) -> Row:
        return self.kept.row(study, self.pool, Job("", words))


def runs(pid: object) -> bool:
    return Path(f"/proc/{pid}").exists()


def test_the_end_of_a_study_leaves_the_processes_of_another_alone(tmp_path: Path) -> None:
    threads = Threads(tmp_path)
    one = threads.row("one")["pid"]
    other = threads.row("other")["pid"]
    assert one != other
    threads.kept.end("one")
    assert not runs(one)
    assert threads.row("other")["pid"] == other
    threads.kept.end("other")
    assert not runs(other)
    assert len(threads.kept) == 0


def test_a_job_that_runs_when_its_study_ends_is_ended_by_its_thread_and_leaves_nothing(
    tmp_path: Path, wait_for: Any
) -> None:
    threads = Threads(tmp_path)
    raised: list[BaseException] = []

    def hang() -> None:
        try:
            threads.row("one", hang=1)
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=hang, daemon=True)
    thread.start()
    pid = wait_for(lambda: threads.mark.exists() and threads.mark.read_text(), what="the job runs")
    threads.kept.end("one")
    wait_for(lambda: not thread.is_alive(), what="the thread is free for others")
    assert isinstance(raised[0], StoppedError)
    assert not runs(pid)
    assert len(threads.kept) == 0


def test_a_job_that_comes_after_its_study_has_ended_starts_nothing(tmp_path: Path) -> None:
    threads = Threads(tmp_path)
    threads.kept.end("one")
    with pytest.raises(StoppedError):
        threads.row("one")
    assert len(threads.kept) == 0


def test_a_process_without_a_job_ends_and_the_next_job_gets_another(
    tmp_path: Path, wait_for: Any
) -> None:
    threads = Threads(tmp_path, idle=0.05)
    first = threads.row("one")["pid"]
    wait_for(lambda: not runs(first), what="the idle process ends")
    assert len(threads.kept) == 0
    assert threads.row("one")["pid"] != first
    threads.kept.end("one")
