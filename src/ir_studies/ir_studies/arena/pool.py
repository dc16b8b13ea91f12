"""Worker processes for runs: what hangs is cut, what dies is tried once more, Ctrl-C ends them all."""

from __future__ import annotations

import json
import selectors
import subprocess
import sys
import time
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass

from ir_studies.arena.entries import Entry
from ir_studies.arena.one_run import Row
from ir_studies.arena.settings import ArenaSettings
from ir_studies.errors import WorkerError

COMMAND = (sys.executable, "-m", "ir_studies.arena.worker")
_START_S = 600.0  # until a worker has loaded everything
_CHUNK = 1 << 16
_MOST_STARTS = 3  # workers in a row that don't start, until the arena gives up


@dataclass
class _Job:
    entry: Entry
    again: bool = False  # whether it has died before


class _Worker:
    """One process, and the run that it makes."""

    def __init__(self, command: Sequence[str], settings: ArenaSettings) -> None:
        pipe = subprocess.PIPE  # a group of its own: Ctrl-C is for the arena, which ends its workers
        self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, bufsize=0, process_group=0)
        self.job: _Job | None = None
        self.ready, self._text = False, b""
        self.late = time.monotonic() + _START_S
        self._say(asdict(settings))

    def take(self, job: _Job, limit: float) -> None:
        """Begin a run that may take `limit` s."""
        self.job, self.late = job, time.monotonic() + limit
        self._say(asdict(job.entry))

    def _say(self, words: object) -> None:
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):  # it has died: its output ends
            self.process.stdin.write(json.dumps(words).encode() + b"\n")

    def heard(self) -> list[Row] | None:
        """What it has written since; None where its output has ended."""
        assert self.process.stdout is not None
        chunk = self.process.stdout.read(_CHUNK)
        if not chunk:
            return None
        *lines, self._text = (self._text + chunk).split(b"\n")
        return [json.loads(line) for line in lines]

    def end(self) -> None:
        """Kill it."""
        self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                stream.close()


class Pool:
    """`count` workers that make runs until all are made."""

    def __init__(self, settings: ArenaSettings, count: int, command: Sequence[str] = COMMAND) -> None:
        self._settings, self._count, self._command = settings, count, command
        self._limit = settings.seconds + settings.hang_after
        self._selector = selectors.DefaultSelector()
        self._jobs: deque[_Job] = deque()
        self._workers: list[_Worker] = []
        self._failed_starts = 0

    def rows(self, entries: Iterable[Entry]) -> Iterator[tuple[Entry, Row]]:
        """Each entry with its row, as they are made. WorkerError where no worker starts."""
        self._jobs = deque(_Job(entry) for entry in entries)
        try:
            for _ in range(min(self._count, len(self._jobs))):
                self._start()
            while self._workers:
                yield from self._step()
        finally:
            for worker in self._workers:
                worker.end()
            self._workers.clear()
            self._selector.close()

    def _start(self) -> None:
        worker = _Worker(self._command, self._settings)
        self._workers.append(worker)
        self._selector.register(worker.process.stdout, selectors.EVENT_READ, worker)  # type: ignore[arg-type]

    def _step(self) -> Iterator[tuple[Entry, Row]]:
        """Wait for what comes next: a row, an end, or a run that is late."""
        wait = min(worker.late for worker in self._workers) - time.monotonic()
        for key, _ in self._selector.select(max(wait, 0.0)):
            worker: _Worker = key.data
            rows = worker.heard()
            if rows is None:
                yield from self._replaced(worker, "died")
                continue
            for row in rows:
                if worker.job is not None:
                    yield worker.job.entry, {"outcome": "answered", **row}
                worker.ready, worker.job, self._failed_starts = True, None, 0
                self._give(worker)
        now = time.monotonic()
        for worker in [worker for worker in self._workers if worker.late <= now]:
            yield from self._replaced(worker, "cut")

    def _give(self, worker: _Worker) -> None:
        """The next run to a worker; without one it ends."""
        if self._jobs:
            worker.take(self._jobs.popleft(), self._limit)
        else:
            self._remove(worker)

    def _remove(self, worker: _Worker) -> None:
        self._selector.unregister(worker.process.stdout)  # type: ignore[arg-type]
        self._workers.remove(worker)
        worker.end()

    def _replaced(self, worker: _Worker, outcome: str) -> Iterator[tuple[Entry, Row]]:
        """End a worker that died or is late; its run is made once more where it died for the first time."""
        self._remove(worker)
        job = worker.job
        if job is None:
            self._failed_starts += 1
            if self._failed_starts == _MOST_STARTS:
                raise WorkerError(f"a worker {outcome} before it could start: its last words are above")
        elif outcome == "died" and not job.again:
            self._jobs.appendleft(_Job(job.entry, again=True))
        else:
            said = "twice the process died" if outcome == "died" else f"no answer within {self._limit:g} s"
            yield job.entry, {"outcome": outcome, "solved": False, "message": said}
        if self._jobs:
            self._start()
