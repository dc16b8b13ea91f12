"""Intervals of means and medians: how often they hold, and what chance alone shows."""

from __future__ import annotations

import itertools
import math
from functools import cache
from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import ttest_1samp

from ir_recorder.analysis.intervals import (
    alike,
    chance_of,
    mean_of,
    median_of,
    shown_together,
    skewed,
)

OFTEN = 2000  # samples, by which a share near 0.9 is known within 0.02 (three standard deviations)
TRUTHS = {"normal": 0.0, "heavy": 0.0, "exponential": 1.0, "lognormal": math.exp(0.5), "zeros": 0.0,
          "skewed zeros": 2.0 / 3.0, "few": 0.25}  # fmt: skip
"""Means of the distributions that samples are drawn from."""
percents = st.lists(st.floats(-50.0, 50.0).map(lambda x: round(x, 3)), min_size=2, max_size=30)


def sample(kind: str, count: int) -> np.ndarray:
    """(OFTEN, count) values less the mean of their distribution; zeros: a third; few: three
    quarters.
    """
    rng = np.random.default_rng(11)
    size = (OFTEN, count)
    kept = rng.random(size) < {"few": 0.25, "zeros": 2.0 / 3.0, "skewed zeros": 2.0 / 3.0}.get(
        kind, 1.0
    )
    drawn = {
        "normal": rng.normal,
        "zeros": rng.normal,
        "heavy": lambda size: rng.standard_t(3.0, size),
        "lognormal": rng.lognormal,
    }.get(kind, rng.exponential)
    return drawn(size=size) * kept - TRUTHS[kind]


@cache
def held(kind: str, count: int) -> float:
    """The share of samples in whose interval their mean lies; where all values are alike there is
    none.
    """
    found = [mean_of(values) for values in sample(kind, count) if not alike(values)]
    return float(np.mean([each.low <= 0.0 <= each.high for each in found]))


@pytest.mark.sampled
@pytest.mark.parametrize(("count", "least"), [(10, 0.85), (20, 0.87), (60, 0.88), (200, 0.88)])
@pytest.mark.parametrize("kind", TRUTHS)
def test_the_interval_of_the_mean_holds_nine_times_of_ten(
    kind: str, count: int, least: float
) -> None:
    assert held(kind, count) >= least


@pytest.mark.parametrize(
    ("count", "most"), [(5, 0.96), (10, 0.94), (20, 0.93), (60, 0.92), (200, 0.92)]
)
def test_where_pairs_are_normal_it_is_hardly_wider_than_students(count: int, most: float) -> None:
    assert 0.88 <= held("normal", count) <= most


@pytest.mark.parametrize("kind", ["lognormal", "skewed zeros", "few"])
@pytest.mark.parametrize("count", [10, 20])
def test_where_few_pairs_carry_the_mean_it_holds_oftener_than_students(
    kind: str, count: int
) -> None:
    drawn = [values for values in sample(kind, count) if not alike(values)]
    student = np.mean(ttest_1samp(np.array(drawn), 0.0, axis=1).pvalue > 0.10)
    assert held(kind, count) > student + 0.04


@given(percents)
def test_zero_lies_outside_the_interval_where_the_test_of_the_row_says_so(
    values: list[float],
) -> None:
    found = mean_of(np.array(values))
    chance = chance_of(np.array(values))
    if alike(np.array(values)):
        assert math.isnan(found.low)
        assert math.isnan(chance)
        return
    assert found.low < found.value < found.high
    for end in (found.low, found.high):  # where an end is zero, the chance is that of the level
        assert chance_of(np.array(values) - end) == pytest.approx(0.10, abs=1e-6)
    if abs(chance - 0.10) > 1e-6:
        assert (found.low > 0.0 or found.high < 0.0) == (chance < 0.10)


@given(percents, st.floats(0.01, 100.0))
def test_an_interval_is_mirrored_and_scaled_with_its_values_and_holds_students(
    values: list[float], scale: float
) -> None:
    array = np.array(values)
    if alike(array) or alike(scale * array):
        return
    found = mean_of(array)
    mirrored = mean_of(-array)
    scaled = mean_of(scale * array)
    student = ttest_1samp(array, 0.0).confidence_interval(0.90)
    near = 1e-9 * float(np.abs(array).max())
    assert found.low <= student.low + near
    assert found.high >= student.high - near
    assert (-mirrored.high, -mirrored.low) == pytest.approx((found.low, found.high), abs=near)
    assert (scaled.low / scale, scaled.high / scale) == pytest.approx(
        (found.low, found.high), abs=near
    )


@given(st.lists(percents, min_size=1, max_size=8))
def test_what_is_shown_among_many_has_zero_outside_its_own_interval(
    table: list[list[float]],
) -> None:
    rows = [np.array(values) for values in table]
    shown = shown_together([chance_of(values) for values in rows])
    for values, one in zip(rows, shown, strict=True):
        found = mean_of(values)
        assert not one or found.low > -1e-9 or found.high < 1e-9


def test_where_few_pairs_carry_the_mean_that_is_recognised() -> None:
    assert np.mean([skewed(values) for values in sample("few", 20)]) > 0.9
    assert np.mean([skewed(values) for values in sample("normal", 60)]) < 0.1


@pytest.mark.parametrize("kind", ["normal", "few"])
@pytest.mark.parametrize("count", [5, 12, 40])
def test_the_interval_of_the_median_holds_at_least_nine_times_of_ten(kind: str, count: int) -> None:
    truth = 0.0 if kind == "normal" else -0.25
    found = [median_of(values) for values in sample(kind, count)]
    assert np.mean([each.low <= truth <= each.high for each in found]) >= 0.88


@given(st.integers(1, 60))
def test_the_interval_of_the_median_is_the_shortest_with_its_level(count: int) -> None:
    found = median_of(np.arange(count, dtype=float))

    def level(
        k: int,
    ) -> float:  # of the interval from the k-th value to the k-th from above, by counting
        return 1.0 - 2.0 * sum(comb(count, i) for i in range(k + 1)) / 2.0**count

    if np.isnan(found.low):
        assert level(0) < 0.90
    else:
        assert level(int(found.low)) >= 0.90 > level(int(found.low) + 1)
        assert found.low + found.high == count - 1


def test_a_difference_by_chance_alone_is_shown_in_one_study_of_ten() -> None:
    rng = np.random.default_rng(4)
    studies = 600
    by_chance = sum(
        any(shown_together([chance_of(values) for values in rng.normal(0.0, 1.0, (8, 40))]))
        for _ in range(studies)
    )
    assert 0.06 < by_chance / studies < 0.13


@given(st.lists(st.floats(0.0, 1.0) | st.just(float("nan")), max_size=5))
def test_what_is_shown_together_is_shown_by_the_closed_test_of_all_intersections(
    chances: list[float],
) -> None:
    tested = [k for k, chance in enumerate(chances) if chance == chance]

    def refused(group: tuple[int, ...]) -> bool:  # Bonferroni
        return min(chances[k] for k in group) * len(group) <= 0.10

    groups = [
        group for n in range(1, len(tested) + 1) for group in itertools.combinations(tested, n)
    ]
    expected = [
        k in tested and all(refused(group) for group in groups if k in group)
        for k in range(len(chances))
    ]
    assert shown_together(chances) == [bool(one) for one in expected] or any(
        abs(chances[k] * n - 0.10) < 1e-9 for k in tested for n in range(1, 10)
    )
