"""In a worker of a Dask cluster: the processes that make its jobs, one for each thread and study.

A pool is touched by the thread that uses it only; others ask it to stop. A process ends with its
study, and
where no job came for a while: a study that was killed says no goodbye.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from ir_studies.errors import StoppedError
from ir_studies.work.job import Job, Row
from ir_studies.work.pool import Pool

IDLE_S = 120.0
Stopped = Callable[[], bool]
_Key = tuple[int, str]  # thread, study


@dataclass(eq=False)
class _Used:
    pool: Pool
    stop: threading.Event
    busy: bool = False
    waiting: threading.Timer | None = field(default=None, repr=False)


class Kept:
    """idle [s]: after so long without a job the process of a thread ends."""

    def __init__(self, idle: float = IDLE_S) -> None:
        self._idle = idle
        self._lock = threading.Lock()
        self._used: dict[_Key, _Used] = {}
        self._ended: set[str] = set()

    def __len__(self) -> int:
        return len(self._used)

    def row(self, study: str, make: Callable[[Stopped], Pool], job: Job) -> Row:
        """The row of a job, made by the process that this thread has for a study. StoppedError
        where that ended, also meanwhile; make: a new pool of one process, which asks whether it is
        to stop.
        """
        own = threading.get_ident(), study
        used = self._taken(own, make)
        try:
            [(_, row)] = used.pool.rows([job])
        except BaseException:
            used.stop.set()  # what failed is not kept
            raise
        finally:
            self._put_back(own, used)
        return row

    def end(self, study: str) -> None:
        """End the processes of a study; its thread ends one that makes a job just now."""
        with self._lock:
            self._ended.add(study)
            for _, used in self._of(study):
                used.stop.set()
            idle = [(own, used) for own, used in self._of(study) if not used.busy]
            for own, _ in idle:
                del self._used[own]
        for _, used in idle:
            used.pool.close()

    def _of(self, study: str) -> list[tuple[_Key, _Used]]:
        return [(own, used) for own, used in self._used.items() if own[1] == study]

    def _taken(self, own: _Key, make: Callable[[Stopped], Pool]) -> _Used:
        with self._lock:
            if own[1] in self._ended:
                raise StoppedError("the study has ended")
            used = self._used.get(own)
            if used is None:
                stop = threading.Event()
                used = self._used[own] = _Used(make(stop.is_set), stop)
            if used.waiting is not None:
                used.waiting.cancel()
            used.busy = True
            used.waiting = None
            return used

    def _put_back(self, own: _Key, used: _Used) -> None:
        with self._lock:
            used.busy = False
            ends = used.stop.is_set()
            if ends:
                del self._used[own]
            else:
                used.waiting = threading.Timer(self._idle, self._end_idle, (own, used))
                used.waiting.daemon = True
                used.waiting.start()
        if ends:
            used.pool.close()

    def _end_idle(self, own: _Key, used: _Used) -> None:
        with self._lock:
            if self._used.get(own) is not used or used.waiting is not threading.current_thread():
                return  # a job came meanwhile
            del self._used[own]
        used.pool.close()
