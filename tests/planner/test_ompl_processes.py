"""The processes of OMPL under attack: stopped, killed, left behind; a request ends, and leaves
nothing.
"""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ir_planner import CancelledError
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.scene import PlanningScene
from ir_planner.search import SEARCHES, Ends, Found, with_ompl
from ir_planner.search.with_ompl import host, worker
from ir_planner.search.with_ompl.host import STOP, OmplParameters, OmplProblem

SceneOf = Callable[[str], PlanningScene]
S_M = 0.02
PATIENCE = 120.0  # s of the wall in which what ends does end, also on a busy machine


def a_task(scene: PlanningScene, work: Work) -> tuple[Ends, FreeSpace]:
    task = scene.cell.task("tL->tR")
    return Ends(np.array(task.start), np.array([task.goal])), FreeSpace.of(scene, S_M, work)


def free_work(most: int = 10_000) -> Work:
    return Work(most, 1.0, lambda: 0.0)


def ticking() -> Work:
    """Work whose time is over after two hundred looks."""
    ticks = itertools.count()
    return Work(10_000_000, 1.0, lambda: 0.005 * next(ticks))


def in_time(act: Callable[[], Found]) -> Found | Exception:
    """What `act` returns or raises; a test that would wait for ever fails instead."""
    outcome: list[Found | Exception] = []

    def run() -> None:
        try:
            outcome.append(act())
        except Exception as error:
            outcome.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(PATIENCE)
    assert outcome, "the request has no end"
    return outcome[0]


def gone(process: int) -> bool:
    """Whether a process has ended: it is not there, or nobody has waited for it yet."""
    with suppress(FileNotFoundError, ProcessLookupError):
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    return True


def opened() -> Counter[str]:
    """What this process has open; of what tests before have left, some may be closed at any
    time.
    """
    found = Counter[str]()
    for number in os.listdir("/proc/self/fd"):
        with suppress(FileNotFoundError):
            found[os.readlink(f"/proc/self/fd/{number}")] += 1
    return found


@pytest.fixture
def charged(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[int], None]], None]:
    """Calls a function with the id of every process that answers, before it has its problem."""
    monkeypatch.setattr(host, "_charged", host._charged)  # as it was, afterwards

    def call(function: Callable[[int], None]) -> None:
        @contextmanager
        def charge(process: int) -> Iterator[None]:
            function(process)
            yield

        with_ompl.charge_to(charge)

    return call


@pytest.fixture
def loaded_host(scene_of: SceneOf) -> host.Host:
    """The process that has loaded OMPL."""
    ends, space = a_task(scene_of("table_columns"), free_work())
    assert SEARCHES["rrt_connect"].find(ends, space, 1).paths
    assert host._host is not None
    return host._host


@pytest.fixture
def stopped_host(loaded_host: host.Host) -> Iterator[host.Host]:
    """The same, which somebody has stopped."""
    os.kill(loaded_host._process.pid, signal.SIGSTOP)
    yield loaded_host
    with suppress(ProcessLookupError):
        os.kill(loaded_host._process.pid, signal.SIGCONT)


def test_a_stopped_host_costs_a_request_its_time_and_no_more(
    scene_of: SceneOf, stopped_host: host.Host
) -> None:
    ends, space = a_task(scene_of("table_columns"), ticking())
    found = in_time(lambda: SEARCHES["rrt"].find(ends, space, 1))
    assert isinstance(found, Found)
    assert found.paths == []
    assert "not ready within planning_time" in found.note
    assert space.work.truncated


def test_a_request_to_a_stopped_host_can_be_cancelled(
    scene_of: SceneOf, stopped_host: host.Host
) -> None:
    looks = itertools.count()
    work = Work(10_000_000, 1.0, lambda: 0.0, lambda: next(looks) > 3)
    ends, space = a_task(scene_of("table_columns"), work)
    assert isinstance(in_time(lambda: SEARCHES["rrt"].find(ends, space, 1)), CancelledError)


