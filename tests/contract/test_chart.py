"""The contract of `Chart`, for each registered chart and table of the report."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import ModuleType

import pytest

from ir_recorder import Analysis, analyse, read_recording
from ir_recorder.report import CHARTS, Chart

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "src" / "ir_recorder" / "ir_recorder" / "report" / "assets" / "page.html"
EVIL = '"><script>alert(1)</script>'
VOID = {"br", "line", "rect", "circle", "path", "polyline"}


class Balance(HTMLParser):
    """Counts what is opened and not closed; keeps the links."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.links += [
            value or "" for name, value in attributes if name in ("src", "href", "data", "action")
        ]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag


def maker() -> ModuleType:
    """The recorder's fixtures, which make recordings in milliseconds."""
    path = ROOT / "tests" / "recorder" / "conftest.py"
    spec = importlib.util.spec_from_file_location("recordings", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["recordings"] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def analysis(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    """Of a whole run, a few seconds long."""
    return analyse(
        read_recording(maker().demo_run().record(tmp_path_factory.mktemp("chart") / "run.mcap"))
    )


@pytest.fixture(scope="module")
def bare(analysis: Analysis) -> Analysis:
    """Of a recording in which everything is missing."""
    recording = replace(
        analysis.recording,
        power=None,
        joints=None,
        controller=None,
        events=(),
        loads=(),
        cell_yaml="",
    )
    return analyse(recording)


@pytest.fixture(params=list(CHARTS))
def chart(request: pytest.FixtureRequest) -> Chart:
    return CHARTS[request.param]


@pytest.mark.parametrize("name", list(CHARTS))
def test_the_page_has_one_place_for_it(name: str) -> None:
    assert PAGE.read_text("utf-8").count("{{" + name + "}}") == 1


def test_it_closes_what_it_opens_and_fetches_nothing(chart: Chart, analysis: Analysis) -> None:
    balance = Balance()
    balance.feed(chart(analysis))
    balance.close()
    assert balance.open == []
    assert [link for link in balance.links if not link.startswith("#")] == []


def test_it_shows_a_recording_in_which_everything_is_missing(chart: Chart, bare: Analysis) -> None:
    shown = chart(bare)
    assert ">nan" not in shown
    balance = Balance()
    balance.feed(shown)
    balance.close()
    assert balance.open == []


def test_the_same_analysis_gives_the_same_text(chart: Chart, analysis: Analysis) -> None:
    assert chart(analysis) == chart(analysis)


def test_texts_of_a_recording_cannot_become_markup(chart: Chart, analysis: Analysis) -> None:
    steps = tuple(
        replace(
            result,
            step=replace(
                result.step,
                movement=replace(result.step.movement, from_station=EVIL, to_station=EVIL),
            ),
        )
        for result in analysis.steps
    )
    evil = replace(
        analysis,
        recording=replace(analysis.recording, facts=((EVIL, EVIL),)),
        steps=steps,
        stations=tuple(replace(use, station=EVIL) for use in analysis.stations),
        problems=(EVIL,),
    )
    assert "<script" not in chart(evil)
