"""Law: no sentence contradicts its numbers, whatever a recording lacks and a plan saves.

Each page of generated recordings is read as people read it, as text.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_msgs_py.savings import ProgramSavings, Saving
from ir_recorder import Analysis, analyse, findings
from ir_recorder.analysis.production import production_of
from ir_recorder.reading.recording import Recording
from ir_recorder.report import report_html
from ir_recorder.report.fleet import fleet_html
from ir_recorder.report.fleet_members import member_of
from ir_recorder.report.money_text import money
from ir_recorder.report.number_text import joules, kilowatt_hours, millimetres, number, watts
from ir_recorder.report.side_by_side import comparison_html

LACKING = (
    {"power": None},
    {"joints": None, "controller": None},
    {"cell_yaml": "", "urdf": ""},
    {"events": ()},
    {"savings": ()},
    {"loads": (), "signals": (), "warnings": ()},
    {"plc_inputs": None, "plc_outputs": None},
    {"facts": ()},
    {"hardware": ""},
    {"topics": (), "goals": ()},
)
COUNTED = (
    r"(?:robot|recording|cycle|movement|pause|run|step|cell|check|question|seed|plan|program|mode|"
    r"part|joint|wait|station|reading)s"
)
CONTRADICTIONS = (
    re.compile(r"-\d[\d  .,]*(?:%|J|kJ|kWh|Wh|EUR|kg)? *(?:less|saved|more)"),
    re.compile(r"(?<![\w.])-0(?:\.0+)?(?![\d.])(?! J to)"),
    re.compile(r"(?<![\w-])(?:nan|inf)(?!\w)", re.IGNORECASE),
    re.compile(r"\d+e-\d+"),
    re.compile(rf"(?<![\d.,] )(?<![\d.,\w])1 {COUNTED}\b"),
    re.compile(r"(?<![\d.])0 (?:less|more) "),
)


def read(page: str) -> str:
    """What a page says."""
    body = page.partition("<body>")[2].partition("<script")[0]
    words = unescape(re.sub(r"<[^>]+>", "\n", re.sub(r"<svg.*?</svg>", "", body, flags=re.DOTALL)))
    return re.sub(r"\n\s*\n+", "\n", words)


def contradictions(words: str) -> list[str]:
    """Places of a text that contradict themselves, with what stands before them."""
    return [
        words[max(found.start() - 40, 0) : found.end() + 20]
        for pattern in CONTRADICTIONS
        for found in pattern.finditer(words)
    ]


@pytest.mark.parametrize(
    "wrong",
    ["-2.8 % less", "-0 J", "at nan W", "5.6e-06 EUR", "1 robots", "-8.38 kJ saved"],
)
def test_the_judge_finds_what_was_once_written(wrong: str) -> None:
    assert contradictions(f"a {wrong} b")


def drawn_saving(rng: np.random.Generator) -> Saving:
    """Of either sign, with an interval around it, or of nothing at all."""
    common, planned = rng.choice([0.0, 1.0, 3.2e3, 8.1e5], 2) * rng.uniform(0.5, 1.5, 2)
    saved = common - planned
    width = rng.choice([0.0, 1.0, 900.0])
    return Saving(common, planned, rng.uniform(0.0, 1e4), saved - width, saved + 0.5 * width)


def drawn_savings(rng: np.random.Generator) -> ProgramSavings:
    movements = drawn_saving(rng)
    pauses = drawn_saving(rng)
    return ProgramSavings(True, movements, pauses, 1, 0, "id", "words")


def lacking(recording: Recording, missing: frozenset[int], events: int) -> Recording:
    for k in missing:
        recording = replace(recording, **LACKING[k])
    return replace(recording, events=recording.events[:events])


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(10))
def test_no_page_of_a_recording_contradicts_its_numbers(analysis: Analysis, seed: int) -> None:
    rng = np.random.default_rng(seed)
    missing = frozenset(np.flatnonzero(rng.random(len(LACKING)) < 0.2).tolist())
    recording = lacking(analysis.recording, missing, int(rng.choice([0, 1, 2, 9, 10, 10, 10])))
    saved = drawn_savings(rng)
    recording = replace(
        recording, savings=tuple(replace(each, savings=saved) for each in recording.savings)
    )
    found = analyse(recording)
    checks = findings(found)
    member = member_of(found, "robot")
    pages = [report_html(found, checks), comparison_html([(found, checks), (analysis, checks)])]
    if member is not None:
        pages.append(fleet_html([member]))
    for page in pages:
        assert contradictions(read(page)) == []
    words = read(pages[0])
    whole = production_of(found) is not None
    if found.program is not None and math.isfinite(found.program.whole.energy):
        assert ("program, one cycle" in words) == whole
    if found.savings is not None and found.savings.total.saved < 0.0:
        assert "saved by its plan" not in words


@given(st.floats(-1e12, 1e12, allow_nan=False))
def test_numbers_carry_no_sign_before_zero_and_no_exponent(value: float) -> None:
    shown = [
        *(show(value) for show in (joules, watts, kilowatt_hours, millimetres)),
        money(value, "EUR"),
        number(value, "kg"),
    ]
    for words in shown:
        assert "e+" not in words
        assert not re.fullmatch(r"-0(\.0+)?\D*", words), words


def test_an_empty_recording_has_no_cycle_and_says_so(analysis: Analysis) -> None:
    empty = lacking(analysis.recording, frozenset(range(len(LACKING))), 0)
    found = analyse(replace(empty, duration=0.0))
    said: list[str] = []
    assert member_of(found, "robot", said.append) is None
    assert said == [
        "left out: it holds neither a program that was driven nor a plan with its savings"
    ]
    words = read(report_html(found, findings(found)))
    assert "none executed" in words
    assert contradictions(words) == []
    assert not np.isfinite(found.energy)
