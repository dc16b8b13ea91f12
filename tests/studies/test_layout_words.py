"""Words of the layout's picture stand beside what is drawn, not on it."""

from __future__ import annotations

import re

import numpy as np
import pytest

from ir_description import load_cell
from ir_studies.layout.page import WIDTH, PlanView, covered, outlines
from ir_studies.layout.placement import Placement, Placing

NUMBERS = re.compile(r"-?\d+\.?\d*")
LETTER = 0.68 * 18.0  # px: the widest usual letter of bold DejaVu Sans at 18 px
TALL = 18.0  # px


def drawn(x: float, y: float) -> str:
    """The demonstration's cell from above with its gauge moved (m)."""
    cell = load_cell("demo")
    best = Placing(()).cell(
        cell, Placement({"equipment.gauge.x": x, "equipment.gauge.y": y}).values
    )
    near = np.vstack([points for one in (cell, best) for points in outlines(one)])
    ends = [np.array(one.machine("gauge").pose[:2, 3]) for one in (cell, best)]
    view = PlanView(cell, best, near, close=True)
    names = {m.name: np.array(m.pose[:2, 3]) for m in cell.equipment if m.name != "gauge"}
    return view.drawn("moved", [], [(*ends, f"gauge {100.0 * np.hypot(x, y):.0f} cm")], names)


@pytest.mark.parametrize(
    ("x", "y"), [(-0.41, 0.0), (-0.3, -0.4), (0.0, 0.41), (0.2, -0.4), (-0.5, 0.4)]
)
def test_words_beside_an_arrow_stand_on_nothing_that_is_drawn(x: float, y: float) -> None:
    """The words "gauge 41 cm" stood on the robot's base."""
    picture = drawn(x, y)
    solids = [
        np.array(list(map(float, NUMBERS.findall(points)))).reshape(-1, 2)
        for points in re.findall(r'<polygon class="(?:was|best)" points="([^"]*)"', picture)
    ]
    assert len(solids) > 6
    ((left, base, words),) = re.findall(
        r'<text class="move" x="([-\d.]+)" y="([-\d.]+)">([^<]*)</text>', picture
    )
    x0, y0 = float(left), float(base)
    box = (x0, y0 - 0.75 * TALL, x0 + LETTER * len(words), y0 + 0.1 * TALL)
    assert covered(box, solids, ()) == 0.0
    assert box[0] >= 0.0
    assert box[2] <= WIDTH


def test_what_covers_words_is_seen() -> None:
    square = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    assert covered((0.0, 0.0, 10.0, 10.0), [square[::-1]], ()) == 1.0
    assert covered((5.0, 0.0, 15.0, 10.0), [square], ()) == pytest.approx(0.5, abs=0.1)
    assert covered((20.0, 0.0, 30.0, 10.0), [square], [(20.0, 0.0, 31.0, 9.9)]) > 0.5
