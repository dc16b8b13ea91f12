"""Jobs on a Dask cluster: each of its threads has a worker process of this project.

A hanging job is cut and a dead process tried once more by the same code as on one machine; a worker
of the cluster that dies is Dask's own business, which gives its job to another.
"""

from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from importlib import import_module
from itertools import islice
from queue import Empty, Queue
from types import ModuleType
from typing import Any
from uuid import uuid4

from ir_studies.errors import StoppedError, StudyError
from ir_studies.work.fingerprint import computed_with
from ir_studies.work.job import Job, Row, StudyJob
from ir_studies.work.pool import Pool

# In a worker of the cluster: the processes that make its jobs, one for each thread and study. A
# pool is touched by the thread that uses it only; others ask it to stop. A process ends with its
# study, and where no job came for a while: a study that was killed says no goodbye.

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
                used = _Used(make(stop.is_set), stop)
                self._used[own] = used
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


_CONNECT_S = 20.0
_LOOK_S = 0.2  # between two looks whether somebody asks to stop
# between two looks how many threads there are, and until a scheduler that is busy is left alone
_COUNT_S = 1.0
# for the end of what a study leaves behind: who does not answer ends it without being asked
_LEAVE_S = 10.0
# jobs that each thread has waiting: none waits for the next one to come over the network
_AHEAD = 4
# that Dask may give a job up because four workers died that had it, or had it waiting
_MOST_TIMES = 3
_GONE = "the scheduler is gone: the same command goes on when it is back"
_MISSING = (
    'a Dask cluster needs Dask: pip install "ir_studies[cluster]", or pip install dask distributed'
)


def _distributed() -> ModuleType:
    try:
        return import_module("distributed")
    except ImportError as error:
        raise StudyError(_MISSING) from error


@dataclass
class _Turn:
    job: Job
    given_up: int = 0  # how often by Dask


class Cluster:
    """Makes jobs by the workers of a scheduler; `stopped` as in Pool."""

    def __init__(self, task: StudyJob, address: str, stopped: Stopped | None = None) -> None:
        """Connect. StudyError where Dask is missing, nobody answers, or no worker is there."""
        self._dask = _distributed()
        self._stopped = stopped
        self._task = json.dumps(asdict(task))
        self._build = computed_with(task.kind)
        self._study = uuid4().hex
        self._threads = 1
        self._counted = -_COUNT_S
        self._running: dict[Any, _Turn] = {}
        try:
            with ThreadPoolExecutor(1) as apart:  # here a loop may run, as in a notebook
                apart.submit(asyncio.run, self._identity(address)).result()
            self._client = self._dask.Client(address, timeout=_CONNECT_S, set_as_default=False)
        except Exception as error:  # who knows what answers there, and how Dask reads it
            said = str(error) or f"nothing within {_CONNECT_S:g} s"
            raise StudyError(
                f"no Dask scheduler answers at {address!r:.80}: {said:.200}"
            ) from error
        try:
            self._client.wait_for_workers(1, timeout=_CONNECT_S)
        except TimeoutError as error:
            self._client.close()
            raise StudyError(
                f"the scheduler at {address} has no worker: start one, dask worker {address}"
            ) from error

    async def _identity(self, address: str) -> None:
        """Ask who is there. A client that could not connect is no use: its end waits, and is
        printed.
        """
        async with self._dask.rpc(address) as scheduler:
            await asyncio.wait_for(scheduler.identity(), _CONNECT_S)

    def rows(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, Row]]:
        """Each job with its row, as they are made."""
        left = iter(jobs)
        done = Queue[Any]()
        try:
            while True:
                for job in islice(left, self._free()):
                    self._submit(_Turn(job), done)
                if not self._running:
                    return
                future = self._next(done)
                if future is None:
                    continue
                turn = self._running.pop(future)
                row = self._row_given(future, turn)
                if row is None:
                    self._submit(turn, done)
                else:
                    yield turn.job, row
        finally:
            self._leave()

    def _submit(self, turn: _Turn, done: Queue[Any]) -> None:
        words = dict(turn.job.words)
        # not by its content: what is asked again is made again
        future = self._client.submit(made, self._study, self._task, words, self._build, pure=False)
        self._running[future] = turn
        future.add_done_callback(done.put)

    def _free(self) -> int:
        """How many jobs more the cluster may have waiting."""
        now = time.monotonic()
        if now - self._counted >= _COUNT_S:
            self._counted = now
            with suppress(TimeoutError):  # busy, or stopped for a while: as many as before
                self._threads = self._count()
        return max(_AHEAD * max(self._threads, 1) - len(self._running), 0)

    def _count(self) -> int:
        try:
            threads = self._client.sync(self._client.scheduler.ncores, callback_timeout=_COUNT_S)
        except TimeoutError:
            raise
        except (
            AttributeError,
            OSError,
        ) as error:  # AttributeError: the client has given the scheduler up
            raise StudyError(_GONE) from error
        return sum(int(count) for count in threads.values())

    def _next(self, done: Queue[Any]) -> Any:
        """What was done next; None where nothing was for a while."""
        if self._stopped is not None and self._stopped():
            raise StoppedError("stopped")
        try:
            return done.get(timeout=_LOOK_S)
        except Empty:
            return None

    def _row_given(self, future: Any, turn: _Turn) -> Row | None:
        """What a job gave; None where it is to be made again, since its workers died: it need not
        be why.
        """
        try:
            row: Row = future.result()
        except self._dask.KilledWorker as error:
            turn.given_up += 1
            if turn.given_up < _MOST_TIMES:
                return None
            return {
                "outcome": "died",
                "solved": False,
                "message": f"workers died with it: {error!s:.200}",
            }
        except StudyError:
            raise
        except (self._dask.CancelledError, OSError) as error:
            raise StudyError(_GONE) from error
        except Exception as error:  # whatever is installed there, or is not
            said = f"{type(error).__name__}: {error!s:.200}"
            raise StudyError(f"a worker of the cluster can't make jobs: {said}") from error
        return row

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *exception: object) -> None:
        if self._client.status == "running":
            _act_at_most(
                _LEAVE_S, lambda: self._client.run(end_study, self._study, on_error="ignore")
            )
        with suppress(OSError):
            self._client.close(timeout=_LEAVE_S)

    def _leave(self) -> None:
        """Cancel what was not waited for."""
        left = list(self._running)
        self._running.clear()
        if left and self._client.status == "running":
            _act_at_most(_LEAVE_S, lambda: self._client.cancel(left))


def _act_at_most(seconds: float, act: Callable[[], object]) -> None:
    """Wait for an act so long at most: what has stopped at the other end must not hold who
    leaves.
    """

    def acted() -> None:
        with suppress(
            Exception
        ):  # who leaves has no use for it: a worker without a study ends its processes
            act()

    thread = threading.Thread(target=acted, daemon=True)
    thread.start()
    thread.join(seconds)


_kept = Kept()


def made(study: str, task: str, words: Mapping[str, Any], build: str) -> Row:
    """In a worker of the cluster: the row of a job. StudyError where it would compute other
    bits.
    """
    read: StudyJob = StudyJob(**json.loads(task))
    if computed_with(read.kind) != build:
        raise StudyError(
            f"a worker of the cluster computes with {computed_with(read.kind)}, not with {build}"
        )
    return _kept.row(study, lambda stopped: Pool(read, 1, stopped=stopped), Job("", words))


def end_study(study: str) -> None:
    """In a worker of the cluster: end the processes of a study."""
    _kept.end(study)
