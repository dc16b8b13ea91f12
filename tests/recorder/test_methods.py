"""What the paper's methods did, on the page: a sentence and a drawing each, from the logs alone."""

from __future__ import annotations

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import load_cell
from ir_msgs_py.search_log import ConfigurationLog, CorrectionLog, SearchLog, Track, WithdrawalLog
from ir_recorder import Analysis
from ir_recorder.report.cell_outline import HEIGHT, WIDTH, View
from ir_recorder.report.methods import methods_section

ROWS = np.array([[1.8, -1.1, 1.0], [1.7, -1.0, 1.2], [1.4, -0.9, 1.2], [1.3, -0.8, 1.3]])
WITHDRAWAL = WithdrawalLog(
    *(
        "washer_rinse",
        "gripper+gear",
        "modified_ga",
        3,
        83,
        (("gear_held too near washer_nozzles", 80),),
    ),
    *((50.0, 66.0), ROWS, np.array([0, 0, 1, 1]), ROWS[:2] + 0.1, ROWS[[0, 1, 3]]),
)
CONFIGURATIONS = ConfigurationLog(
    *("outfeed_place", 5, 2, 1, (("set back for good: gear_held too near outfeed_belt", 3),)),
    (Track("", ROWS), Track("set back for good: gear_held too near outfeed_belt", ROWS[:2])),
)
CORRECTION = CorrectionLog(
    *("lathe_work", "gauge_measure", 4, ((7.0, 3.0, 1.1), (1.05,)), (100.0, 104.0)),
    *(ROWS, (ROWS[1:3],), ROWS + 0.2),
)


@pytest.fixture
def analysis(analysis: Analysis) -> Analysis:
    """The recording, of the demonstration's cell."""
    return replace(analysis, cell=load_cell("demo"))


def section(analysis: Analysis, *logs: SearchLog) -> str:
    return methods_section(replace(analysis, recording=replace(analysis.recording, searches=logs)))


def test_each_method_has_a_sentence_with_its_figures_and_a_drawing(analysis: Analysis) -> None:
    html = section(analysis, WITHDRAWAL, CONFIGURATIONS, CORRECTION)
    first, second, third = re.findall(r"<figcaption>(.*?)</figcaption>", html)
    assert first.startswith("Leaving washer_rinse by eq. (7): 3 generations drew 83 configurations")
    assert "3 were kept, 80 dropped (80 gear_held too near washer_nozzles)" in first
    assert "from 50.0 m to 66.0 m" in first
    assert "of 5 random starts 2 were accepted, 1 of them distinct; 3 were rejected" in second
    assert "From lathe_work to gauge_measure" in third
    assert "4 generations for 2 stretches" in third
    assert "+4.00 %" in third
    drawings = [ElementTree.fromstring(svg) for svg in re.findall(r"<svg.*?</svg>", html)]
    assert len(drawings) == 3
    assert "http" not in html


def test_a_drawing_has_a_mark_for_everything_that_was_kept_dropped_or_tried(
    analysis: Analysis,
) -> None:
    (withdrawal,) = re.findall(r"<svg.*?</svg>", section(analysis, WITHDRAWAL))
    tree = ElementTree.fromstring(withdrawal)
    groups = {group.get("class"): len(group) for group in tree.iter("g")}
    assert groups == {"dropped": 2, "kept": 3, "place": 1}
    drawn = {path.get("class") for path in tree.iter("path") if path.get("class")}
    assert drawn == {"tool", "part", "tried", "bar"}
    names = {title.text for title in tree.iter("title")}
    assert {"washer_nozzles", "gear_held", "t_f1"} <= names
    (configurations,) = re.findall(r"<svg.*?</svg>", section(analysis, CONFIGURATIONS))
    lines = [line.get("class") for line in ElementTree.fromstring(configurations).iter("polyline")]
    assert sorted(lines) == ["accepted", "tried"]


@pytest.mark.parametrize(
    ("log", "said"),
    [
        (
            WITHDRAWAL._replace(blocked="line out of washer_rinse: a too near b"),
            "not free (a too near b); 3",
        ),
        (
            WITHDRAWAL._replace(asked=True),
            "asks for it, though the straight line back along the tool is free",
        ),
        (WITHDRAWAL, "by eq. (7): 3 generations"),
    ],
)
@pytest.mark.parametrize("generations", [0, 3])
def test_a_withdrawal_says_why_it_is_not_the_straight_line(
    log: WithdrawalLog, said: str, generations: int, analysis: Analysis
) -> None:
    words = section(analysis, log._replace(generations=generations))
    assert said in words or generations == 0
    assert ("two trees" in words) is (generations == 0)
    assert ("is free" in words) is log.asked
    assert ("not free" in words) is (log.blocked != "")


def test_the_movement_that_is_driven_is_drawn_beside_the_corrected_path(analysis: Analysis) -> None:
    html = section(analysis, replace(CORRECTION, met="a too near b", driven=ROWS - 0.1))
    assert "collides (a too near b)" in html
    assert html.count('class="driven"') == 1


