"""The search finds what an exhaustive one finds, gives the same again, and says what is
impossible.
"""

from __future__ import annotations

import csv
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ir_description import cell_to_yaml, load_cell
from ir_planner import Planner
from ir_studies import LayoutSettings, Means, run_layout
from ir_studies.errors import StoppedError, StudyError
from ir_studies.layout import Layouts, search
from ir_studies.layout.placement import Placement
from ir_studies.layout.search import points
from ir_studies.layout.settings import read_layout
from ir_studies.layout.summary import Final
from ir_studies.work.results import NAME

WORKER = Path(__file__).with_name("fake_layout_worker.py")
Laid = Callable[..., Layouts]
GRID = LayoutSettings(
    cell="demo",
    base={"x": (-0.5, 0.5), "y": (-0.5, 0.5)},
    method="grid",
    steps=11,
    keep=2,
    seeds=2,
)
SPREAD = replace(GRID, method="spread", placements=120, rounds=3)


@pytest.fixture
def laid(tmp_path: Path) -> Laid:
    """Runs a study with workers that plan nothing."""

    def run(settings: LayoutSettings, folder: str = "out", *faults: str, **means: Any) -> Layouts:
        command = (sys.executable, "-S", str(WORKER), str(tmp_path), *faults)
        return run_layout(settings, tmp_path / folder, Means(2, command=command, **means))

    return run


def best_cost(found: Layouts) -> float:
    return min(one.cost for one in found.known if math.isfinite(one.cost))


def test_the_best_of_a_grid_is_never_left_out(laid: Laid) -> None:
    bounded = laid(GRID, "a")
    everything = laid(replace(GRID, margin=1000.0), "b")
    planned = [sum(one.planned for one in found.known) for found in (bounded, everything)]
    assert planned[1] == sum(math.isfinite(one.coarse) for one in everything.known) == 121 - 11
    assert planned[0] < planned[1] / 2
    assert best_cost(bounded) == best_cost(everything)


@pytest.mark.long
def test_rounds_come_nearer_than_a_first_look(laid: Laid) -> None:
    rounds = laid(SPREAD, "a")
    once = laid(replace(SPREAD, rounds=1), "b")
    assert best_cost(rounds) < best_cost(once)
    assert best_cost(rounds) < 1032.0  # 1030 is the least that any can have


def test_interrupted_hanging_and_dying_it_leaves_the_same_files(laid: Laid, tmp_path: Path) -> None:
    whole = laid(SPREAD, "whole")
    seen: list[int] = []
    with pytest.raises(StoppedError):
        laid(SPREAD, "again", progress=lambda *one: seen.append(1), stopped=lambda: len(seen) > 70)
    lines = (tmp_path / "again" / NAME).read_bytes()
    (tmp_path / "again" / NAME).write_bytes(lines[:-20])  # as a power loss leaves it
    again = laid(SPREAD, "again", "die")
    for one, other in zip(whole.files, again.files, strict=True):
        assert one.read_bytes() == other.read_bytes(), one.name
    assert whole.summary == again.summary


@pytest.mark.long
def test_more_placements_are_added_to_a_folder_and_other_budgets_refused(laid: Laid) -> None:
    laid(SPREAD)
    made: list[str] = []
    laid(replace(SPREAD, keep=3), progress=lambda phase, *_: made.append(phase))
    assert 0 < len(made) < 100
    with pytest.raises(StudyError, match=r"results with time_value 500.0, the settings have 100.0"):
        laid(replace(SPREAD, time_value=100.0))


@pytest.mark.long
def test_a_given_placement_that_hangs_is_cut_and_said(laid: Laid) -> None:
    found = laid(replace(SPREAD, placements=40, hang_after=2.0), "out", "hang")
    assert found.known[0].reason == ("cut", "no answer within 2 s")
    assert "The given placement is impossible itself: no answer within 2 s" in found.summary


