"""The exhaustive search of benchmarks/standby.py: figures by hand."""

from __future__ import annotations

import pytest
from standby import Controller, Row, off

CONTROLLER = Controller((700.0, 300.0, 200.0), (0.5, 3.0), (1.0, 2.0), (1.0, 20.0), 20.0)


def test_a_sequence_is_paid_at_the_power_of_the_mode_that_is_left() -> None:
    energy, ready = CONTROLLER.run(((0, 0.0), (1, 1.5)), 80.0, 100.0)
    assert ready == 100.0
    assert energy == pytest.approx(0.5 * 700 + 1.0 * 300 + 3.0 * 300 + 75.5 * 200 + 20.0 * 700)


def test_the_controller_closes_its_brakes_by_itself() -> None:
    energy, ready = CONTROLLER.run((), 50.0, 50.0)
    assert ready == 51.0
    assert energy == pytest.approx(20.5 * 700 + 29.5 * 300 + 1.0 * 700)


def test_every_sequence_is_looked_at() -> None:
    assert len(list(CONTROLLER.plans([0.0, 10.0]))) == 1 + 2 * 2 + 4 - 1
    assert CONTROLLER.least_known(2.0, [0.0]) == pytest.approx(1400.0)
    assert CONTROLLER.least_expected([2.0, 2.0], [0.0]) <= 1400.0


def test_a_prediction_is_off_by_shares_of_what_is_allowed() -> None:
    assert off(Row("demo", 0, 1.0, 100.0, 0.0, 110.0, 0.0, 0.0, 0.0, 0.0)) == pytest.approx(0.5)
    assert off(Row("demo", 0, 1.0, 1e4, 0.0, 1e4 + 600.0, 0.0, 0.0, 0.0, 0.0)) == pytest.approx(2.0)
