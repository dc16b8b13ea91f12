"""`ir new search`: the package is installed as it is written, and reaches whatever asks by name."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from ir_cli.main import main

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


def run(site: Path, *words: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, *words],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        cwd=site,
    )


def test_it_plans_by_its_name_and_says_whose_it_is(site: Path) -> None:
    words = ("-m", "ir_cli.main", "ask", "move", "demo", "home", "park", "--json")
    answer = run(site, *words, "--planner", NAME)
    assert answer.returncode == 0, answer.stderr
    assert f"planner {NAME} is of the package ir-search-over-the-top 0.1.0" in answer.stdout


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
    assert "10 passed" in answer.stdout


@pytest.mark.long
def test_it_reaches_workers_of_the_arena(site: Path, tmp_path: Path) -> None:
    (tmp_path / "arena.yaml").write_text(SETTINGS)
    words = ("-m", "ir_cli.main", "study", "arena", str(tmp_path / "arena.yaml"), "--workers", "1")
    answer = run(site, *words, "-o", str(tmp_path / "out"))
    assert answer.returncode == 0, answer.stderr
    rows = (tmp_path / "out" / "results.jsonl").read_text()
    assert "ir-search-over-the-top 0.1.0 (searches: over_the_top)" in rows


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