def test_what_is_left_behind(laid: Laid, tmp_path: Path) -> None:
    settings = replace(SPREAD, cycle_times=(0.0, 10.0), placements=40)
    found = laid(settings)
    with (tmp_path / "out" / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * len(found.known)
    assert {row["state"] for row in rows} == {"planned", "looked at", "impossible"}
    assert {row["reason"] for row in rows} == {"", "out of reach"}
    best = found.finals[1][0].placement.values
    cell = load_cell(str(tmp_path / "out" / "best_1.yaml"))
    given = load_cell("demo")
    shift = (cell.base_pose - given.base_pose)[:2, 3]
    assert shift == pytest.approx([best["base.x"], best["base.y"]], abs=1e-12)
    page = (tmp_path / "out" / "index.html").read_text()
    assert "https://" not in page
    assert "{{" not in page
    assert "held against the planned program of the layout as given" in page.partition("<main>")[0]
    answer = page.partition('id="answer"')[2].partition("</section>")[0]
    assert "<b>Not worth moving: " in answer or "No placement is shown to save" in answer
    assert "planned with one seed" in answer or "2 searches from different seeds" in answer
    assert ("planned with one seed" in answer) == (">one seed</td>" in page)
    assert '<p class="verdict open">Leave as it stands</p>' in page
    plan = page.partition('class="plan whole"')[2].partition("</svg>")[0]
    centimetres = 100.0 * float(np.hypot(*shift))
    assert f">base {centimetres:.0f} cm</text>" in plan
    assert plan.count('class="best"') == 1  # only what moved is drawn anew
    assert "Leave everything where it stands" in answer or "Plan best_1.yaml" in answer
    assert "90 % interval" in answer
    assert (
        page.count('class="given"') > page.partition('class="maps"')[0].count('class="given"') > 0
    )
    assert "of a cycle as given are all energy at the mains" in page
    assert "station infeed_pick is too far" in page
    table = list(csv.DictReader(found.table.splitlines()))
    assert [row["rank"] for row in table] == ["0", "0", "1", "1", "2", "2"]
    least = table[2]
    saved = float(table[0]["energy_j"]) - float(least["energy_j"])
    assert float(least["saved_j"]) == pytest.approx(saved, abs=2e-3)
    # robots add 10 % of the joules at most: of a difference 10 % of the difference
    assert float(least["saved_high_j"]) == pytest.approx(1.09 * saved, rel=0.02)


FULL = """
import sys
sys.path[:0] = {path!r}
from ir_studies import Means, run_layout
from ir_studies.layout.settings import read_layout
from ir_studies.layout.summary import Final
from ir_studies.errors import StudyError
try:
    run_layout(read_layout({settings!r}), {folder!r}, Means(1, command={command!r}))
except StudyError as error:
    sys.exit(str(error))
"""


@pytest.mark.long
def test_a_full_disk_ends_it_with_a_sentence_and_it_goes_on_when_there_is_room(
    laid: Laid, tmp_path: Path
) -> None:
    settings = tmp_path / "layout.yaml"
    settings.write_text(
        "format: ir_layout/1\ncell: demo\nbase: {x: [-0.5, 0.5]}\nplacements: 40\nrounds: 1\n"
    )
    command = (sys.executable, "-S", str(WORKER), str(tmp_path))
    places = {"settings": str(settings), "folder": str(tmp_path / "full"), "command": command}
    script = FULL.format(path=sys.path, **places)
    words = [
        "sh",
        "-c",
        'ulimit -f 4; exec "$@"',
        "sh",
        sys.executable,
        "-c",
        script,
    ]  # blocks of 512 bytes
    # CPython would leave bytecode behind that is cut at the limit, for everybody who imports it
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    ended = subprocess.run(words, capture_output=True, text=True, check=False, env=environment)
    assert ended.returncode == 1
    assert "results.jsonl can't be written: File too large" in ended.stderr
    assert "Traceback" not in ended.stderr
    whole = laid(read_layout(settings), "whole")
    assert laid(read_layout(settings), "full").summary == whole.summary


def test_where_nothing_is_possible_the_study_says_why(laid: Laid) -> None:
    found = laid(replace(SPREAD, base={"x": (0.45, 0.5)}, placements=10, rounds=2))
    assert found.finals[0][0].is_given
    assert "None of the others is possible" in found.summary
    assert "out of reach 5" in found.summary


def test_where_the_given_placement_is_the_best_the_study_says_so(laid: Laid) -> None:
    said = laid(replace(SPREAD, base={"x": (-0.9, -0.5)}, placements=20)).summary
    assert "The given placement is the best of those that were planned" in said
    assert "Best of the others (" in said
    assert re.search(r"It takes more: [\d.]+ k?Wh, ", said)
    assert "zero lies in it" not in said


def test_the_placement_as_given_is_the_program_that_a_plan_has() -> None:
    """A study planned from `park`, a plan from where its program ends: one program had 408.9 kJ on
    one page and 407.0 kJ on the other.
    """
    stations = ("p1", "home")
    settings = LayoutSettings(cell="open", stations=stations, base={"x": (-0.1, 0.1)})
    words = {"stage": "plan", "values": {}, "payload": {}, "cycle_time": 0.0, "seed": 0}
    made = search.row_maker({**settings.budget, "cell_yaml": cell_to_yaml(load_cell("open"))})
    row = made(words)
    plan = Planner("open", clock=lambda: 0.0).plan_program(stations=stations)
    assert row["energy_j"] == plan.report.energy
    assert row["duration_s"] == plan.report.duration


def test_a_year_of_a_layout_has_the_cycles_that_a_plan_of_it_has() -> None:
    """5 829 cycles on the page of a layout, of its own time, and 5 818 on that of its plan, of the
    common program's.
    """
    stations = ("p1", "home")
    settings = LayoutSettings(cell="open", stations=stations, base={"x": (-0.1, 0.1)})
    words = {"stage": "plan", "values": {}, "payload": {}, "cycle_time": 0.0, "seed": 0}
    made = search.row_maker({**settings.budget, "cell_yaml": cell_to_yaml(load_cell("open"))})
    own = made(words)
    given = made({**words, "robots": True})
    plan = Planner("open", clock=lambda: 0.0).plan_program(stations=stations, savings=True)
    final = Final(Placement({}), settings.conditions[0], (given,))
    assert final.pace == plan.savings.total.seconds != plan.report.duration
    assert {name: given[name] for name in own} == own  # the program is the same
    moved = made({**words, "values": {"base.x": 0.1}, "robots": True})
    assert "common_s" not in moved  # its cycles are those of the given one


def test_only_the_given_placement(laid: Laid) -> None:
    assert (
        "No other was looked at: the given placement stays."
        in laid(replace(SPREAD, placements=1)).summary
    )


def test_why_the_others_were_not_planned(laid: Laid) -> None:
    by_bound = laid(replace(GRID, plans=100), "a").summary
    said = r"the coarse cost of any of the \d\d planned, less 1 % of that, they would cost more"
    assert re.search(said, by_bound)
    assert "at most 16 plans were asked for" in laid(replace(GRID, plans=16), "b").summary


@pytest.mark.long
def test_where_the_bound_left_out_nothing_the_study_says_so(laid: Laid) -> None:
    few = laid(replace(GRID, steps=3), "few").summary
    assert (
        "All that a look found possible were planned, the bound left out none: the first 16 are "
        "planned before there is a bound." in few
    )
    every = laid(replace(GRID, steps=5, margin=1000.0), "every").summary
    assert "the bound left out none." in every
    for one, name in ((GRID, "bounded"), (replace(SPREAD, placements=1), "given")):
        assert "left out none" not in laid(one, name).summary


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (
            {},
            "Placements are compared by energy of the drives + 500 W x seconds of the movements.",
        ),
        ({"cycle_times": (9.0,)}, "Placements are compared by energy at the mains per cycle."),
        (
            {"cycle_times": (0.0, 9.0), "time_value": 80.0},
            "Placements are compared by energy of the drives + 80 W x seconds of the "
            "movements without a "
            "cycle time, by energy at the mains per cycle in one, mean over 2 conditions.",
        ),
    ],
)
def test_it_is_said_what_placements_are_compared_by(
    laid: Laid, tmp_path: Path, asked: dict[str, Any], said: str
) -> None:
    assert said in laid(replace(SPREAD, placements=20, **asked)).summary
    assert f'<p class="hint">{said}</p>' in (tmp_path / "out" / "index.html").read_text()