def test_each_drawing_has_a_length_and_says_from_where_it_is_seen(analysis: Analysis) -> None:
    drawings = re.findall(
        r"<svg.*?</svg>", section(analysis, WITHDRAWAL, CONFIGURATIONS, CORRECTION)
    )
    for drawn in drawings:
        length, x0, wide = map(float, _bar(drawn))
        assert 0.1 * WIDTH < wide <= 0.3 * WIDTH
        assert x0 + wide < WIDTH
        assert length in (0.1, 0.2, 0.5, 1.0, 2.0)
        assert re.search(r"m, seen from (the side|above)</text>", drawn)


def _bar(drawn: str) -> tuple[str, str, str]:
    (x0, wide) = re.findall(r'class="bar" d="M(\S+) \S+v6h([0-9.]+)v-6"', drawn)[0]
    return re.findall(r">([0-9.]+) m, seen", drawn)[0], x0, wide


def test_the_chart_of_the_fitness_lies_where_it_hides_least(analysis: Analysis) -> None:
    x = np.array([1.0, 0.0, 0.0])
    y = np.array([0.0, 1.0, 0.0])
    for to in (x + y, x - y):  # from above: towards the right top, or the right bottom
        path = np.linspace(0.0, 1.0, 30)[:, None] * 2.0 * to
        drawn = section(
            analysis, replace(CORRECTION, straight=path, path=path + 0.01 * x, stretches=())
        )
        left, top, wide, high = map(
            float,
            re.findall(r'class="chart" x="(\S+)" y="(\S+)" width="(\S+)" height="(\S+)"', drawn)[0],
        )
        (line,) = re.findall(r'class="path" points="(.*?)"', drawn)
        flat = np.array([point.split(",") for point in line.split()], dtype=float)
        assert not ((flat >= [left, top]) & (flat <= [left + wide, top + high])).all(axis=1).any()
        assert min(left, top) >= 0.0
        assert left + wide <= WIDTH
        assert top + high <= HEIGHT


def test_figures_that_are_left_out_are_counted(analysis: Analysis) -> None:
    html = section(analysis, *[replace(CORRECTION, goal=f"goal {k}") for k in range(30)])
    assert html.count("<figure>") == 24
    assert "24 of 30 are shown" in html
    assert "are shown" not in section(analysis, CORRECTION)


def test_what_was_the_same_at_several_visits_is_said_once_with_their_number(
    analysis: Analysis,
) -> None:
    other = WITHDRAWAL._replace(load="gripper", candidates=90)
    html = section(analysis, WITHDRAWAL, other, WITHDRAWAL, CORRECTION, WITHDRAWAL, CORRECTION)
    first, second, third = re.findall(r"<figcaption>(.*?)</figcaption>", html)
    assert html.count("<svg") == 3
    assert first.endswith("Entering is the same path reversed. This holds for 3 visits.")
    assert second.endswith("Entering is the same path reversed.")
    assert third.endswith("This holds for 2 movements.")


def test_a_recording_without_logs_has_no_such_section(analysis: Analysis) -> None:
    assert section(analysis) == ""


def test_logs_of_another_cell_are_said_in_words_and_texts_are_escaped(analysis: Analysis) -> None:
    html = section(
        analysis, WITHDRAWAL._replace(station="<script>"), replace(CORRECTION, goal="a&b")
    )
    assert "<script>" not in html
    assert "&lt;script&gt;" in html
    assert "a&amp;b" in html
    assert html.count("<svg") == 1  # the station that isn't there has no drawing


@pytest.mark.parametrize("log", [WITHDRAWAL, CONFIGURATIONS, CORRECTION])
def test_a_log_without_its_cell_is_a_sentence(log: SearchLog, analysis: Analysis) -> None:
    html = section(replace(analysis, cell=None), log)
    assert "<figcaption>" in html
    assert "<svg" not in html


@settings(max_examples=50)
@given(
    st.lists(st.tuples(*[st.floats(-5.0, 5.0)] * 3), min_size=1, max_size=6), st.floats(-3.2, 3.2)
)
def test_all_points_of_a_view_lie_in_it_and_lengths_keep_their_ratio(
    rows: list[tuple[float, float, float]], turn: float
) -> None:
    points = np.array(rows)
    along = np.array([np.cos(turn), np.sin(turn), 0.3])
    view = View.from_the_side(points, along, 0.1)
    flat = view.flat(points)
    assert (flat >= 0.0).all()
    assert (flat <= [WIDTH, HEIGHT]).all()
    right = np.array([np.cos(turn), np.sin(turn), 0.0])
    for axis, wanted in ((right, [1.0, 0.0]), (np.array([0.0, 0.0, 1.0]), [0.0, -1.0])):
        moved = view.flat(points[:1] + axis) - view.flat(points[:1])
        assert moved[0] == pytest.approx(np.array(wanted) * view.scale, abs=1e-6)
