"""The experiments on the claims of the paper try the readings that the page names."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import _paper_ccd
import _paper_rivals
import _paper_withdrawal
import numpy as np
import pytest
from _paper_stations import places

from ir_planner.configurations.ccd_search import Descent


def test_seeds_draw_cells_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[tuple[int, str, int]] = []

    def noted(kind: str, sizes: tuple[int, ...], count: int, seed: int) -> list[Any]:
        drawn.append((len(sizes), kind, seed))
        return []

    monkeypatch.setattr(_paper_rivals, "questions", noted)
    for seed in range(8):
        _paper_rivals.measure_kpiece(seed, False)
        _paper_rivals.measure_rrt(seed, False)
    assert len(drawn) == len(set(drawn))


def test_every_reading_of_the_descent_is_asked_for_what_its_name_says(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[tuple[str, str, bool, bool]] = []

    def noted(pose: Any, starts: Any, scene: Any, threshold: Any, settings: Any, work: Any) -> Descent:
        free = bool((threshold < -100.0).all())
        asked.append((settings.set_back, settings.distribution, settings.newton_steps > 0, free))
        return Descent(starts[:0], 0)

    monkeypatch.setattr(_paper_ccd, "descend", noted)
    place = next(places(("cnc_door",), 4, 1))
    for reading in _paper_ccd.READINGS.values():
        _paper_ccd._row(place, reading, np.random.default_rng(1), 4)
    normal = "truncated_normal"
    assert dict(zip(_paper_ccd.READINGS, asked, strict=True)) == {
        "as read": ("secant", normal, True, False),
        "(5) literal": ("literal", normal, True, False),
        "no set-back": ("secant", normal, True, True),
        "no Newton finish": ("secant", normal, False, False),
        "no Newton finish, no set-back": ("secant", normal, False, True),
        "(1) uniform": ("secant", "uniform", True, False),
    }


def test_the_printed_mean_is_d_for_every_joint_and_has_no_direction() -> None:
    walker = object.__new__(_paper_withdrawal.PrintedMean)
    walker.settings, walker.first_total = SimpleNamespace(step=0.12), 2.0  # type: ignore[assignment]
    parents = SimpleNamespace(total=np.array([2.0, 4.0]), q=np.zeros((2, 6)))
    mean = walker._mean(parents)  # type: ignore[arg-type]
    assert mean == pytest.approx(np.repeat([[0.12], [0.24]], 6, axis=1))


def test_readings_of_the_withdrawal_differ_in_what_their_names_say() -> None:
    for name, reading in _paper_withdrawal.READINGS.items():
        assert (reading.changed.get("weighting") == "inverse") == ("inverse" in name)
        assert ("step" in reading.changed) == ("no drift" in name)
        assert reading.printed == ("as printed" in name)
        assert reading.tree == ("trees" in name)
