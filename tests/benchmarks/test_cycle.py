"""The law of cycle times is judged from point to point, and the common program takes the nearest
stops.
"""

from __future__ import annotations

import numpy as np
import pytest
from _common_program import common_program
from _program_chains import Chains
from cycle import Programs, Row, above_best, excess


def row(cycle: float, energy: float, drives: float, wait: str = "") -> Row:
    return Row("demo", 0, "cycle", cycle, energy, drives, True, wait, 0.0, 0.0)


def test_a_longer_cycle_may_cost_the_wait_and_no_more() -> None:
    rows = [row(10.0, 1000.0, 500.0), row(12.0, 1200.0, 500.0), row(13.0, 1300.0, 490.0)]
    law, rise = excess(rows, 100.0)
    assert law == pytest.approx(0.0)
    assert rise == pytest.approx(0.0)
    law, rise = excess([*rows, row(14.0, 1470.0, 539.0)], 100.0)
    assert law == pytest.approx(5.0)
    assert rise == pytest.approx(10.0)
    _, rise = excess([*rows, row(14.0, 1400.0, 539.0, "STAND_ON_BRAKES")], 100.0)
    assert rise == pytest.approx(0.0)


def test_a_refused_cycle_time_is_passed_over() -> None:
    rows = [
        row(10.0, 1000.0, 500.0),
        row(12.0, float("nan"), float("nan")),
        row(13.0, 1300.0, 490.0),
    ]
    law, _ = excess(rows, 100.0)
    assert law == pytest.approx(0.0)


@pytest.mark.long
def test_the_common_program_lasts_as_long_as_its_slowest_joints() -> None:
    programs = Programs("open", 0)
    stops = ("p1", "conv", "park")
    chains = Chains.of(programs.planner, stops, programs.start, programs.options(), {})
    found = common_program(chains, programs.planner, programs.options())
    speeds = programs.planner.cell.robot.velocity_max
    first = np.abs(chains.layers[1][0].arrival - programs.start) / speeds
    assert found.duration > first.max()
    assert found.drive_energy > 0.0
    assert 0.0 <= found.not_free <= 1.0


def test_the_best_known_is_that_of_the_same_cycle_time() -> None:
    rows = [row(10.0, 1000.0, 500.0), row(12.0, 1020.0, 500.0)]
    rivals = [row(10.0, 1100.0, 500.0), row(12.0, 1000.0, 500.0), row(14.0, 100.0, 50.0)]
    assert above_best(rows, rivals) == pytest.approx(2.0)
    assert above_best(rows, []) == 0.0
