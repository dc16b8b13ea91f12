"""Jobs made by a Dask cluster: each of its threads has a worker process of this project.

So what hangs there is cut and what dies is tried once more by the same code as on one machine; a worker of
the cluster that dies is Dask's own business, which gives its job to another.
"""

from __future__ import annotations

import asyncio
import json
import platform
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict
from importlib import import_module
from itertools import islice
from queue import Empty, Queue
from types import ModuleType, TracebackType
from typing import Any

import numpy as np
import scipy

from ir_kernels import compiled
from ir_studies.errors import StoppedError, StudyError, WorkerError
from ir_studies.work.job import Job, Row, Task
from ir_studies.work.pool import Pool

_CONNECT_S = 20.0
_LOOK_S = 0.2  # between two looks whether somebody asks to stop
_AHEAD = 4  # jobs that each thread has waiting: none waits for the next one to come over the network
_GONE = "the scheduler is gone: the same command goes on when it is back"
_MISSING = 'a Dask cluster needs Dask: pip install "ir_studies[cluster]", or pip install dask distributed'


def _distributed() -> ModuleType:
    try:
        return import_module("distributed")
    except ImportError as error:
        raise WorkerError(_MISSING) from error


class Cluster:
    """Makes jobs by the workers of a scheduler; `stopped` as in Pool."""

    def __init__(self, task: Task, address: str, stopped: Callable[[], bool] | None = None) -> None:
        """Connect. WorkerError where Dask is missing, nobody answers, or no worker is there."""
        self._dask, self._stopped = _distributed(), stopped
        self._task = json.dumps(asdict(task))
        try:
            with ThreadPoolExecutor(1) as apart:  # here a loop may run, as in a notebook
                apart.submit(asyncio.run, self._identity(address)).result()
            self._client = self._dask.Client(address, timeout=_CONNECT_S, set_as_default=False)
        except Exception as error:  # who knows what answers there, and how Dask reads it
            said = str(error) or f"nothing within {_CONNECT_S:g} s"
            raise WorkerError(f"no Dask scheduler answers at {address!r:.80}: {said:.200}") from error
        try:
            self._client.wait_for_workers(1, timeout=_CONNECT_S)
        except TimeoutError as error:
            self._client.close()
            raise WorkerError(
                f"the scheduler at {address} has no worker: start one, dask worker {address}"
            ) from error

    async def _identity(self, address: str) -> None:
        """Ask who is there. A client that could not connect is no use: its end waits, and is printed."""
        async with self._dask.rpc(address) as scheduler:
            await asyncio.wait_for(scheduler.identity(), _CONNECT_S)

    def rows(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, Row]]:
        """Each job with its row, as they are made."""
        left, running, done = iter(jobs), dict[Any, Job](), Queue[Any]()
        build = computed_with()
        try:
            while True:
                for job in islice(left, self._free(len(running))):
                    # not by its content: what is asked again is made again
                    submitted = self._client.submit(made, self._task, dict(job.words), build, pure=False)
                    running[submitted] = job
                    submitted.add_done_callback(done.put)
                if not running:
                    return
                future = self._next(done)
                if future in running:
                    yield running.pop(future), self._row(future)
        finally:
            with suppress(OSError):  # a scheduler that is gone has nothing to cancel
                self._client.cancel(list(running))

    def _free(self, running: int) -> int:
        try:
            threads = sum(int(count) for count in self._client.nthreads().values())
        except OSError as error:
            raise WorkerError(_GONE) from error
        return max(_AHEAD * max(threads, 1) - running, 0)

    def _next(self, done: Queue[Any]) -> Any:
        """What was done next; None where nothing was for a while."""
        if self._stopped is not None and self._stopped():
            raise StoppedError("stopped")
        try:
            return done.get(timeout=_LOOK_S)
        except Empty:
            return None

    def _row(self, future: Any) -> Row:
        """What a job gave; a row of its own where its workers died again and again."""
        try:
            row: Row = future.result()
        except self._dask.KilledWorker as error:
            return {"outcome": "died", "solved": False, "message": f"workers died with it: {error!s:.200}"}
        except StudyError:
            raise
        except (self._dask.CancelledError, OSError) as error:
            raise WorkerError(_GONE) from error
        return row

    def __enter__(self) -> Cluster:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(OSError):
            if self._client.status == "running":
                self._client.run(end_pools, on_error="ignore")
        with suppress(OSError):
            self._client.close(timeout=_CONNECT_S)


def computed_with() -> str:
    """What the bits of a result depend on beside its job."""
    versions = f"python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}"
    return f"{versions}, kernels {compiled.NAME}, {platform.machine()}"


_pools: dict[int, tuple[str, Pool]] = {}  # by thread of a worker of the cluster
_lock = threading.Lock()


def made(task: str, words: Mapping[str, Any], build: str) -> Row:
    """In a worker of the cluster: the row of a job. WorkerError where it would compute other bits."""
    if computed_with() != build:
        raise WorkerError(f"a worker of the cluster computes with {computed_with()}, not with {build}")
    [(_, row)] = _pool(task).rows([Job("", words)])
    return row


def _pool(task: str) -> Pool:
    """The pool of this thread: one process, kept from job to job of the same task."""
    own = threading.get_ident()
    with _lock:
        known = _pools.get(own)
    if known is not None and known[0] == task:
        return known[1]
    if known is not None:
        known[1].close()
    pool = Pool(Task(**json.loads(task)), 1)
    with _lock:
        _pools[own] = (task, pool)
    return pool


def end_pools() -> None:
    """In a worker of the cluster: end the processes of a study that has ended."""
    with _lock:
        known = list(_pools.values())
        _pools.clear()
    for _, pool in known:
        pool.close()
