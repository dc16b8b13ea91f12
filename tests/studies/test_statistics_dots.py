"""The drawing of comparisons holds every interval whole."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from ir_studies.statistics.findings import Comparison, compared
from ir_studies.statistics.outputs import dots


def of(shares: list[float], name: str = "energy") -> Comparison:
    rows = [{"a": 1.0 + share, "b": 1.0} for share in shares]
    return compared(name, rows, lambda row: row["a"], lambda row: row["b"])


@pytest.mark.parametrize("ends", [(-3.9, 7.95), (-0.2, 0.1), (2.0, 41.0), (-60.0, -1.0)])
def test_an_interval_that_is_wider_than_its_dots_is_drawn_to_its_ends(
    ends: tuple[float, float],
) -> None:
    plain = of(list(0.01 * np.linspace(-1.5, 1.0, 40)))
    wide = replace(plain, name="peak", mean=replace(plain.mean, low=ends[0], high=ends[1]))
    drawn = dots([plain, wide], "difference")
    ticks = [
        (float(value), float(x))
        for x, value in re.findall(r'<text x="([\d.]+)"[^>]*>([+-]?[\d.e-]+) %</text>', drawn)
    ]
    low, left = ticks[0]
    high, right = ticks[-1]
    assert low <= min(ends)
    assert high >= max(ends)
    assert low < 0.0 < high
    x, width = (
        float(each) for each in re.findall(r'<rect x="([\d.]+)"[^>]*width="([\d.]+)"', drawn)[1]
    )
    per = (right - left) / (high - low)
    assert x == pytest.approx(left + (ends[0] - low) * per, abs=0.2)
    assert width == pytest.approx((ends[1] - ends[0]) * per, abs=0.2)
