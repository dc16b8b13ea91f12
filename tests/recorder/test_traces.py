"""One reader of measured data: what it takes, and the sentence for what it doesn't."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_recorder.errors import RecorderError
from ir_recorder.traces import clock_offset, mean_power, read_mapping, read_traces
from ir_recorder.traces.trace import RATE, resampled

JOINTS = ("joint_a1", "joint_a2")


def written(folder: Path, content: str | bytes, name: str = "t.csv") -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def test_units_in_headings_become_si(tmp_path: Path) -> None:
    text = "time [ms],joint_a1_deg,joint_a2 (rad),power_kW,energy [Wh]\n0,180,1,2,0\n500,90,2,3,1\n"
    (trace,) = read_traces(written(tmp_path, text), joint_names=JOINTS)
    np.testing.assert_allclose(trace.time, [0.0, 0.5])
    positions = trace.joints(JOINTS)
    assert positions is not None
    np.testing.assert_allclose(positions, [[np.pi, 1.0], [np.pi / 2, 2.0]])
    np.testing.assert_allclose(trace.columns["power"], [2000.0, 3000.0])
    np.testing.assert_allclose(trace.joules(), [0.0, 3600.0])


def test_semicolons_decimal_commas_dates_and_missing_values(tmp_path: Path) -> None:
    text = "# meter 7\ntime;power;mode;note\n2024-05-01T10:00:00;1,5;STAND_ON_MOTORS;a\n"
    text += "2024-05-01T10:00:01;;STAND_ON_MOTORS;b\n2024-05-01T10:00:02;2,5;BUS_POWER_OFF;c\n"
    (trace,) = read_traces(written(tmp_path, text))
    np.testing.assert_allclose(np.diff(trace.time), [1.0, 1.0])
    np.testing.assert_allclose(trace.columns["power"], [1.5, np.nan, 2.5])
    assert trace.texts["mode"][2] == "BUS_POWER_OFF"
    np.testing.assert_allclose(
        trace.joules(), [0.0, 1.5, 4.0]
    )  # a missing mean counts as the one before


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_the_unicode_text_of_a_spreadsheet_is_read(encoding: str, tmp_path: Path) -> None:
    mark = "\ufeff" if encoding.endswith("e") else ""  # "utf-16" writes its own
    text = f"{mark}time\tpower [kW]\tStück\r\n0\t1,5\tä\r\n1\t2,5\tö\r\n"
    (trace,) = read_traces(written(tmp_path, text.encode(encoding)))
    np.testing.assert_allclose(trace.columns["power"], [1500.0, 2500.0])


def test_a_mapping_names_columns_units_and_the_clock(tmp_path: Path) -> None:
    text = (
        "format: ir_trace/1\ncolumns: {time: {column: t, unit: ms}, power: {column: P total, "
        "unit: kW}}\n"
    )
    mapping = read_mapping(
        written(tmp_path, text + "clock_offset: 0.25\npower_is: sample\n", "map.yaml")
    )
    (trace,) = read_traces(written(tmp_path, "t,P total,x\n0,1,?\n1000,3,?\n"), mapping)
    np.testing.assert_allclose(trace.time, [0.25, 1.25])
    np.testing.assert_allclose(trace.joules(), [0.0, 2000.0])  # samples: the trapezium


@pytest.mark.parametrize(
    ("headings", "seconds", "watts"),
    [
        ("Time_s,Power [kW]", 1.0, 2000.0),
        ("TIME [ms],POWER_W", 1e-3, 2.0),
        ("timestamp [us],Power (W)", 1e-6, 2.0),
        ("time,power,Power [kW]", 1.0, 2.0),  # the plain writing comes first
    ],
)
def test_time_and_meter_are_known_in_capitals_with_a_unit(
    headings: str, seconds: float, watts: float, tmp_path: Path
) -> None:
    more = ",7" * (headings.count(",") - 1)
    text = f"{headings}\n0,2{more}\n5,2{more}\n"
    (trace,) = read_traces(written(tmp_path, text), joint_names=JOINTS)
    assert trace.time[-1] == pytest.approx(5.0 * seconds)
    assert trace.columns["power"] == pytest.approx([watts, watts])


@pytest.mark.parametrize(
    ("headings", "sentence"),
    [
        ("timestamp,power", "column timestamp has no unit"),
        ("Time,power", "column Time has no unit"),
        ("Time_s,timestamp_ms", "column time is there twice: Time_s and timestamp_ms"),
        ("time,Power [kW],POWER_W", "column power is there twice"),
    ],
)
def test_what_other_writings_leave_open_is_refused(
    headings: str, sentence: str, tmp_path: Path
) -> None:
    row = ",".join("1" * (headings.count(",") + 1))
    with pytest.raises(RecorderError, match=sentence):
        read_traces(written(tmp_path, f"{headings}\n{row}\n"), joint_names=JOINTS)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("", "has 0 points"),
        ("time,power\n", "has 0 points"),
        ("time,power\n0,1\n1,1\n0.5,1\n", ":4: time is 0.5 s, it must increase"),
        ("time,power\n0,1\n\n\n1,1,1\n", ":5: has 3 values, the header names 2 columns"),
        ("time,power\n0,1\n1,-inf\n", ":3: power is '-inf', it must be finite"),
        ("time,power\n0,1\nnan,1\n", ":3: time is 'nan', it must be finite"),
        ("time,power\n0,1\n1,2\n1,1\n", ":4: time is 1 s, it must increase"),
        ("time,power\n0,1\n0,1\n1,2\n0.5,2\n", ":5: time is 0.5 s, it must increase"),
        ("time,power\n0,1\n1,2\n2\n", ":4: has 1 values, the header names 2 columns"),
        (
            "time,joint_a1,joint_a2,joint_a3\n0,1,1,1\n1,1,1,1\n",
            "joint_a3 is no joint of the robot",
        ),
        ("time,power\n0,1\n1,1e999\n", ":3: power is '1e999', it must be finite"),
        ("time,power\n,1\n1,1\n", ":2: time is '', it must be a number"),
        ("time [parsec],power\n0,1\n1,1\n", "unit 'parsec' is unknown, known are s, ms"),
        ("time,power,power_kW\n0,1,1\n1,1,1\n", "column power is there twice"),
        ("time,joint_a1\n0,1\n1,1\n", "there is no column joint_a2"),
        (b"\xff\xfe\x00\x01" * 20, "there is no column time"),
        (
            "time,power\n0,1\n1,1\n".encode("utf-16-le"),
            "t.csv:1: has zero bytes: it is no text in UTF-8",
        ),
        ("time,power\n0," + "1" * 200_000 + "\n1,1\n", "t.csv"),
    ],
)
def test_what_makes_no_sense_is_named_with_its_line(
    content: str | bytes, sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(RecorderError) as caught:
        read_traces(written(tmp_path, content), joint_names=JOINTS)[0].joints(JOINTS)
    assert sentence in str(caught.value)


def test_a_row_that_is_too_short_is_held_against_the_first_where_there_are_no_headings(
    tmp_path: Path,
) -> None:
    mapping = read_mapping(
        written(tmp_path, "format: ir_trace/1\ncolumns: {time: 1, power: 2}\n", "map.yaml")
    )
    with pytest.raises(RecorderError, match=":3: has 1 values, line 1, the first, has 2"):
        read_traces(written(tmp_path, "0,1\n1,1\n2\n3,1\n"), mapping)


def test_rows_said_twice_and_a_line_that_was_cut_are_left_out_with_a_sentence(
    tmp_path: Path,
) -> None:
    text = "time;joint_a1;mode\n0;0,5;OFF\n0;0,5;OFF\n1;;OFF\n1;;OFF\n2;NaN;ON\n3;1,5"
    (trace,) = read_traces(written(tmp_path, text), joint_names=JOINTS[:1])
    np.testing.assert_array_equal(trace.time, [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(trace.columns["joint_a1"], [0.5, np.nan, np.nan])
    assert trace.texts["mode"] == ("OFF", "OFF", "ON")
    assert trace.problems == (
        "line 7, the last one, was cut: left out",
        "2 rows repeat the one before: left out",
        "values that are missing: 2 of joint_a1",
    )


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_columns_that_are_not_read_and_values_that_are_missing_are_said_once(
    tmp_path: Path, ending: str
) -> None:
    """A second clock and set values among them, in plain and in makers' names."""
    nan = float("nan")
    logs = {
        "plain": {"time": [0.0, 1, 2], "timestamp": [0.0, 2, 4], "joint_a1": [0.1, nan, nan]},
        "made": {"timestamp": [0.0, 1, 2], "actual_q_0": [0.1, nan, nan], "target_q_0": [9.0] * 3},
        "whole": {"time": [0.0, 1, 2], "joint_a1": [0.1, 0.2, 0.3]},
    }
    said = {}
    for name, table in logs.items():
        path = tmp_path / f"{name}{ending}"
        if ending == ".csv":
            rows = [
                ",".join(table),
                *(",".join(map(str, row)) for row in zip(*table.values(), strict=True)),
            ]
            path.write_text("\n".join([*rows, ""]))
        else:
            pyarrow = pytest.importorskip("pyarrow")
            parquet = pytest.importorskip("pyarrow.parquet")
            parquet.write_table(pyarrow.table(table), path)
        said[name] = read_traces(path, joint_names=JOINTS[:1])[0].problems
    missing = "values that are missing: 2 of joint_a1"
    assert said["plain"] == ("columns that are not read: timestamp", missing)
    assert said["made"][1:] == ("columns that are not read: target_q_0", missing)
    assert said["whole"] == ()


