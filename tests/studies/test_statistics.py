"""Statistics of section VI: what is drawn, what is measured, what the figures say."""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.stats import bootstrap, skew, t, ttest_1samp

from ir_cli.main import main
from ir_planner import Planner
from ir_recorder.analysis.intervals import mean_of
from ir_studies import Means, read_study
from ir_studies.errors import SettingsError, StudyError
from ir_studies.statistics.findings import findings_of
from ir_studies.statistics.outputs import columns, page_html, summary_of
from ir_studies.statistics.runs import NEAREST, pair_of, places_of, row_maker
from ir_studies.statistics.settings import EXAMPLE, StatisticsSettings, statistics_settings
from ir_studies.studies import Study, StudyAnswer, study_of

ASKED = StatisticsSettings("open")
shares = st.floats(-0.5, 0.5).map(lambda x: round(x, 4))


def movement(
    duration: float, direct: float, timing: str, *, predicted: float = 100.0
) -> dict[str, Any]:
    """A row of one timing."""
    return {
        "solved": True, "timing": timing, "duration_s": duration, "direct_j": direct,
        "indirect_j": 1.1 * direct, "predicted_j": predicted,
        "predicted_low_j": 90.0, "predicted_high_j": 110.0,
    }  # fmt: skip


def pair(share: float, asynchronous: str = "asynchronous") -> dict[str, Any]:
    """A pair whose asynchronous answer takes `share` more joules in the same time."""
    return {
        "synchronous": movement(2.0, 100.0, "synchronous"),
        "asynchronous": movement(2.0, 100.0 * (1.0 + share), asynchronous),
    }


@given(st.lists(shares, min_size=2, max_size=60, unique=True))
@settings(max_examples=30, deadline=None)
def test_the_interval_of_a_mean_is_the_union_of_students_and_halls(values: list[float]) -> None:
    found = findings_of([pair(value) for value in values])
    energy = next(each for each in found.comparisons if each.name == "energy, direct")
    percent = 100.0 * np.array(values)
    count = len(values)
    student = ttest_1samp(percent, 0.0)
    interval = student.confidence_interval(0.90)
    error = np.std(percent, ddof=1) / math.sqrt(count)
    k = float(skew(percent, bias=False)) / math.sqrt(count)

    def hall(away: float) -> float:  # the cubic as it is printed, with a = 1/3 and b = 1/6
        return away + k * away**2 / 3.0 + k**2 * away**3 / 27.0 + k / 6.0

    def end(sign: float) -> float:
        wanted = sign * float(t.ppf(0.95, count - 1))
        return float(np.mean(percent)) - error * brentq(lambda away: hall(away) - wanted, -1e4, 1e4)

    assert energy.mean.value == pytest.approx(np.mean(percent), abs=1e-9)
    assert energy.mean.low == pytest.approx(min(interval.low, end(1.0)), abs=1e-6)
    assert energy.mean.high == pytest.approx(max(interval.high, end(-1.0)), abs=1e-6)
    assert (energy.less, energy.more) == (
        sum(x < 0.0 for x in values),
        sum(x > 0.0 for x in values),
    )
    sign = math.copysign(1.0, float(np.mean(percent)))
    by_hall = 2.0 * t.sf(max(0.0, sign * hall(float(np.mean(percent)) / error)), count - 1)
    assert energy.chance == pytest.approx(max(student.pvalue, by_hall), rel=1e-6, abs=1e-12)
    assert energy.effect == pytest.approx(np.mean(values) / np.std(values, ddof=1), abs=1e-9)


def test_the_interval_agrees_with_a_bootstrap() -> None:
    values = np.random.default_rng(3).normal(0.04, 0.1, 200)
    found = findings_of([pair(float(value)) for value in values])
    energy = next(each for each in found.comparisons if each.name == "energy, direct")
    drawn = bootstrap(
        (100.0 * values,), np.mean, confidence_level=0.90, rng=np.random.default_rng(5)
    )
    near = 0.15 * (energy.mean.high - energy.mean.low)
    assert energy.mean.low == pytest.approx(drawn.confidence_interval.low, abs=near)
    assert energy.mean.high == pytest.approx(drawn.confidence_interval.high, abs=near)


