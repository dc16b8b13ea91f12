"""Bars show net energies: taken right of zero, returned left of it, the mains beside."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from ir_recorder import Analysis
from ir_recorder.report.charts import joule_bars


def test_the_two_sides_differ_by_what_the_mains_gave(analysis: Analysis) -> None:
    moved = replace(
        analysis.movements[0],
        energy=700.0,
        base_energy=500.0,
        joint_energy=np.array([400.0, -300.0, 0.0, 100.0, 0.0, 0.0]),
        dissipated_energy=0.0,
    )
    shown = joule_bars((moved,))
    assert "1 000 J taken, 300 J returned" in shown
    assert "<b>700 J</b>" in shown
    widths = {m[1]: (float(m[2]), float(m[3])) for m in _pieces(shown)}
    zero = float(re.search(r'class="zero" style="left:([\d.]+)%', shown)[1])
    assert widths["a2"][0] + widths["a2"][1] == pytest.approx(zero, abs=0.02)
    assert widths["base"][0] == pytest.approx(zero, abs=0.02)
    assert widths["a2"][1] == pytest.approx(0.6 * widths["base"][1], rel=0.01)


def _pieces(shown: str) -> list[re.Match[str]]:
    return list(re.finditer(r'class="piece (\w+)" style="left:([\d.]+)%;width:([\d.]+)%', shown))
