"""Pool of worker processes: a hanging job is cut, a dead process tried once more."""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

from ir_studies.errors import StoppedError, StudyError
from ir_studies.work.job import REFUSED, Job, Row, StudyJob
from ir_studies.work.lifeline import VARIABLE

COMMAND = (sys.executable, "-m", "ir_studies.work.worker")
_START_S = 600.0  # until a worker has loaded everything
_CHUNK = 1 << 16
_MOST_STARTS = 3  # workers in a row that don't start, until the study gives up
_LOOK_S = 0.1  # between two looks whether somebody asks to stop
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Each core has a worker already; and how many threads add up a sum must not depend on the
machine.
"""


@dataclass
class _Turn:
    job: Job
    again: bool = False  # whether its process has died before


class _Worker:
    """One process, and the job that it makes. It ends with this process, whatever it does then."""

    def __init__(self, command: Sequence[str], task: StudyJob) -> None:
        # a group of its own: Ctrl-C is for the study, which ends its workers
        pipe = subprocess.PIPE
        held, self._lifeline = os.pipe()
        try:
            self.process = subprocess.Popen(
                command,
                stdin=pipe,
                stdout=pipe,
                bufsize=0,
                process_group=0,
                pass_fds=[held],
                env={**os.environ, **_ONE_THREAD, VARIABLE: str(held)},
            )
        except OSError as error:
            os.close(self._lifeline)
            raise StudyError(f"a worker can't be started: {error.strerror}") from error
        finally:
            os.close(held)
        self.turn: _Turn | None = None
        self.ready = False
        self._text = b""
        self.late = time.monotonic() + _START_S
        self._say({"kind": task.kind, "settings": dict(task.settings)})

    def take(self, turn: _Turn, limit: float) -> None:
        """Begin a job that may take `limit` s."""
        self.turn = turn
        self.late = time.monotonic() + limit
        self._say(dict(turn.job.words))

    def rest(self) -> None:
        """Wait for the next job, as long as it takes."""
        self.turn = None
        self.late = float("inf")

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
        os.close(self._lifeline)
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                stream.close()


class Pool:
    """At most `count` worker processes, kept from one call of `rows` to the next until `close`.

    stopped: asked several times a second; once it is true, StoppedError is raised.
    """

    def __init__(
        self,
        task: StudyJob,
        count: int,
        command: Sequence[str] = COMMAND,
        stopped: Callable[[], bool] | None = None,
    ) -> None:
        self._task = task
        self._count = count
        self._command = command
        self._stopped = stopped
        self._selector = selectors.DefaultSelector()
        self._turns: deque[_Turn] = deque()
        self._workers: list[_Worker] = []
        self._failed_starts = 0

    def rows(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, Row]]:
        """Each job with its row, as they are made. StudyError where no worker starts."""
        self._turns = deque(_Turn(job) for job in jobs)
        while self._turns or any(worker.turn for worker in self._workers):
            for worker in self._workers:
                if worker.ready and worker.turn is None:
                    self._give(worker)
            while len(self._workers) < min(self._count, self._unmade):
                self._start()
            yield from self._step()

    @property
    def _unmade(self) -> int:
        return len(self._turns) + sum(worker.turn is not None for worker in self._workers)

    def close(self) -> None:
        """End all workers, whatever they do."""
        for worker in self._workers:
            worker.end()
        self._workers.clear()
        self._selector.close()

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _start(self) -> None:
        worker = _Worker(self._command, self._task)
        self._workers.append(worker)
        self._selector.register(worker.process.stdout, selectors.EVENT_READ, worker)  # type: ignore[arg-type]

    def _step(self) -> Iterator[tuple[Job, Row]]:
        """Wait for what comes next: a row, an end, or a job that is late."""
        for key, _ in self._selector.select(self._wait()):
            worker: _Worker = key.data
            rows = worker.heard()
            if rows is None:
                yield from self._replaced(worker, "died")
                continue
            for row in rows:
                if not worker.ready and REFUSED in row:
                    raise StudyError(f"a worker can't begin: {row[REFUSED]}")
                turn = worker.turn
                worker.ready = True
                self._failed_starts = 0
                self._give(worker)  # before the row is handed on: who takes it may not come back
                if turn is not None:
                    yield turn.job, {"outcome": "answered", **row}
        now = time.monotonic()
        for worker in [worker for worker in self._workers if worker.late <= now]:
            yield from self._replaced(worker, "cut")

    def _wait(self) -> float:
        """Seconds until the next look."""
        wait = max(min(worker.late for worker in self._workers) - time.monotonic(), 0.0)
        if self._stopped is None:
            return wait
        if self._stopped():
            raise StoppedError("stopped")
        return min(wait, _LOOK_S)

    def _give(self, worker: _Worker) -> None:
        """The next job to a worker; without one it waits."""
        if self._turns:
            worker.take(self._turns.popleft(), self._task.limit)
        else:
            worker.rest()

    def _remove(self, worker: _Worker) -> None:
        self._selector.unregister(worker.process.stdout)  # type: ignore[arg-type]
        self._workers.remove(worker)
        worker.end()

    def _replaced(self, worker: _Worker, outcome: str) -> Iterator[tuple[Job, Row]]:
        """End a worker that died or is late; its job is made once more where it died for the first
        time.
        """
        self._remove(worker)
        turn = worker.turn
        if turn is None and not worker.ready:
            self._failed_starts += 1
            if self._failed_starts == _MOST_STARTS:
                raise StudyError(
                    f"a worker {outcome} before it could start: its last words are above"
                )
        elif turn is not None and outcome == "died" and not turn.again:
            self._turns.appendleft(_Turn(turn.job, again=True))
        elif turn is not None:
            limit = f"no answer within {self._task.limit:g} s"
            said = "twice the process died" if outcome == "died" else limit
            yield turn.job, {"outcome": outcome, "solved": False, "message": said}