def test_two_movements_of_a_pair_count_as_one_where_energies_are_compared() -> None:
    share = np.random.default_rng(6).normal(0.0, 0.1, 40)
    rows = [
        {
            timing: movement(2.0, 100.0 * (1.0 + x), timing)
            for timing in ("synchronous", "asynchronous")
        }
        for x in share.tolist()
    ]
    agreed = findings_of(rows).agreements[0]
    direct = 1.0 + share
    ratio = 1.0 / direct.mean()  # of the sums: they are what a year is made of
    by_pair = mean_of(100.0 * (ratio - 1.0 + (1.0 - ratio * direct) / direct.mean()))
    assert agreed.count == 80
    assert agreed.mean.value == pytest.approx(100.0 * (ratio - 1.0), abs=1e-9)
    first, second = agreed.levels
    assert agreed.mean.value == pytest.approx(100.0 * (first / second - 1.0), abs=1e-9)
    assert (agreed.mean.low, agreed.mean.high) == pytest.approx(
        (by_pair.low, by_pair.high), abs=1e-9
    )


def test_answers_that_are_the_synchronous_one_are_counted_apart() -> None:
    rows = [pair(-0.1), pair(-0.2), pair(0.0, "synchronous"), {"synchronous": {"solved": False}}]
    found = findings_of(rows)
    assert (found.pairs, found.solved, found.same, found.driven) == (4, 3, 1, 5)
    assert {each.count for each in found.comparisons if each.name == "duration"} == {2}
    said = summary_of(found, ASKED)
    assert "     1  same answer in both\n     2  compared" in said
    assert "left out: 1 pairs without both movements" in said


def test_what_the_interval_holds_is_counted() -> None:
    found = findings_of([pair(0.5), pair(0.05)])
    assert found.covered == pytest.approx(3 / 4)


def test_nothing_solved_is_said_and_breaks_nothing() -> None:
    rows: list[dict[str, Any]] = [{"outcome": "cut", "message": "no answer"}, {}]
    found = findings_of(rows)
    assert found.solved == 0
    assert summary_of(found, ASKED).startswith("     2  pairs asked\n     0  with both timings")
    assert [(each.count, each.example) for each in found.failures] == [(2, "no answer")]
    assert "no answer" in page_html(found, StatisticsSettings("open"))
    assert columns(rows)["message"][0] == "no answer"


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("cell: nowhere", "cell"),
        ("pairs: 0", "pairs"),
        ("pairs: .nan", "pairs"),
        ("objective: cheap", "objective"),
        ("planner: magic", "planner"),
        ("plant: typical:-1", "plant"),
        ("load: anvil", "load"),
        ("plant: drawn:3", "or drawn: one per pair"),
        ("safety_distance: .inf", "safety_distance"),
        ("unknown: 1", "unknown"),
    ],
)
def test_settings_without_sense_name_the_key(line: str, word: str) -> None:
    cell = "" if line.startswith("cell") else "cell: open\n"
    with pytest.raises(SettingsError, match=word):
        statistics_settings(f"format: ir_statistics/1\n{cell}{line}\n", str)


@pytest.mark.parametrize(
    "content", ["secret: 1\n", "format: ir_sim_driver/plant/1\nname: x\nrobot: y\n", None]
)
def test_a_plant_that_is_refused_is_a_sentence_without_its_content(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str | None
) -> None:
    if content is not None:
        (tmp_path / "plant.yaml").write_text(content)
    study = tmp_path / "study.yaml"
    study.write_text("format: ir_statistics/1\ncell: open\nplant: plant.yaml\n")
    with pytest.raises(SettingsError, match=f"plant: {tmp_path}") as refused:
        read_study(study)
    assert "secret" not in str(refused.value)
    assert main(["study", "statistics", str(study), "--output", str(tmp_path / "out")]) == 2
    assert "plant" in capsys.readouterr().err


def test_plant_files_are_placed_and_bundled_plants_stay(tmp_path: Path) -> None:
    text = "format: ir_statistics/1\ncell: open\nplant: {}\n"
    placed: list[str] = []

    def place(name: str) -> str:
        placed.append(name)
        return name

    statistics_settings(text.format("nominal"), place)
    with pytest.raises(SettingsError, match="plant: "):
        statistics_settings(text.format("/nowhere/plant.yaml"), place)
    assert placed == ["open", "open", "/nowhere/plant.yaml"]


def test_the_example_can_be_read() -> None:
    assert study_of(EXAMPLE).settings == StatisticsSettings("demo")