@settings(max_examples=20)
@given(
    rows=st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 3), min_size=2, max_size=20),
    sign=st.sampled_from(",;\t "),
    end=st.sampled_from(("\n", "\r\n", "\r")),
)
def test_every_writing_of_the_same_numbers_is_read_alike(
    rows: list[tuple[float, float, float]],
    sign: str,
    end: str,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    """Plain lines, which NumPy's parser reads, and the same ones in quotes, which it doesn't."""
    lines = [[repr(float(k)), *map(repr, row)] for k, row in enumerate(rows)]
    for quote in ("", '"'):
        cells = [
            ["time", "power", "joint_a1", "other"],
            *([f"{quote}{one}{quote}" for one in row] for row in lines),
        ]
        text = "".join(sign.join(row) + end for row in cells)
        folder = tmp_path_factory.mktemp("alike")
        (trace,) = read_traces(written(folder, text), joint_names=JOINTS[:1])
        np.testing.assert_array_equal(trace.columns["power"], [row[0] for row in rows])
        np.testing.assert_array_equal(trace.columns["joint_a1"], [row[1] for row in rows])


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("[", "this is not YAML"),
        (
            "format: ir_trace/1\ncolumns: {time: t}\ncolumns: {time: s}",
            "yaml:3: 'columns' stands here twice",
        ),
        ("format: ir_cell/1", "is no mapping of a trace"),
        ("format: ir_trace/1\ncolumns: {power: p}", "must name at least time"),
        ("format: ir_trace/1\ncolumns: {time: t}\nclock: 3", "key 'clock' is unknown"),
        (
            "format: ir_trace/1\ncolumns: {time: {column: t, unit: miles}}",
            "unit 'miles' is unknown",
        ),
        ("format: ir_trace/1\njoints: [a, a]", "joints must be a list of names"),
        ("format: ir_trace/1\ntopic: [a]", "topic is"),
        (
            "format: ir_trace/1\ncolumns: {time: t}\nclock_offset: soon",
            "must be a number of seconds",
        ),
    ],
)
def test_a_broken_mapping_is_named(content: str, sentence: str, tmp_path: Path) -> None:
    with pytest.raises(RecorderError) as caught:
        read_mapping(written(tmp_path, content, "map.yaml"))
    assert sentence in str(caught.value)


