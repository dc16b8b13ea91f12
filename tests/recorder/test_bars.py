"""Bars show net energies: taken right of zero, returned left of it, the mains beside."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from ir_recorder import Analysis
from ir_recorder.report.bars import Piece, Row, bars, joule_bars


def test_the_two_sides_differ_by_what_the_mains_gave(analysis: Analysis) -> None:
    moved = replace(
        analysis.movements[0],
        energy=700.0,
        base_energy=500.0,
        joint_energy=np.array([400.0, -300.0, 0.0, 100.0, 0.0, 0.0]),
        dissipated_energy=0.0,
    )
    shown = joule_bars((moved,), ("A1", "A2", "A3", "A4", "A5", "A6"))
    assert "1 000 J taken, 300 J returned" in shown
    assert "<b>700 J</b>" in shown
    widths = {m[1]: (float(m[2]), float(m[3])) for m in _pieces(shown)}
    zero = float(re.search(r'class="zero" style="left:([\d.]+)%', shown)[1])
    assert widths["a2"][0] + widths["a2"][1] == pytest.approx(zero, abs=0.02)
    assert widths["base"][0] == pytest.approx(zero, abs=0.02)
    assert widths["a2"][1] == pytest.approx(0.6 * widths["base"][1], rel=0.01)


@pytest.mark.parametrize("high", [120.0, 500.0])
def test_a_whisker_stands_on_the_scale_of_the_bars(high: float) -> None:
    """Nothing leaves the track, an interval that is wider than all bars included; equal lengths
    are equal values.
    """
    rows = [
        Row("today", (Piece("today", "", 240.0), Piece("today night", "", 60.0)), "300"),
        Row("planned", (Piece("planned", "", 100.0),), "100", whisker=(80.0, high)),
    ]
    shown = bars(rows, "figure")
    found = re.findall(r'class="([\w ]+)" style="left:([\d.]+)%;width:([\d.]+)%', shown)
    placed = {kind: (float(left), float(wide)) for kind, left, wide in found}
    percent = 100.0 / max(300.0, high)
    for kind, start, length in (
        ("piece today", 0.0, 240.0),
        ("piece today night", 240.0, 60.0),
        ("piece planned", 0.0, 100.0),
        ("whisker", 80.0, high - 80.0),
    ):
        assert placed[kind] == pytest.approx((start * percent, length * percent), abs=0.01)


def test_a_bar_without_an_interval_has_no_whisker() -> None:
    row = Row("a", (Piece("today", "", 1.0),), "1", whisker=(1.0, 1.0))
    assert "whisker" not in bars([row, replace(row, whisker=(np.nan, np.nan))], "figure")


def _pieces(shown: str) -> list[re.Match[str]]:
    return list(re.finditer(r'class="piece (\w+)" style="left:([\d.]+)%;width:([\d.]+)%', shown))


def test_an_interval_that_reaches_below_zero_is_drawn_whole() -> None:
    """It began left of the track."""
    row = Row("best", (Piece("planned", "saved", 2.0),), "2", whisker=(-1.0, 3.0))
    drawn = bars([row], "saved")
    left, width = re.findall(r'class="whisker" style="left:([\d.-]+)%;width:([\d.]+)%', drawn)[0]
    assert (float(left), float(width)) == (0.0, 100.0)
