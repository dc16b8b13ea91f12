"""Asks OMPL's processes: starts the one that has loaded it, hands over problems, kills what is late."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import replace
from importlib.util import find_spec
from multiprocessing.connection import Connection

from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError
from ir_planner.request import Work
from ir_planner.search.with_ompl.problem import Outcome, Problem

_LOOK_S = 0.005  # s between two looks whether the request was cancelled or its time is up
_ATTEMPTS = 2  # a host that died since the last request is started again once
Charged = Callable[[int], AbstractContextManager[object]]
_charged: Charged = lambda process: nullcontext()  # noqa: E731 - until somebody asks


class Host:
    """The process that has loaded OMPL; it ends with this one."""

    def __init__(self) -> None:
        self._ours, theirs = socket.socketpair()
        module = __name__.rpartition(".")[0] + ".worker"
        command = f"from {module} import main; main({theirs.fileno()})"
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", command],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
            )
        self.owner = os.getpid()

    def connection(self) -> Connection:
        """To a new process, which waits for one problem. Raises OSError where the host is gone."""
        ours, theirs = socket.socketpair()
        with theirs:
            socket.send_fds(self._ours, [b"."], [theirs.fileno()])
        return Connection(ours.detach())

    def close(self) -> None:
        """End the host; what was forked from it ends by itself."""
        self._ours.close()
        self._process.wait()


_lock = threading.Lock()
_host: Host | None = None


def _connected() -> tuple[Connection, int]:
    """A connection to a new process, and its id."""
    global _host  # one per process, whatever number of planners
    for attempt in range(_ATTEMPTS):
        with _lock:
            if _host is None or _host.owner != os.getpid():
                _host = Host()
            host = _host
        with suppress(OSError, EOFError):
            connection = host.connection()
            return connection, connection.recv()
        with _lock:
            if _host is host:
                _host = None
        host.close()
        if attempt == _ATTEMPTS - 1:
            break
    raise RequestError(StatusCode.FAILURE, "OMPL's process does not start")


def missing() -> str:
    """How to install OMPL where it isn't; "" where it is."""
    return "" if find_spec("ompl") else 'OMPL is missing: pip install "ir_planner[ompl]", or pip install ompl'


def charge_to(charged: Charged) -> None:
    """From now on enter the context of each process in which OMPL answers, by its id; it is left while the
    process is still there. For who counts what a request costs.
    """
    global _charged
    _charged = charged


@contextmanager
def _killed(process: int) -> Iterator[None]:
    """Ended with the context: it waits after its answer."""
    try:
        yield
    finally:
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)


def check_installed(name: str) -> None:
    """Raise RequestError with how to install OMPL where it isn't."""
    if missing():
        raise RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, f"planner_id {name!r}: {missing()}")


def asked(problem: Problem, work: Work) -> Outcome:
    """OMPL's answer; its checks are charged to `work`, at whose end, or deadline, it is stopped.

    Raises CancelledError when asked to stop.
    """
    work.check()
    connection, process = _connected()
    with connection, _killed(process), _charged(process):
        try:
            connection.send(replace(problem, scene=replace(problem.scene)))  # without what it has computed
            while not connection.poll(_LOOK_S):
                work.check()
                if work.exhausted:
                    return Outcome(None)
            outcome: Outcome = connection.recv()
        except (EOFError, OSError):
            return Outcome(None, 0, "OMPL's process ended without an answer")
    work.spend(outcome.edges)
    return outcome
