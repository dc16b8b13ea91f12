"""Logs of searches come back from their messages as they were."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_msgs_py.ros.search_conversions import searches_from_msg, searches_to_msg
from ir_msgs_py.search_log import (
    ConfigurationLog,
    CorrectionLog,
    SearchLog,
    Track,
    WithdrawalLog,
)
from ir_values.arrays import FloatArray

SINGLE = 1e-6  # m: positions travel in single precision
numbers = st.floats(0.0, 1e4)
counts = st.lists(st.tuples(st.text(max_size=20), st.integers(0, 1000)), max_size=4).map(tuple)


@st.composite
def points(draw: st.DrawFn, least: int = 0) -> FloatArray:
    rows = draw(st.lists(st.tuples(*[st.floats(-10.0, 10.0)] * 3), min_size=least, max_size=6))
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


@st.composite
def withdrawals(draw: st.DrawFn) -> WithdrawalLog:
    kept = draw(points(1))
    parents = np.array(
        [draw(st.integers(0, max(k - 1, 0))) for k in range(len(kept))], dtype=np.int64
    )
    whole = (draw(st.integers(0, 99)), draw(st.integers(0, 9999)))
    distance = (draw(numbers), draw(numbers))
    names = ("a station", "gripper+gear", "modified_ga")
    return WithdrawalLog(
        *names, *whole, draw(counts), distance, kept, parents, draw(points()), draw(points())
    )


logs = st.one_of(
    withdrawals(),
    st.builds(
        ConfigurationLog,
        st.text(max_size=9),
        *[st.integers(0, 99)] * 3,
        counts,
        st.lists(st.builds(Track, st.text(max_size=9), points(1)), max_size=3).map(tuple),
    ),
    st.builds(
        CorrectionLog,
        st.text(max_size=9),
        st.text(max_size=9),
        st.integers(0, 99),
        st.lists(st.lists(numbers, max_size=4).map(tuple), max_size=3).map(tuple),
        st.tuples(numbers, numbers),
        points(),
        st.lists(points(), max_size=2).map(tuple),
        points(),
    ),
)


@settings(max_examples=30)
@given(logs)
def test_a_log_comes_back_from_its_message(log: SearchLog) -> None:
    (again,) = searches_from_msg(searches_to_msg([log]))
    assert type(again) is type(log)
    _same(log, again)


def _same(first: object, second: object) -> None:
    if isinstance(first, np.ndarray):
        assert np.allclose(first, np.asarray(second), rtol=0.0, atol=SINGLE)
    elif isinstance(first, float):
        assert second == pytest.approx(first, abs=1e-4)
    elif isinstance(first, tuple):
        assert isinstance(second, tuple)
        for one, other in zip(first, second, strict=True):
            _same(one, other)
    elif hasattr(first, "__dataclass_fields__"):
        for name in first.__dataclass_fields__:
            _same(getattr(first, name), getattr(second, name))
    else:
        assert first == second
