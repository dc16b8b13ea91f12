"""Parquet beside CSV: the same tables come out, the same traces come in, anything else is a
sentence.
"""

from __future__ import annotations

import csv
import math
import os
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as arrow
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyarrow import parquet

from ir_recorder.analysis import Analysis
from ir_recorder.errors import RecorderError
from ir_recorder.report.step_table import write_columns, write_table
from ir_recorder.traces import Trace, read_mapping, read_traces

FINITE = st.floats(-1e6, 1e6, allow_nan=False)


def stored(folder: Path, columns: dict[str, Any], name: str = "t.parquet") -> Path:
    parquet.write_table(arrow.table(columns), folder / name)
    return folder / name


def read(path: Path) -> Trace:
    (trace,) = read_traces(path, joint_names=("joint_a1",))
    return trace


def test_the_steps_as_parquet_are_those_as_csv(analysis: Analysis, tmp_path: Path) -> None:
    table = parquet.read_table(write_table([analysis], tmp_path / "steps.parquet")).to_pydict()
    with write_table([analysis], tmp_path / "steps.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(table) == list(rows[0])
    for name, values in table.items():
        texts = [row[name] for row in rows]
        numbers = isinstance(values[0], float)
        assert [
            repr(v) if numbers and not math.isnan(v) else "" if numbers else str(v) for v in values
        ] == texts


def test_a_file_that_is_no_parquet_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "t.parquet").write_text("mine")
    with pytest.raises(RecorderError, match=r"t\.parquet"):
        write_columns({"a": [1.0]}, tmp_path / "t.parquet", b"PAR1")
    assert (tmp_path / "t.parquet").read_text() == "mine"


def test_without_pyarrow_both_directions_say_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = stored(tmp_path, {"time": [0.0, 1.0], "power": [1.0, 2.0]})
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(RecorderError, match="pip install pyarrow"):
        read_traces(path)
    with pytest.raises(RecorderError, match="pip install pyarrow"):
        write_columns({"a": [1.0]}, tmp_path / "new.parquet", b"PAR1")


@given(
    rows=st.lists(
        st.tuples(st.floats(1e-3, 10.0), st.none() | FINITE, FINITE), min_size=2, max_size=20
    ),
    heading=st.sampled_from(["power", "power_kW", "power [kW]", "power (W)"]),
)
def test_a_trace_is_the_same_from_both(
    rows: list[tuple[float, float | None, float]],
    heading: str,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    folder = tmp_path_factory.mktemp("both")
    time = np.cumsum([step for step, _, _ in rows]).tolist()
    columns = {
        "time": time,
        heading: [p for _, p, _ in rows],
        "joint_a1_deg": [q for _, _, q in rows],
    }
    lines = [
        ",".join("" if v is None else repr(v) for v in row)
        for row in zip(*columns.values(), strict=True)
    ]
    (folder / "t.csv").write_text("\n".join([",".join(columns), *lines]))
    ours = read(stored(folder, columns))
    other = read(folder / "t.csv")
    np.testing.assert_array_equal(ours.time, other.time)
    assert ours.columns.keys() == other.columns.keys()
    for name, values in ours.columns.items():
        np.testing.assert_array_equal(values, other.columns[name])


def test_integers_dates_words_and_columns_of_others_are_taken(tmp_path: Path) -> None:
    begin = datetime(2026, 3, 1, 12, tzinfo=UTC)
    columns = {
        "time": [begin + timedelta(milliseconds=4 * k) for k in range(3)],
        "power": arrow.array([1, None, 3], arrow.int16()),
        "mode": arrow.array(["drives_ready", None, "hibernate"]).dictionary_encode(),
        "wind [furlong]": [1.0, 2.0, 3.0],
        "nested": [{"x": 1}, {"x": 2}, {"x": 3}],
    }
    trace = read(stored(tmp_path, columns))
    np.testing.assert_allclose(np.diff(trace.time), 0.004, atol=1e-6)
    assert trace.time[0] == begin.timestamp()
    np.testing.assert_array_equal(trace.columns["power"], [1.0, np.nan, 3.0])
    assert trace.texts["mode"] == ("drives_ready", "", "hibernate")


TIME = [0.0, 1.0]


@pytest.mark.parametrize(
    ("columns", "sentence"),
    [
        ({"time": [1.0, 0.0], "power": TIME}, "time 0 s follows 1 s"),
        ({"time": [0.0, math.nan], "power": TIME}, "row 2: time is nan, it must be finite"),
        ({"time": [0.0, None], "power": TIME}, "row 2: time is nan"),
        ({"time": [datetime(2026, 1, 1), None], "power": TIME}, "row 2: time is nan"),
        ({"time": TIME, "power": [math.inf, 0.0]}, "row 1: power is inf, it must be finite"),
        ({"time": TIME, "power": ["1", "2"]}, "column power is of string, it must be of numbers"),
        ({"time": TIME, "power": [True, False]}, "column power is of bool"),
        ({"time": TIME, "power": [datetime(2026, 1, 1)] * 2}, "column power is of timestamp"),
        ({"time": TIME, "power": [[1.0], [2.0]]}, "column power is of list"),
        ({"time": TIME, "power": TIME, "power_kW": TIME}, "column power is there twice"),
        ({"t": TIME, "power": TIME}, "column t has no unit"),
        ({"clock": TIME, "power": TIME}, "there is no column time, there is: clock, power"),
        ({"time": [0.0], "power": [0.0]}, "has 1 points"),
        ({"time": TIME, "power_parsec": TIME, "joint_a1 [ells]": TIME}, "ells"),
    ],
)
def test_what_makes_no_sense_is_named(
    columns: dict[str, Any], sentence: str, tmp_path: Path
) -> None:
    path = stored(tmp_path, columns)
    with pytest.raises(RecorderError) as refused:
        read(path)
    assert str(path) in str(refused.value)
    assert sentence in str(refused.value)


def test_a_mapping_names_columns_of_parquet(tmp_path: Path) -> None:
    mapping = tmp_path / "m.yaml"
    text = (
        "format: ir_trace/1\ncolumns: {time: {column: t, unit: ms}, power: {column: P, unit: kW}}\n"
    )
    mapping.write_text(text)
    path = stored(tmp_path, {"t": [0, 500], "P": [1.0, 2.0]})
    (trace,) = read_traces(path, read_mapping(mapping))
    np.testing.assert_array_equal(trace.time, [0.0, 0.5])
    np.testing.assert_array_equal(trace.columns["power"], [1000.0, 2000.0])


def test_a_fifo_and_a_folder_are_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo.parquet")
    (tmp_path / "folder.parquet").mkdir()
    for name in ("fifo.parquet", "folder.parquet"):
        with pytest.raises(RecorderError, match="is not a regular file"):
            read_traces(tmp_path / name)


@given(
    place=st.integers(0, 10**6), new=st.binary(min_size=1, max_size=8), cut=st.integers(0, 10**6)
)
def test_damaged_files_are_read_or_refused(
    place: int, new: bytes, cut: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("damaged")
    path = stored(
        folder, {"time": np.arange(50.0), "power": np.arange(50.0), "joint_a1": np.arange(50.0)}
    )
    content = bytearray(path.read_bytes())
    begin = place % len(content)
    content[begin : begin + len(new)] = new
    path.write_bytes(content[: len(content) - cut % 40])
    try:
        trace = read(path)
    except RecorderError as error:
        named = str(path) in str(error)
        increasing = True
    else:
        named = True
        increasing = bool((np.diff(trace.time) > 0.0).all())
    assert named
    assert increasing
