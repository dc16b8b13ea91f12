"""Means of a study: worker processes of this machine or a Dask cluster, progress, a stop."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol

from ir_studies.errors import StudyError
from ir_studies.work.job import Job, Row, StudyJob
from ir_studies.work.pool import COMMAND, Pool

MOST_WORKERS = 64
_ADDRESS = re.compile(
    r"(?:(?:tcp|tls|ws|wss)://)?(?:[\w.-]+|\[[0-9A-Fa-f:.]+\]):(?P<port>\d{1,5})", re.ASCII
)
_MOST_PORTS = 65_535
Progress = Callable[[str, int, int, str], None]


def nobody(phase: str, done: int, of: int, best: str) -> None:
    """Progress that nobody asks for."""


class Makers(Protocol):
    """Whoever makes jobs."""

    def rows(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, Row]]:
        """Each job with its row, in any order; may be called again."""


@dataclass(frozen=True)
class Means:
    """workers: processes of this machine, 0: one per core. scheduler: address of a Dask scheduler
    instead, as tcp://127.0.0.1:8786; StudyError where it can't be one. progress: called with a
    phase, jobs made, that of all, and the best so far in words. stopped: asked several times a
    second; True ends the study with StoppedError. command: what a worker process is.
    """

    workers: int = 0
    scheduler: str = ""
    progress: Progress = nobody
    stopped: Callable[[], bool] | None = None
    command: Sequence[str] = COMMAND

    def __post_init__(self) -> None:
        if not 0 <= self.workers <= MOST_WORKERS:
            raise StudyError(
                f"workers is {self.workers}: it must be in 1 .. {MOST_WORKERS}, or 0: as cores"
            )
        if self.scheduler:
            _check_address(self.scheduler)

    def makers(self, task: StudyJob) -> AbstractContextManager[Makers]:
        """Processes that make the jobs of a task; they end with the context."""
        if self.scheduler:
            from ir_studies.work.cluster import Cluster

            return Cluster(task, self.scheduler, self.stopped)
        count = self.workers or min(len(os.sched_getaffinity(0)), MOST_WORKERS)
        return Pool(task, count, self.command, self.stopped)


def _check_address(scheduler: str) -> None:
    """Before anybody waits for an answer: Dask takes most words for the name of a machine."""
    found = _ADDRESS.fullmatch(scheduler)
    if found is None or not 1 <= int(found["port"]) <= _MOST_PORTS:
        raise StudyError(
            f"scheduler is {scheduler!r:.80}: it must be an address with a port in 1 .. "
            f"{_MOST_PORTS}, as tcp://127.0.0.1:8786"
        )
