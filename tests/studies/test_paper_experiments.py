"""The experiments on the claims of the paper do what the page says that they do."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import _paper_blocked
import _paper_ccd
import _paper_result as statistics
import _paper_rivals
import _paper_withdrawal
import numpy as np
import paper
import pytest
from _paper_peers import Clock
from _paper_result import FAILS, HOLDS, OPEN, Statement
from _paper_stations import places

from ir_planner.configurations.ccd_search import Descent


def test_a_clock_runs_from_the_first_call_to_the_end_of_the_last() -> None:
    ticks = iter([10.0, 11.0, 15.0])
    clock = Clock(lambda: next(ticks))
    assert clock.seconds == 0.0
    check = clock.timed(lambda free: free)
    assert [check(True), check(False)] == [True, False]
    assert clock.seconds == 5.0


def test_a_difference_that_never_varies_is_no_certainty() -> None:
    value, low, high = statistics.mean_difference([0.0] * 60, list(range(30)) * 2)
    assert value == 0.0
    assert -13.0 < low < -8.0
    assert high == -low
    few = Statement("", "", value, low, high, 60, "", "points", 2.0)
    assert few.alone != FAILS
    many = Statement("", "", *statistics.mean_difference([0.0] * 200), 200, "", "points", 2.0)
    assert many.alone == FAILS
    assert all(map(math.isnan, statistics.mean_difference([])))


def all_failures(count: int) -> Statement:
    found = statistics.percent(statistics.share([0.0] * count))
    return Statement("", "", *found, count, "", "%", 5.0, at_least=False)


def all_successes(count: int) -> Statement:
    found = statistics.percent(statistics.share([1.0] * count))
    return Statement("", "", *found, count, "", "%", 95.0)


def all_the_same(count: int) -> Statement:
    found = statistics.mean_difference([0.0] * count)
    return Statement("", "", *found, count, "", "points", 2.0)


@pytest.mark.parametrize(
    ("alone", "verdict"),
    [(all_failures, HOLDS), (all_successes, HOLDS), (all_the_same, FAILS)],
)
@pytest.mark.parametrize("groups", [6, 30])
def test_what_never_varies_is_decided_by_the_sample_that_its_note_says(
    alone: Callable[[int], Statement], verdict: str, groups: int
) -> None:
    enough = alone(groups).short_by(1) * groups
    assert alone(groups).alone == OPEN
    assert alone(int(0.99 * enough)).alone == OPEN
    assert alone(int(enough) + 1).alone == verdict


def test_every_seed_of_the_withdrawal_can_decide_a_difference_that_never_varies() -> None:
    cells = len(_paper_withdrawal.CELLS) * _paper_withdrawal.VARIANTS
    assert 100.0 * statistics.wilson(0, cells)[2] < _paper_withdrawal.POINTS


def test_no_reading_is_always_the_first_to_be_timed() -> None:
    names = list(_paper_withdrawal.READINGS)
    orders = [_paper_withdrawal.in_turn(names, k) for k in range(len(names))]
    assert {order[0] for order in orders} == set(names)
    assert all(sorted(order) == sorted(names) for order in orders)


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


def test_the_page_names_the_seeds_of_the_pilots() -> None:
    assert f"pilots with seeds 0 to {paper.FIRST - 1}," in paper.HEAD


def test_sizes_are_compared_on_the_same_cells() -> None:
    rows = [{"place": place} for place in (0, _paper_rivals.PLACES - 1, _paper_rivals.PLACES)]
    assert _paper_rivals.in_every_size(rows) == rows[:2]


def test_without_cells_there_is_one() -> None:
    projected = np.array([-3.0, -0.0, 0.0, 3.0])  # rad; OMPL's cell is the floor of the quotient
    assert not np.floor(projected / _paper_rivals.ONE_CELL).any()


def test_every_reading_of_the_descent_is_asked_for_what_its_name_says(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[tuple[str, str, bool]] = []

    def noted(
        pose: Any, starts: Any, scene: Any, threshold: Any, settings: Any, work: Any
    ) -> Descent:
        assert (threshold > 0.0).all()
        asked.append((settings.set_back, settings.distribution, settings.newton_steps > 0))
        return Descent(starts[:0], 0)

    monkeypatch.setattr(_paper_ccd, "descend", noted)
    place = next(places(("cnc_door",), 4, 1))
    for reading in _paper_ccd.READINGS.values():
        _paper_ccd.tried(place, reading, np.random.default_rng(1), 4)
    normal = "truncated_normal"
    assert dict(zip(_paper_ccd.READINGS, asked, strict=True)) == {
        "as read": ("secant", normal, True),
        "(5) as printed": ("printed", normal, True),
        "(5) by metres": ("gain", normal, True),
        "no set-back": ("none", normal, True),
        "no Newton finish": ("secant", normal, False),
        "no Newton finish, (5) as printed": ("printed", normal, False),
        "no Newton finish, (5) by metres": ("gain", normal, False),
        "no Newton finish, no set-back": ("none", normal, False),
        "(1) uniform": ("secant", "uniform", True),
    }


def test_readings_of_the_withdrawal_differ_in_what_their_names_say() -> None:
    for name, reading in _paper_withdrawal.READINGS.items():
        assert (reading.changed.get("weighting") == "inverse") == ("inverse" in name)
        assert ("step" in reading.changed) == ("no drift" in name)
        assert (reading.changed.get("reading") == "printed") == ("as printed" in name)
        assert reading.tree == ("trees" in name)
        assert reading.line == ("line" in name)


def test_open_closed_and_semi_closed_zones_are_judged_by_cells() -> None:
    """Stations of a cell stand among the same machines."""
    rows = [
        {
            "seed": 4,
            "cell": "one",
            "station": name,
            "zone": "OPEN",
            "reading": "as read",
            "solved": True,
        }
        for name in "abcdefgh"
    ]
    assert _paper_withdrawal._success(rows, "open", ("OPEN",)).low < 30.0


def test_the_straight_line_leaves_a_tunnel_but_no_station_beside_a_door() -> None:
    def left(cell: str, station: str) -> bool:
        place = next(place for place in places((cell,), 4, 1) if place.station.name == station)
        return bool(
            _paper_withdrawal._searched(
                place, _paper_withdrawal.READINGS[_paper_withdrawal.LINE], 1
            )["solved"]
        )

    assert left("deep_box", "tun")
    assert not left("cnc_door", "cncL")


def test_blocked_places_have_configurations_that_collide_and_others() -> None:
    scene = next(places(("cnc_door",), 4, 1)).scene
    for place in _paper_blocked.blocked_places(scene, 3, np.random.default_rng(1)):
        q = scene.inverse_kinematics.solve(place.station.pose[None]).q
        assert 0 < scene.collision.is_free(q, place.threshold).sum() == len(place.q) < len(q)


def test_figures_near_each_other_look_different() -> None:
    near = Statement("", "", 99.97, 99.95, 99.98, 2521, "stations", "%", 95.0)
    assert paper.measured(near) == "99.97 [99.95, 99.98] %, 2521 stations"
    assert paper.numbers(0.0, 0.0, 0.0) == ["0", "0", "0"]
