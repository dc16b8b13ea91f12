"""A Dask cluster gives the same bytes, whatever dies in it; the long tests start real processes."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ir_studies import LayoutSettings, Means, StoppedError, run_layout
from ir_studies.errors import StudyError
from ir_studies.layout import Layouts
from ir_studies.work import cluster
from ir_studies.work.results import NAME

SETTINGS = LayoutSettings(
    cell="demo",
    base={"x": (-0.3, 0.3), "y": (-0.3, 0.3)},
    stations=("infeed_pick", "gauge_measure"),
    placements=12,
    rounds=2,
    keep=2,
    seeds=1,
)


def test_without_dask_a_sentence_says_how_to_install_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(StudyError, match=r'pip install "ir_studies\[cluster\]"'):
        run_layout(SETTINGS, tmp_path, Means(scheduler="tcp://127.0.0.1:1"))


@pytest.mark.parametrize(
    "address",
    ["nonsense", "tcp://", "tcp://host", "tcp://127.0.0.1:abc", "tcp://127.0.0.1:0", "tcp://127.0.0.1:65536",
     "foo://127.0.0.1:1", "tcp://a b:8786", "tcp://127.0.0.1:8786 ", "--preload=x:1"],
)  # fmt: skip
def test_words_that_are_no_address_are_refused_before_anybody_waits(address: str) -> None:
    with pytest.raises(
        StudyError, match=r"it must be an address with a port .* as tcp://127\.0\.0\.1:8786"
    ):
        Means(scheduler=address)


@pytest.mark.parametrize("address", ["127.0.0.1:1", "tcp://host-1.lan:8786", "tls://[::1]:8786"])
def test_addresses_of_schedulers_are_taken(address: str) -> None:
    assert Means(scheduler=address).scheduler == address


@pytest.fixture
def processes() -> Iterator[list[subprocess.Popen[bytes]]]:
    """Processes of a test, which end with it."""
    started: list[subprocess.Popen[bytes]] = []
    yield started
    for process in started:
        process.kill()
        process.wait()


def dask(
    processes: list[subprocess.Popen[bytes]], folder: Path, *words: str
) -> subprocess.Popen[bytes]:
    """Starts a scheduler or a worker."""
    command = [sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]]
    with (folder / f"{words[0]}_{len(processes)}.log").open("wb") as log:
        process = subprocess.Popen(
            command, stdout=log, stderr=log, cwd=folder, start_new_session=True
        )
    processes.append(process)
    return process


def scheduler(processes: list[subprocess.Popen[bytes]], folder: Path, wait_for: Any) -> str:
    """Starts a scheduler on a free port; its address."""
    said = folder / f"scheduler_{len(processes)}.json"
    words = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(said))
    dask(processes, folder, "scheduler", *words)

    def address() -> str:
        try:
            return str(json.loads(said.read_text())["address"])
        except (OSError, ValueError):  # not yet, or not whole
            return ""

    return str(wait_for(address, what="the scheduler listens"))


def worker(
    processes: list[subprocess.Popen[bytes]], folder: Path, address: str
) -> subprocess.Popen[bytes]:
    """Starts a worker of one thread, without a nanny that would start it again."""
    words = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1")
    return dask(processes, folder, "worker", address, *words)


def same(one: Layouts, other: Layouts) -> None:
    assert one.summary == other.summary
    for mine, theirs in zip(one.files, other.files, strict=True):
        assert mine.read_bytes() == theirs.read_bytes(), mine.name


@pytest.mark.long
def test_two_workers_of_which_one_is_killed_meanwhile_give_the_same_bytes(
    processes: list[subprocess.Popen[bytes]], tmp_path: Path, wait_for: Any
) -> None:
    alone = run_layout(SETTINGS, tmp_path / "alone", Means(2))
    address = scheduler(processes, tmp_path, wait_for)
    workers = [worker(processes, tmp_path, address) for _ in range(2)]
    killed: list[int] = []
    children: list[int] = []

    def kill(phase: str, done: int, of: int, best: str) -> None:
        if done == 5 and not killed:
            children.extend(children_of(workers[0].pid))
            os.kill(workers[0].pid, signal.SIGKILL)
            killed.append(workers[0].wait())

    found = run_layout(SETTINGS, tmp_path / "cluster", Means(scheduler=address, progress=kill))
    assert killed == [-signal.SIGKILL]
    same(alone, found)
    assert children
    wait_for(lambda: not any(map(alive, children)), what="nothing of the dead worker is left")


@pytest.mark.long
def test_a_scheduler_that_is_killed_meanwhile_ends_the_study_which_goes_on_later(
    processes: list[subprocess.Popen[bytes]], tmp_path: Path, wait_for: Any
) -> None:
    address = scheduler(processes, tmp_path, wait_for)
    worker(processes, tmp_path, address)

    def kill(phase: str, done: int, of: int, best: str) -> None:
        if done == 3:
            processes[0].kill()

    with pytest.raises(StudyError, match="the scheduler is gone"):
        run_layout(SETTINGS, tmp_path / "both", Means(scheduler=address, progress=kill))
    assert (tmp_path / "both" / NAME).read_bytes().count(b"\n") >= 3
    same(
        run_layout(SETTINGS, tmp_path / "alone", Means(1)),
        run_layout(SETTINGS, tmp_path / "both", Means(1)),
    )


@pytest.mark.long
def test_a_local_cluster_gives_the_same_bytes_and_ends_what_it_started(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    alone = run_layout(SETTINGS, tmp_path / "alone", Means(1))
    seen: list[int] = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=2, processes=True, host="127.0.0.1", dashboard_address=None
    ) as local:
        address = local.scheduler_address
        stopped = Means(
            scheduler=address, progress=lambda *_: seen.append(1), stopped=lambda: len(seen) > 4
        )
        with pytest.raises(StoppedError):
            run_layout(SETTINGS, tmp_path / "cluster", stopped)
        assert (tmp_path / "cluster" / NAME).read_bytes().count(b"\n") > 4
        same(alone, run_layout(SETTINGS, tmp_path / "cluster", Means(scheduler=address)))
        with distributed.Client(address) as client:
            assert set(client.run(pools).values()) == {0}


@pytest.mark.long
def test_nobody_or_no_scheduler_at_the_address_and_other_builds_are_refused(
    processes: list[subprocess.Popen[bytes]],
    tmp_path: Path,
    wait_for: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(cluster, "_CONNECT_S", 2.0)
    with pytest.raises(StudyError, match="no Dask scheduler answers at"):
        run_layout(SETTINGS, tmp_path / "a", Means(scheduler="tcp://127.0.0.1:1"))
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        with pytest.raises(StudyError, match=r"no Dask scheduler answers at .* nothing within 2 s"):
            run_layout(
                SETTINGS,
                tmp_path / "a",
                Means(scheduler=f"tcp://127.0.0.1:{silent.getsockname()[1]}"),
            )
    monkeypatch.setattr(cluster, "_CONNECT_S", 10.0)  # a busy machine's scheduler answers within it
    address = scheduler(processes, tmp_path, wait_for)
    with pytest.raises(StudyError, match="has no worker: start one, dask worker"):
        run_layout(SETTINGS, tmp_path / "b", Means(scheduler=address))
    worker(processes, tmp_path, address)
    monkeypatch.setattr(cluster, "_CONNECT_S", 60.0)
    monkeypatch.setattr(cluster, "computed_with", lambda kind: "an abacus")
    with pytest.raises(StudyError, match="not with an abacus"):
        run_layout(replace(SETTINGS, placements=2), tmp_path / "c", Means(scheduler=address))


def pools() -> int:
    """In a worker of the cluster: how many pools it has."""
    return len(cluster._kept)


def children_of(pid: int) -> list[int]:
    """Processes that a process has started."""
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for file in tasks for child in file.read_text().split()]


def alive(pid: int) -> bool:
    """Whether a process runs: not one that nobody has collected yet."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
