"""The report says what the executed program saves by its plan, each figure with its baseline."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from ir_recorder import Analysis, analyse
from ir_recorder.reading.recording import SavingsEvent
from ir_recorder.report.page import folded
from ir_recorder.report.picture import write_picture
from ir_recorder.report.tables import savings_lines, savings_section


def test_the_savings_of_the_recording_stand_on_the_page(analysis: Analysis, page: str) -> None:
    savings = analysis.savings
    assert savings is not None
    assert (savings.movements.common, savings.movements.planned) == (4000.0, 3000.0)
    assert (savings.total.common, savings.total.planned) == (5000.0, 3800.0)
    assert folded(savings_section(analysis)) in page
    for words in (
        "25.0 %",
        "20.0 %",
        "24.0 %",
        "1 movements around bodies",
        "the controller&#x27;s own timers",
    ):
        assert words in savings_section(analysis)
    assert "what was compared; program 0123456789abcdef" in page


def test_lines_for_terminal_and_picture_name_the_baseline(
    analysis: Analysis, tmp_path: Path
) -> None:
    movements, pauses, total = savings_lines(analysis)
    assert movements.startswith(
        "movements: 25.0 % less by plan (predicted), 3 000 J instead of 4 000 J in 4.50 s"
    )
    assert "S-curve PTP at 100 %" in movements
    assert "own timers" in pauses
    assert total.startswith("total: 24.0 %")
    plain = replace(analysis, recording=replace(analysis.recording, savings=()))
    with_lines = tmp_path / "a.png"
    without = tmp_path / "b.png"
    write_picture(analysis, with_lines)
    write_picture(plain, without)
    assert with_lines.read_bytes() != without.read_bytes()


def test_shortened_pauses_are_said_beside_their_saving(analysis: Analysis) -> None:
    facts = (("unshortened_pauses", "600 s, 1800 s"),)
    shown = savings_lines(analyse(replace(analysis.recording, facts=facts)))
    said = ["pauses shortened" in line for line in shown]
    assert said == [False, True, True, False]
    assert shown[-1].startswith("total, pauses at full length")


@pytest.mark.parametrize("case", ["none", "not available", "after the program began"])
def test_a_recording_without_savings_has_no_section(analysis: Analysis, case: str) -> None:
    (event,) = analysis.recording.savings
    savings: tuple[SavingsEvent, ...] = {
        "none": (),
        "not available": (replace(event, savings=replace(event.savings, available=False)),),
        "after the program began": (replace(event, time=analysis.steps[0].step.start + 0.1),),
    }[case]
    bare = replace(analysis, recording=replace(analysis.recording, savings=savings))
    assert bare.savings is None
    assert savings_section(bare) == ""
    assert savings_lines(bare) == []


def test_a_saving_that_may_be_none_says_so(analysis: Analysis) -> None:
    known = analysis.recording.savings[0].savings
    doubtful = replace(known.movements, saved_low=-100.0, saved_high=2100.0)
    clear = replace(known.movements, saved_low=400.0, saved_high=1600.0)
    for saving, said in ((doubtful, True), (clear, False)):
        event = replace(analysis.recording.savings[0], savings=replace(known, movements=saving))
        line = savings_lines(
            replace(analysis, recording=replace(analysis.recording, savings=(event,)))
        )[0]
        assert "90 % interval" in line
        assert ("zero lies in it" in line) is said