def test_what_stands_as_given_is_no_part_of_a_job(laid: Laid) -> None:
    known = laid(replace(GRID, steps=5)).known
    assert known[0].placement.values == {}
    assert known[0].placement.plan(GRID.conditions[0]).words["values"] == {}
    beside = [one.placement.values for one in known if len(one.placement.values) == 1]
    assert len(beside) == 8


def test_rounds_go_on_over_all_ranges_while_nothing_is_possible(laid: Laid, tmp_path: Path) -> None:
    far = cell_to_yaml(replace(load_cell("demo"), name="far"))
    (tmp_path / "far.yaml").write_text(far)
    settings = replace(
        SPREAD, cell=str(tmp_path / "far.yaml"), base={"x": (0.45, 0.9), "y": (0.0, 0.5)}
    )
    found = laid(replace(settings, placements=60), "out", "nowhere")
    assert len(found.known) == 60
    assert "No placement is possible." in found.summary


def test_the_cell_of_a_study_is_the_one_that_it_began_with(laid: Laid, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(cell_to_yaml(load_cell("demo")))

    def edited(*_: object) -> None:
        path.write_text("format: ir_cell/1\nname: half saved")

    found = laid(replace(SPREAD, cell=str(path), placements=20), progress=edited)
    assert load_cell(str(tmp_path / "out" / "best_1.yaml")).name == "demo_best_1"
    assert "placements looked at" in found.summary


@pytest.mark.long
def test_a_study_that_keeps_fewer_leaves_no_cell_of_one_that_kept_more(
    laid: Laid, tmp_path: Path
) -> None:
    laid(replace(SPREAD, keep=3))
    mine = tmp_path / "out" / "best_9.yaml"
    mine.write_text(cell_to_yaml(load_cell("demo")))
    laid(replace(SPREAD, keep=1))
    assert sorted(path.name for path in (tmp_path / "out").glob("*.yaml")) == [
        "best_1.yaml",
        "best_9.yaml",
    ]


@pytest.mark.parametrize("name", ["base", "tool", "a.b"])
def test_a_machine_may_be_called_like_what_else_moves(
    laid: Laid, tmp_path: Path, name: str
) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(cell_to_yaml(load_cell("demo")).replace("name: gauge\n", f"name: {name}\n"))
    moved = {"base": {"x": (-0.2, 0.2)}, "equipment": {name: {"x": (-0.3, 0.3)}}}
    laid(replace(SPREAD, cell=str(path), placements=20, **moved))
    page = (tmp_path / "out" / "index.html").read_text()
    titles = re.findall(r"<h3>(\S+), ([\d.]+) m from edge to edge", page)
    assert [title[0] for title in titles] == ["base", name]
    assert titles[0][1] == titles[1][1]  # of one scale
    drawings = page.split('class="plan"')[1:]
    places = [set(re.findall(r'class="dot" cx="(\S+)"', each)) for each in drawings]
    assert places[0] != places[1]  # each with its own places


def test_no_mark_lies_outside_its_picture(laid: Laid, tmp_path: Path) -> None:
    laid(replace(SPREAD, base={"x": (-8.0, 0.3), "y": (-9.0, 0.2)}, placements=40))
    page = (tmp_path / "out" / "index.html").read_text()
    view = page.split('class="plan"')[1].split("</svg>")[0]
    width, height = (float(one) for one in re.findall(r'viewBox="0 0 (\S+) (\S+)"', view)[0])
    marks = re.findall(r'(?:cx="|class="cross" d="M)(-?[\d.]+)(?:" cy="| )(-?[\d.]+)', view)
    assert len(marks) > 30
    assert all(0.0 <= float(x) <= width and 0.0 <= float(y) <= height for x, y in marks)
    assert height <= 1.6 * width


@pytest.mark.parametrize(("placements", "rounds"), [(41, 4), (10, 6), (5, 2), (3, 5)])
def test_as_many_placements_are_drawn_as_were_asked_for(
    monkeypatch: pytest.MonkeyPatch, laid: Laid, placements: int, rounds: int
) -> None:
    """However they divide among the rounds."""
    drawn: list[int] = []

    def counted(dimensions: int, count: int, *seeds: int) -> np.ndarray:
        drawn.append(count)
        return points(dimensions, count, *seeds)

    monkeypatch.setattr(search, "points", counted)
    laid(replace(SPREAD, placements=placements, rounds=rounds))
    assert 1 + sum(drawn) == placements
