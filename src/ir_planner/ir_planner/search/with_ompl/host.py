"""Asks OMPL's processes: starts the one that has loaded it, hands over problems, kills what is
late.

Nothing here waits without an end: a process that is stopped, or that never answers, costs a request
its time and no more.
"""

from __future__ import annotations

import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from multiprocessing.connection import Connection
from multiprocessing.reduction import send_handle
from typing import NamedTuple

from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError
from ir_planner.request import Work
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

STOP = "stop"
"""Sent after the problem, when the time is over: the answer is what was found so far."""


@dataclass(frozen=True)
class OmplParameters:
    """planner: name of a class in ompl.geometric; values: what its set... methods are called with,
    by the rest of their names; cell [rad]: cells of KPIECE's grid over the first three joints, 0
    for OMPL's own projection; reverse: it is asked for the movement from the goals to the start.
    """

    planner: str
    values: dict[str, float] = field(default_factory=dict)
    cell: float = 0.0
    reverse: bool = False


@dataclass(frozen=True, eq=False)
class OmplProblem:
    """From start (n,) to any of goals (G, n), farther from everything than threshold (Z,) m;
    `edges`: checks before it is given up; `seconds`: after which the process is ended, whatever it
    does.
    """

    scene: PlanningScene
    threshold: FloatArray
    start: FloatArray
    goals: FloatArray
    parameters: OmplParameters
    seed: int
    edges: int
    seconds: float


class OmplAnswer(NamedTuple):
    """A path (M, n), None where none was found; checks in edges; error: why OMPL could not be
    asked; unusable: because it is installed but can't be loaded.
    """

    path: FloatArray | None
    edges: int = 0
    error: str = ""
    unusable: bool = False


_LOOK_S = 0.005  # s between two looks whether the request was cancelled or its time is up
_ATTEMPTS = 2  # a host that died since the last request is started again once
_LAST_S = 0.02  # s on the request's clock, for an answer that is asked for at its end
_LAST_LOOKS = 400  # at most, where that clock stands
# looks, two minutes, until a host that answers nobody is ended: OMPL loads in seconds
_PATIENCE = 24_000
Charged = Callable[[int], AbstractContextManager[object]]
_charged: Charged = lambda process: nullcontext()  # noqa: E731 - until somebody asks


class Host:
    """The process that has loaded OMPL; it ends with this one."""

    def __init__(self) -> None:
        self._ours, theirs = socket.socketpair()
        self._ours.setblocking(False)
        self._looks = 0  # since it last answered
        module = __name__.rpartition(".")[0] + ".worker"
        command = f"from {module} import main; main({theirs.fileno()})"
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", command],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                env={
                    **os.environ,
                    "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
                },
            )
        self.owner = os.getpid()

    def connection(self) -> Connection:
        """To a new process, which waits for one problem. Raises OSError where the host is gone, or
        stands.
        """
        ours, theirs = socket.socketpair()
        with theirs, ours:
            socket.send_fds(self._ours, [b"."], [theirs.fileno()])
            return Connection(ours.detach())

    def process_of(self, connection: Connection, work: Work) -> int | None:
        """Id of the process at the other end, once it is there; None where the work ended before.

        Raises EOFError or OSError where the host is gone, or has answered nobody for too long.
        """
        while not connection.poll(_LOOK_S):
            self._looks += 1
            if self._looks > _PATIENCE:
                raise EOFError("OMPL's process is silent")
            work.check()
            if work.exhausted:
                return None
        self._looks = 0
        return int(connection.recv())

    def close(self) -> None:
        """End the host, also one that is stopped; what was forked from it ends with it."""
        self._ours.close()
        self._process.kill()
        self._process.wait()


_lock = threading.Lock()
_host: Host | None = None


def _current() -> Host:
    global _host  # one per process, whatever number of planners
    with _lock:
        if _host is None or _host.owner != os.getpid():
            _host = Host()
        return _host


def _dropped(host: Host) -> None:
    """The next request starts another one."""
    global _host
    with _lock:
        if _host is host:
            _host = None
    host.close()


@contextmanager
def _connected(work: Work) -> Iterator[tuple[Connection, int] | None]:
    """A connection to a new process, and its id; the process is killed with the context: it waits
    after its answer. None where the work ended before it was there.
    """
    for _ in range(_ATTEMPTS):
        host = _current()
        try:
            connection = host.connection()
        except OSError:
            _dropped(host)
            continue
        with connection:
            try:
                process = host.process_of(connection, work)
            except (EOFError, OSError):
                _dropped(host)
                continue
            if process is None:
                yield None
                return
            try:
                yield connection, process
            finally:
                with suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
            return
    raise RequestError(StatusCode.FAILURE, "OMPL's process does not start")


def missing() -> str:
    """How to install OMPL where it isn't; "" where it is."""
    return (
        ""
        if find_spec("ompl")
        else 'OMPL is missing: pip install "ir_planner[ompl]", or pip install ompl'
    )


def charge_to(charged: Charged) -> None:
    """From now on enter the context of each process in which OMPL answers, by its id; it is left
    while the process is still there. For who counts what a request costs.
    """
    global _charged
    _charged = charged


def check_installed(name: str) -> None:
    """Raise RequestError with how to install OMPL where it isn't."""
    if missing():
        raise RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, f"planner_id {name!r}: {missing()}")


def asked(problem: OmplProblem, work: Work) -> OmplAnswer:
    """OMPL's answer; its checks are charged to `work`, at whose end, or deadline, it is stopped.

    Raises CancelledError when asked to stop.
    """
    work.check()
    with _connected(work) as connected:
        if connected is None:
            return OmplAnswer(None, 0, "OMPL's process was not ready within planning_time")
        connection, process = connected
        with _charged(process):
            outcome = _answer(connection, process, problem, work)
    work.spend(outcome.edges)
    return outcome


def _answer(connection: Connection, process: int, problem: OmplProblem, work: Work) -> OmplAnswer:
    """What the process says to the problem. Both go through a file in memory, which never
    blocks.
    """
    with os.fdopen(os.memfd_create("problem"), "r+b") as sheet:
        # without what it has computed
        pickle.dump(replace(problem, scene=replace(problem.scene)), sheet)
        sheet.flush()
        try:
            send_handle(connection, sheet.fileno(), process)
            if not _has_answered(connection, work):
                return OmplAnswer(None)
            connection.recv()
        except (EOFError, OSError):
            return OmplAnswer(None, 0, "OMPL's process ended without an answer")
        sheet.seek(0)
        outcome: OmplAnswer = pickle.load(sheet)
        return outcome


def _has_answered(connection: Connection, work: Work) -> bool:
    """Whether the process has answered; when the work is over it is asked for what it has found so
    far.
    """
    while not connection.poll(_LOOK_S):
        work.check()
        if work.exhausted:
            connection.send(STOP)
            break
    end = work.clock() + _LAST_S
    for _ in range(_LAST_LOOKS):
        if connection.poll(_LOOK_S):
            return True
        work.check()
        if work.clock() > end:
            break
    return False
