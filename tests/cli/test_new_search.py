"""`ir new search`: the package is installed as it is written, and reaches whatever asks by name."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from ir_cli.main import main
from ir_msgs_py.ros.testing import PATIENCE, WaitFor, own_domain

NAME = "over_the_top"
SETTINGS = f"""\
format: ir_arena/1
planners: [{NAME}]
cells: [open]
tasks: [home->p1]
seeds: 1
seconds: 0.05
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the package as pip installs it."""
    folder = tmp_path_factory.mktemp("search")
    assert main(["new", "search", NAME, "-o", str(folder / "package")]) == 0
    options = ("--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--target")
    pip = [sys.executable, "-m", "pip", "install", *options, str(folder / "site")]
    subprocess.run([*pip, str(folder / "package")], check=True)
    return folder / "site"


def environment(site: Path) -> dict[str, str]:
    """Of a process that finds the package and only nodes of this host."""
    path = os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")])
    found = {**os.environ, "PYTHONPATH": path, "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}
    return {**found, "ROS_DOMAIN_ID": str(own_domain())}


def run(site: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *words],
        env=environment(site),
        capture_output=True,
        text=True,
        cwd=site,
    )


@contextlib.contextmanager
def running(site: Path, *words: str) -> Iterator[None]:
    """A process that is there meanwhile."""
    process = subprocess.Popen(
        [sys.executable, *words], env=environment(site), cwd=site, start_new_session=True
    )
    try:
        yield
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(PATIENCE)
        finally:
            process.kill()


@pytest.mark.long
def test_it_plans_by_its_name_and_says_whose_it_is(site: Path) -> None:
    words = ("-m", "ir_cli.main", "ask", "move", "demo", "home", "park", "--json")
    answer = run(site, *words, "--planner", NAME)
    assert answer.returncode == 0, answer.stderr
    assert f"planner {NAME} is of the package ir-search-over-the-top 0.1.0" in answer.stdout


@pytest.mark.long
def test_it_keeps_the_tool_upright(site: Path) -> None:
    words = (
        "-m",
        "ir_cli.main",
        "ask",
        "move",
        "demo",
        "home",
        "A1 30 A2 -90 A3 90 A4 0 A5 0 A6 0",
    )
    answer = run(site, *words, "--tilt-max", "5", "--planner", NAME)
    assert answer.returncode == 0, answer.stderr


@pytest.mark.long
def test_no_default_asks_it(site: Path) -> None:
    words = ("-m", "ir_cli.main", "ask", "move", "demo", "home", "park", "--json")
    with_it = json.loads(run(site, *words).stdout)
    assert with_it == json.loads(run(site.parent, *words).stdout)


@pytest.mark.long
def test_it_passes_the_contract(site: Path) -> None:
    words = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "--pyargs", "ir_planner.contract")
    answer = run(site, *words, "-k", NAME)
    assert answer.returncode == 0, answer.stdout
    assert "11 passed" in answer.stdout


@pytest.mark.long
def test_it_reaches_workers_of_the_arena(site: Path, tmp_path: Path) -> None:
    (tmp_path / "arena.yaml").write_text(SETTINGS)
    words = ("-m", "ir_cli.main", "study", "arena", str(tmp_path / "arena.yaml"), "--workers", "1")
    answer = run(site, *words, "-o", str(tmp_path / "out"))
    assert answer.returncode == 0, answer.stderr
    rows = (tmp_path / "out" / "results.jsonl").read_text()
    assert "ir-search-over-the-top 0.1.0 (searches: over_the_top)" in rows


@pytest.mark.long
def test_it_reaches_workers_of_a_dask_cluster(
    site: Path, tmp_path: Path, wait_for: WaitFor
) -> None:
    pytest.importorskip("distributed")
    (tmp_path / "arena.yaml").write_text(SETTINGS)
    said = tmp_path / "scheduler.json"
    here = ("--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(said))
    dask = ("-m", "distributed.cli.dask_scheduler", *here, "--port", "0")
    with running(site, *dask):
        wait_for(said.is_file, what="the scheduler listens")
        address = wait_for(lambda: address_in(said), what="the scheduler says where")
        alone = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1")
        with running(site, "-m", "distributed.cli.dask_worker", address, *alone):
            arena = ("-m", "ir_cli.main", "study", "arena", str(tmp_path / "arena.yaml"))
            answer = run(site, *arena, "--scheduler", address, "-o", str(tmp_path / "out"))
    assert answer.returncode == 0, answer.stderr
    rows = (tmp_path / "out" / "results.jsonl").read_text()
    assert "ir-search-over-the-top 0.1.0 (searches: over_the_top)" in rows


def address_in(file: Path) -> str:
    """What a scheduler wrote, "" while it has not."""
    try:
        return str(json.loads(file.read_text())["address"])
    except ValueError:
        return ""


@pytest.mark.long
def test_a_running_planner_node_plans_with_it_by_name(site: Path) -> None:
    planner = "from ir_planner.node import main; main()"
    request = (
        "{start: {position: [0.0, -1.5708, 1.5708, 0.0, 0.0, 0.0]}, "
        "goal: 'A1 30 A2 -100 A3 100 A4 0 A5 20 A6 0', options: {planner_id: NAME}}"
    )
    call = ("-m", "ir_cli.main", "ros", "call", "/ir_planner/plan_regional_movement")
    with running(site, "-c", planner, "--ros-args", "-p", "cell:=demo"):
        answer = run(site, *call, request.replace("NAME", NAME), "--timeout", str(PATIENCE))
        assert answer.returncode == 0, answer.stdout + answer.stderr
        assert f"planner_id: {NAME}" in answer.stdout
        wrong = run(site, *call, request.replace("NAME", "none"), "--timeout", str(PATIENCE))
    assert wrong.returncode == 1
    assert NAME in wrong.stdout + wrong.stderr


@pytest.mark.long
def test_the_node_has_its_settings_as_parameters(site: Path) -> None:
    code = (
        "from ir_planner import PlannerSettings; from ir_values.settings import tree; "
        f"print(tree(PlannerSettings())['{NAME}.vias'].default)"
    )
    assert run(site, "-c", code).stdout == "200\n"


@pytest.mark.parametrize("name", ["tree", "withdrawal", "9lives", "Big", "class", "a-b", "_x"])
def test_a_name_that_is_taken_or_none_is_refused(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new", "search", name, "-o", str(tmp_path / "package")]) == 2
    assert name in capsys.readouterr().err
    assert not (tmp_path / "package").exists()


def test_the_folder_does_not_hide_the_installed_module(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python takes a folder beside it for a package where pip installed the module as editable."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "search", NAME]) == 0
    (folder,) = tmp_path.iterdir()
    assert (folder / f"ir_search_{NAME}.py").is_file()
    assert folder.name != f"ir_search_{NAME}"


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    folder = tmp_path / "package"
    assert main(["new", "search", NAME, "-o", str(folder)]) == 0
    before = (folder / "pyproject.toml").read_text()
    assert main(["new", "search", NAME, "-o", str(folder)]) == 1
    assert (folder / "pyproject.toml").read_text() == before