@pytest.mark.parametrize("name", ["table_columns", "demo"])
def test_pairs_are_drawn_alike_and_keep_their_margin(name: str) -> None:
    planner = Planner(name, clock=lambda: 0.0)
    places = places_of(planner, "")
    limits = planner.cell.robot
    for number in range(20):
        drawn, again = (pair_of(places, 7, number, 0.02) for _ in range(2))
        assert np.array_equal(drawn.start, again.start)
        assert np.array_equal(drawn.goal, again.goal)
        assert drawn.names[0] != drawn.names[1]
        assert 0.0 < drawn.margin <= 0.02
        for q in (drawn.start, drawn.goal):
            state = planner.check_state(q, safety_distance=0.0, max_pairs=1)
            assert state.min_distance >= max(drawn.margin, NEAREST)
            assert ((q >= limits.position_min) & (q <= limits.position_max)).all()


@dataclass(frozen=True)
class StudyOfAPair:
    """A study of one pair that was made in a folder: its row, and the progress that was heard."""

    study: Study
    folder: Path
    answer: StudyAnswer
    row: dict[str, Any]
    heard: list[tuple[str, int, int]]


@pytest.fixture(scope="module")
def study_of_a_pair(tmp_path_factory: pytest.TempPathFactory) -> StudyOfAPair:
    folder = tmp_path_factory.mktemp("pair")
    heard: list[tuple[str, int, int]] = []
    study = study_of("format: ir_statistics/1\ncell: open\npairs: 1\nseed: 3\nplant: nominal\n")
    means = Means(1, progress=lambda phase, done, of, best: heard.append((phase, done, of)))
    answer = study.run(folder, means)
    kept = json.loads((folder / "results.jsonl").read_text().splitlines()[-1])
    row = {name: value for name, value in kept.items() if name not in ("key", "outcome")}
    return StudyOfAPair(study, folder, answer, row, heard)


@pytest.mark.long
def test_a_pair_is_planned_driven_and_measured_in_two_ways(study_of_a_pair: StudyOfAPair) -> None:
    row = study_of_a_pair.row
    for timing in ("synchronous", "asynchronous"):
        one = row[timing]
        assert one["message"] == ""
        assert one["direct_j"] == pytest.approx(one["predicted_j"], rel=0.01, abs=10.0)
        assert one["indirect_j"] == pytest.approx(one["direct_j"], rel=0.03, abs=20.0)
        assert math.isfinite(one["peak_w"])


@pytest.mark.long
def test_a_pair_is_made_alike_in_any_process(study_of_a_pair: StudyOfAPair) -> None:
    asked = {"cell": "open", "pairs": 1, "seed": 3, "plant": "nominal"}
    assert row_maker(asked)({"number": 0}) == study_of_a_pair.row


@pytest.mark.long
def test_a_study_leaves_table_and_page(study_of_a_pair: StudyOfAPair, tmp_path: Path) -> None:
    study = study_of_a_pair.study
    answer = study_of_a_pair.answer
    heard = study_of_a_pair.heard
    shutil.copytree(study_of_a_pair.folder, tmp_path, dirs_exist_ok=True)
    assert [path.name for path in answer.files] == ["table.csv", "index.html"]
    assert len((tmp_path / "table.csv").read_text().splitlines()) == 3
    assert heard[-1][1:] == (1, 1)
    assert answer.table.startswith("comparison,")
    assert study.run(tmp_path, Means(1)).summary == answer.summary  # nothing is left to make
    results = tmp_path / "results.jsonl"
    head = json.loads(results.read_text().splitlines()[1])
    digest = head["cells"]["plant nominal"]
    results.write_text(results.read_text().replace(digest, digest[::-1]))
    with pytest.raises(StudyError, match="results of another plant nominal"):
        study.run(tmp_path, Means(1))


def test_a_cell_without_places_is_a_sentence(tmp_path: Path) -> None:
    cell = tmp_path / "empty.yaml"
    cell.write_text("format: ir_cell/1\nname: empty\nrobot: kr6_r900_2\n")
    asked = StatisticsSettings(str(cell))
    make = row_maker({"cell": str(cell)})
    rows = [make({"number": number}) for number in range(2)]
    said = summary_of(findings_of(rows), asked)
    assert "2 pairs without both movements: the cell empty has no two places that keep 2 mm" in said
    assert "90 % interval" not in said