def test_a_host_that_answers_nobody_is_replaced(
    scene_of: SceneOf, stopped_host: host.Host, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop_waiting(loaded: host.Host) -> None:
        monkeypatch.setattr(host, "_PATIENCE", 24_000)  # the next one may take its time to load
        dropped(loaded)

    dropped = host._dropped
    monkeypatch.setattr(host, "_PATIENCE", 10)
    monkeypatch.setattr(host, "_dropped", stop_waiting)
    ends, space = a_task(scene_of("table_columns"), free_work())
    found = in_time(lambda: SEARCHES["rrt_connect"].find(ends, space, 1))
    assert isinstance(found, Found)
    assert found.paths
    assert host._host is not stopped_host
    assert gone(stopped_host._process.pid)


@pytest.mark.usefixtures("loaded_host")
def test_a_process_that_is_stopped_before_it_reads_a_long_problem(
    scene_of: SceneOf, charged: Callable[[Callable[[int], None]], None], wait_for: Any
) -> None:
    """More than a socket holds: a cell with many meshes."""
    seen: list[int] = []

    def stop(process: int) -> None:
        seen.append(process)
        os.kill(process, signal.SIGSTOP)

    charged(stop)
    ends, space = a_task(scene_of("table_columns"), ticking())
    long = FreeSpace(space.scene, np.zeros(1_000_000), space.work)
    found = in_time(lambda: SEARCHES["rrt"].find(ends, long, 1))
    assert isinstance(found, Found)
    assert found.paths == []
    wait_for(lambda: gone(seen[0]), what="the end of the process")


@pytest.mark.parametrize("name", ["kpiece", "prm"])
def test_a_process_that_is_killed_is_an_answer_without_a_path(
    name: str, scene_of: SceneOf, charged: Callable[[Callable[[int], None]], None]
) -> None:
    charged(lambda process: os.kill(process, signal.SIGKILL))
    ends, space = a_task(scene_of("table_columns"), free_work())
    found = in_time(lambda: SEARCHES[name].find(ends, space, 1))
    assert isinstance(found, Found)
    assert found.paths == []
    assert "ended without an answer" in found.note


def test_many_requests_leave_no_process_and_no_descriptor(
    scene_of: SceneOf, charged: Callable[[Callable[[int], None]], None], wait_for: Any
) -> None:
    seen: list[int] = []
    charged(seen.append)
    scene = scene_of("table_columns")

    def ask(seed: int) -> Counter[str]:
        ends, space = a_task(scene, free_work(400))
        SEARCHES["rrt_connect"].find(ends, space, seed)
        return opened()

    open_at_first = ask(0)
    assert [ask(seed) - open_at_first for seed in range(1, 20)] == [Counter()] * 19
    assert len(set(seen)) == 20
    wait_for(lambda: all(gone(process) for process in seen), what="the end of the processes")


@pytest.mark.skipif(bool(host.missing()), reason=host.missing())
def test_a_search_that_is_stopped_answers_what_it_has_found(
    scene_of: SceneOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    """AORRTC goes on improving its path until its checks are spent; here it is stopped long
    before.
    """
    ours, theirs = Pipe()
    affordable = worker._Counted._affordable
    stopped_at = 3_000
    sent: list[str] = []

    def stopping(counted: worker._Counted, states: int) -> bool:
        if not sent and counted.edges > stopped_at:
            sent.append(STOP)
            ours.send(STOP)
        return affordable(counted, states)

    monkeypatch.setattr(worker._Counted, "_affordable", stopping)
    ends, space = a_task(scene_of("table_columns"), free_work())
    parameters = OmplParameters("AORRTC", SEARCHES["aorrtc"].parameters())
    goals = ends.goals
    problem = OmplProblem(
        space.scene, space.threshold, ends.start, goals, parameters, 1, 1_000_000, 60.0
    )
    outcome = worker.solved(problem, theirs)
    assert outcome.path is not None
    assert stopped_at < outcome.edges < 2 * stopped_at


def test_at_the_end_of_the_work_the_process_is_asked_for_its_answer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(host, "_LAST_LOOKS", 24_000)  # two minutes, on a machine that is busy
    ours, theirs = Pipe()
    said: list[str] = []

    def answering() -> None:
        said.append(theirs.recv())
        theirs.send(True)

    thread = threading.Thread(target=answering, daemon=True)
    thread.start()
    assert host._has_answered(ours, Work(10, 0.0, lambda: 0.0))
    thread.join(PATIENCE)
    assert said == [STOP]


def test_a_process_that_does_not_answer_at_the_end_is_waited_for_no_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ours, _theirs = Pipe()
    assert not host._has_answered(ours, ticking())
    monkeypatch.setattr(host, "_LAST_LOOKS", 3)
    assert not host._has_answered(ours, Work(10, 0.0, lambda: 0.0))  # whose clock stands


ASKING = """
import sys
from contextlib import contextmanager
import numpy as np
from ir_planner import Planner
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.search import SEARCHES, Ends, with_ompl
from ir_planner.search.with_ompl import host, worker
from ir_planner.search.with_ompl.host import STOP, OmplParameters, OmplProblem

@contextmanager
def charge(process):
    print(host._host._process.pid, process, flush=True)
    yield

with_ompl.charge_to(charge)
planner = Planner("table_columns", clock=lambda: 0.0)
task = planner.cell.task("tL->tR")
space = FreeSpace.of(planner.scene(), 0.02, Work(10**12, 1.0, lambda: 0.0))
beyond = np.array([task.goal]) + 50.0  # of every range: nobody gets there
SEARCHES[sys.argv[1]].find(Ends(np.array(task.start), beyond), space, 1)
"""


@pytest.mark.long
@pytest.mark.parametrize("stopped", [False, True])
def test_what_a_planner_that_is_killed_leaves_ends(stopped: bool, wait_for: Any) -> None:
    asking = subprocess.Popen(
        [sys.executable, "-c", ASKING, "rrt"], stdout=subprocess.PIPE, text=True
    )
    assert asking.stdout is not None
    loaded, process = map(int, asking.stdout.readline().split())
    assert not gone(process)
    if stopped:
        os.kill(process, signal.SIGSTOP)
    asking.kill()
    asking.wait()
    asking.stdout.close()
    wait_for(lambda: gone(loaded) and gone(process), what="the end of both processes")


def test_two_threads_get_the_paths_that_each_gets_alone(scene_of: SceneOf) -> None:
    """Who asks beside whom changes nothing."""
    scene = scene_of("table_columns")

    def paths(seed: int) -> list[bytes]:
        ends, space = a_task(scene, free_work(2_000))
        found = SEARCHES["bkpiece"].find(ends, space, seed)
        return [path.tobytes() for path in found.paths]

    alone = [paths(seed) for seed in (1, 2)]
    beside: dict[int, list[bytes]] = {}
    threads = [
        threading.Thread(target=lambda seed=seed: beside.update({seed: paths(seed)}))
        for seed in (2, 1)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
    assert [beside.get(1), beside.get(2)] == alone