@given(content=st.binary(max_size=300))
def test_any_bytes_are_read_or_refused_with_a_sentence(
    content: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = written(tmp_path_factory.mktemp("any"), b"time,power\n0,1\n" + content)
    try:
        (trace,) = read_traces(path)
    except RecorderError as error:
        named = str(path) in str(error)
        increasing = True
    else:
        named = True
        increasing = bool((np.diff(trace.time) > 0.0).all())
    assert named
    assert increasing


def test_a_file_of_another_kind_and_parquet_without_pyarrow(tmp_path: Path) -> None:
    with pytest.raises(RecorderError, match="traces are read from"):
        read_traces(written(tmp_path, "x", "t.doc"))
    with pytest.raises(RecorderError, match=r"pip install pyarrow|Parquet"):
        read_traces(written(tmp_path, "x", "t.parquet"))


def test_gaps_are_found_and_stay_unknown(tmp_path: Path) -> None:
    rows = "".join(f"{t},{t}\n" for t in (0.0, 0.1, 0.2, 0.3, 0.4, 2.4, 2.5))
    (trace,) = read_traces(written(tmp_path, "time,power\n" + rows))
    assert trace.gaps() == ((0.4, pytest.approx(2.0)),)
    at = np.array([0.25, 0.4, 1.0, 2.4, 2.45, 9.0])
    values = resampled(trace.time, trace.columns["power"], at, 0.4)
    np.testing.assert_allclose(values, [0.25, 0.4, np.nan, 2.4, 2.45, np.nan])


@given(
    steps=st.lists(st.floats(0.01, 1.0), min_size=3, max_size=30),
    cuts=st.lists(st.floats(0.001, 0.999), min_size=1, max_size=10, unique=True),
    seed=st.integers(0, 9),
)
def test_resampling_keeps_the_energy(steps: list[float], cuts: list[float], seed: int) -> None:
    time = np.concatenate([[0.0], np.cumsum(steps)])
    watts = np.random.default_rng(seed).uniform(0.0, 5e3, len(steps))
    joules = np.concatenate([[0.0], np.cumsum(watts * np.diff(time))])
    edges = time[-1] * np.array([0.0, *sorted(cuts), 1.0])
    if (np.diff(edges) > 0.0).all():
        total = mean_power(time, joules, edges) @ np.diff(edges)
        assert total == pytest.approx(joules[-1], rel=1e-9)


@pytest.mark.parametrize("offset", [-7.31, 0.0, 2.468])
@pytest.mark.parametrize("rate", [10.0, 250.0])
def test_the_offset_of_a_clock_is_found_within_a_sample(offset: float, rate: float) -> None:
    def power(time: np.ndarray) -> np.ndarray:
        bumps = [(3.0, 0.4), (5.5, 0.2), (6.1, 0.3), (11.0, 0.8), (16.0, 0.5)]
        return 400.0 + sum(3e3 * np.exp(-(((time - at) / width) ** 2)) for at, width in bumps)

    own = np.arange(0.0, 20.0, 0.01)
    other = np.arange(1.0, 18.0, 1.0 / rate)
    noise = np.random.default_rng(1).normal(0.0, 30.0, len(other))
    found = clock_offset(own, power(own), other, power(other + offset) + noise)
    assert found.seconds == pytest.approx(offset, abs=max(0.2 / rate, 1.0 / RATE))
    assert found.correlation > 0.95


def test_powers_of_two_runs_are_not_aligned() -> None:
    rng = np.random.default_rng(2)
    time = np.arange(0.0, 30.0, 0.01)
    with pytest.raises(RecorderError, match="give clock_offset"):
        clock_offset(time, rng.normal(size=len(time)), time, rng.normal(size=len(time)))
