"""The largest quarter of an hour of a cycle, judged by sums over whole seconds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_msgs_py.savings import QUARTER, largest_quarter

STEPS = st.lists(
    st.tuples(st.integers(1, 1500), st.floats(0.0, 5000.0)), min_size=1, max_size=6
)  # s and W


@settings(max_examples=60, deadline=None)
@given(steps=STEPS)
def test_no_window_of_a_quarter_takes_more_and_one_takes_as_much(
    steps: list[tuple[int, float]],
) -> None:
    seconds = np.array([float(count) for count, _ in steps])
    watts = np.array([power for _, power in steps])
    each = np.repeat(watts, seconds.astype(int))
    line = np.tile(each, 2 + int(QUARTER) // len(each))
    sums = np.convolve(line, np.ones(int(QUARTER)), "valid")
    assert largest_quarter(seconds, seconds * watts) == pytest.approx(
        sums.max() / QUARTER, rel=1e-9, abs=1e-9
    )


def test_a_cycle_without_duration_takes_none() -> None:
    assert largest_quarter(np.zeros(0), np.zeros(0)) == 0.0
    assert largest_quarter(np.zeros(2), np.zeros(2)) == 0.0


def test_a_cycle_of_a_microsecond_takes_its_mean() -> None:
    assert largest_quarter(np.array([4e-7, 6e-7]), np.array([4e-4, 1e-4])) == pytest.approx(500.0)
