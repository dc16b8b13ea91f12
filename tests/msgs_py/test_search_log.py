"""Logs of searches as text: what is written is read again; what is none is left out."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_msgs_py.search_log import (
    ConfigurationLog,
    CorrectionLog,
    SearchLog,
    Track,
    WithdrawalLog,
    log_of,
    stage_of,
)
from ir_values.arrays import FloatArray

HALF_MM = 0.5e-3 + 1e-12
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
def test_what_is_written_is_read_again_within_half_a_millimetre(log: SearchLog) -> None:
    stage = stage_of(log)
    again = log_of(stage.name, stage.note)
    assert type(again) is type(log)
    _same(log, again)


def _same(first: object, second: object) -> None:
    if isinstance(first, np.ndarray):
        assert np.allclose(first, np.asarray(second), rtol=0.0, atol=HALF_MM)
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


LOOP = {
    "station": "s",
    "load": "",
    "method": "m",
    "generations": 1,
    "candidates": 1,
    "rejected": [],
}
WALK = {"distance": [1, 2], "kept": [[0, 0, 0], [1, 1, 1]], "dropped": [], "path": []}


@pytest.mark.parametrize(
    "note",
    [
        "",
        "[]",
        "{}",
        "null",
        "[" * 100_000,
        json.dumps({**LOOP, **WALK, "parents": [0, 5]}),  # of a node that comes later
        json.dumps({**LOOP, **WALK, "parents": [0]}),
        json.dumps({**LOOP, **WALK, "parents": [0, 0], "dropped": [[1e300, 0, 0]]}),
        json.dumps({**LOOP, **WALK, "parents": [0, 0], "dropped": [[0, 0]]}),
        json.dumps({**LOOP, **WALK, "parents": [0, 0]}).replace("[1, 2]", "[1, NaN]"),
    ],
)
def test_a_note_that_makes_no_sense_is_no_log(note: str) -> None:
    assert log_of("log: withdrawal", note) is None


def test_other_stages_are_no_logs() -> None:
    assert log_of("station graph", json.dumps({**LOOP, **WALK, "parents": [0, 0]})) is None
    assert log_of("log: withdrawal", json.dumps({**LOOP, **WALK, "parents": [0, 0]})) is not None
