"""A settings file without sense is refused with the key, its value and what it may be."""

from __future__ import annotations

import os
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest

from ir_description import load_cell
from ir_msgs_py.options import PlanOptions
from ir_planner import RequestError
from ir_planner.request import checked_options
from ir_planner.search.with_ompl import host
from ir_studies.arena import EXAMPLE, PORTFOLIO, ArenaSettings, read_settings
from ir_studies.arena.settings import entries, tasks_of
from ir_studies.errors import SettingsError

HEAD = "format: ir_arena/1\n"


def written(tmp_path: Path, content: str) -> Path:
    path = tmp_path / "arena.yaml"
    path.write_text(content)
    return path


def test_the_example_is_read_and_names_every_key(tmp_path: Path) -> None:
    settings = read_settings(written(tmp_path, EXAMPLE))
    assert settings.planners[0] == PORTFOLIO
    assert {"sbl", "kpiece", "bkpiece", "lbkpiece", "prm", "rrt", "rrt_connect", "aorrtc"} <= set(
        settings.planners
    )
    for name in vars(settings):
        assert f"\n{name}:" in EXAMPLE
    assert len(entries(settings)) == 11 * 10 * 2 * sum((6, 7, 6, 6))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "the file is empty"),
        ("- 1\n", "format: ir_arena/1"),
        ("format: ir_cell/1\ncells: [open]\n", "format: ir_arena/1"),
        ("{[", "is not YAML"),
        (HEAD, "cells are missing"),
        (
            HEAD + "cells: [open]\nseeds: 2\nseeds: 3\n",
            "'seeds' stands here twice, first in",
        ),
        (HEAD + "cells: []\n", "cells is empty"),
        (HEAD + "cells: open\n", "cells is 'open': it must be a list of names"),
        (HEAD + "cells: [oven]\n", "oven"),
        (HEAD + "cells: [open, open]\n", "names one twice"),
        (HEAD + "cells: [cell.yaml, ./cell.yaml]\n", "cells names one twice"),
        (
            HEAD + "cells: [open]\nplaners: [sbl]\n",
            "'planers' is unknown; known are cells, planners",
        ),
        (
            HEAD + "cells: [open]\nplanners: [teleport]\n",
            "'teleport' is unknown; known are portfolio, direct",
        ),
        (HEAD + "cells: [open]\ntasks: [a->b]\n", "'a->b' is unknown; known are home->p1"),
        (HEAD + "cells: [open]\nloads: [anvil]\n", "anvil"),
        (HEAD + "cells: [open]\ntimings: [slow]\n", "known are synchronous, asynchronous"),
        (
            HEAD + "cells: [open]\nseeds: 0\n",
            "seeds is 0: it must be a whole number in 1 .. 100000",
        ),
        (HEAD + "cells: [open]\nseeds: 1.5\n", "seeds is 1.5: it must be a whole number"),
        (HEAD + "cells: [open]\nseeds: true\n", "seeds is True"),
        (
            HEAD + "cells: [open]\nseconds: .nan\n",
            "seconds is nan: it must be a number in 0.01 .. 86400",
        ),
        (HEAD + "cells: [open]\nseconds: -1\n", "seconds is -1"),
        (HEAD + "cells: [open]\nseconds: soon\n", "seconds is 'soon'"),
        (HEAD + "cells: [open]\nsafety_distance: 1e400\n", "safety_distance is"),
        (HEAD + "cells: [open]\ntime_value: 2e6\n", "time_value is '2e6'"),
        (
            HEAD + "cells: [open]\ntime_value: 2.0e+6\n",
            "time_value is 2000000.0: it must be a number in 0 .. 1e+06",
        ),
        (
            HEAD + "cells: [open]\nsafety_distance: 2\n",
            "safety_distance is 2: it must be a number in 0 .. 1",
        ),
        (HEAD + "cells: [open]\n? [a]\n: 1\n", "a key must be a word"),
    ],
)
def test_what_makes_no_sense_is_refused(tmp_path: Path, content: str, said: str) -> None:
    with pytest.raises(SettingsError) as refused:
        read_settings(written(tmp_path, content))
    assert said in str(refused.value)
    assert "arena.yaml" in str(refused.value)


def test_a_million_runs_are_enough(tmp_path: Path) -> None:
    settings = ArenaSettings(cells=("open",), seeds=100_000)
    with pytest.raises(
        SettingsError, match=r"these are 1200000 runs, 13\.9 days of one core: at most 1000000"
    ):
        entries(settings)


def test_a_planner_of_ompl_without_ompl_is_refused_before_anything_runs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(host, "find_spec", lambda name: None)
    with pytest.raises(SettingsError, match=r"planners: prm, rrt: OMPL is missing: pip install"):
        ArenaSettings(cells=("open",), planners=("sbl", "prm", "rrt"))
    ArenaSettings(cells=("open",), planners=("sbl", PORTFOLIO))


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"nowhere.yaml can't be read: No such file"):
        read_settings(tmp_path / "nowhere.yaml")


def test_what_is_no_file_is_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")  # reading it would wait for ever
    for path in (tmp_path / "pipe.yaml", Path("/dev/zero"), tmp_path):
        with pytest.raises(SettingsError, match="is no file with settings"):
            read_settings(path)


@pytest.mark.parametrize(("key", "most"), [("time_value", 1e6), ("safety_distance", 1.0)])
def test_the_planner_takes_what_the_settings_allow(key: str, most: float) -> None:
    for beyond in (False, True):
        value = most * 1.01 if beyond else most
        with pytest.raises(SettingsError) if beyond else nullcontext():
            ArenaSettings(cells=("open",), **{key: value})
        with pytest.raises(RequestError) if beyond else nullcontext():
            checked_options(PlanOptions(**{key: value}))


def test_a_task_that_leads_back_by_another_path_keeps_its_name() -> None:
    cell = load_cell("open")
    there = cell.task("home->p1")
    back = replace(cell.task("p1->p2"), name="p1->home")
    for tasks in ((there, back), (back, there)):
        found = tasks_of(replace(cell, tasks=tasks))
        assert set(found) == {"home->p1", "home->p1 back", "p1->home", "p1->home back"}
        assert tuple(found["p1->home"][0]) == tuple(back.start)
        assert tuple(found["home->p1 back"][0]) == tuple(there.goal)
