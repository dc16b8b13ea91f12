"""Logs as controllers write them: names, units and times are those of their makers, and told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_recorder.errors import RecorderError
from ir_recorder.traces import Trace, TraceMapping, read_mapping, read_traces

NAMES = tuple(f"joint_a{k}" for k in range(1, 7))
HOME = np.array([0.0, -90.0, 90.0, 0.0, 30.0, 0.0])  # deg
COUNT = 40


def degrees() -> np.ndarray:
    """Rows (COUNT, 6) of a small motion [deg]."""
    share = np.linspace(0.0, 1.0, COUNT)[:, None]
    return HOME + 20.0 * share * np.arange(1, 7)


def table(path: Path, headings: list[str], rows: np.ndarray, sign: str = ",") -> Path:
    lines = [sign.join(headings)] if headings else []
    lines += [sign.join(f"{value:.9g}" for value in row) for row in rows]
    path.write_text("\n".join([*lines, ""]))
    return path


def read(path: Path, mapping: Path | None = None) -> Trace:
    (trace,) = read_traces(path, read_mapping(mapping) if mapping else None, NAMES)
    return trace


def timed(step: float, values: np.ndarray) -> np.ndarray:
    return np.column_stack([step * np.arange(len(values)), values])


def check(trace: Trace, step: float) -> None:
    assert trace.time - trace.time[0] == pytest.approx(step * np.arange(COUNT), abs=1e-6)
    for k, name in enumerate(NAMES):
        assert trace.columns[name] == pytest.approx(np.radians(degrees()[:, k]), abs=1e-7)


@pytest.mark.parametrize(
    ("time", "pattern", "first", "unit", "scale"),
    [
        ("timestamp", "actual_q_{}", 0, 1.0, 1.0),
        ("timestamp", "actual_q_{}", 1, 1.0, 1.0),
        ("timestamp", "actual_q[{}]", 0, 1.0, 1.0),
        ("timestamp", "actual_q[{}]", 1, 1.0, 1.0),
        ("timestamp [ms]", "actual_q[{}] (deg)", 0, 180 / np.pi, 1e3),
        ("IPOC", "AIPos.A{}", 1, 180 / np.pi, 1e3),
        ("Time [ms]", "AXIS_ACT.A{} [deg]", 1, 180 / np.pi, 1e3),
        ("Zeit [s]", "$AXIS_ACT_A{}", 1, 180 / np.pi, 1.0),
        ("time", "A{}", 1, 180 / np.pi, 1.0),
        ("time", "A{} [rad]", 1, 1.0, 1.0),
        ("time", "a{} (deg)", 1, 180 / np.pi, 1.0),
        ("time", "A{} [\N{DEGREE SIGN}]", 1, 180 / np.pi, 1.0),
        ("timestamp_ms", "actual_q_{} [degrees]", 0, 180 / np.pi, 1e3),
        ("timestamp", "actual_q_{}_deg", 0, 180 / np.pi, 1.0),
        ("time_ms", "J{}", 1, 180 / np.pi, 1e3),
        ("header.tm", "feedBack.joints.joints.{}", 0, 180 / np.pi, 1e3),
    ],
)
def test_headings_of_makers(
    tmp_path: Path, time: str, pattern: str, first: int, unit: float, scale: float
) -> None:
    rows = timed(0.004 * scale, np.radians(degrees()) * unit)
    path = table(tmp_path / "log.csv", [time, *(pattern.format(first + k) for k in range(6))], rows)
    trace = read(path)
    check(trace, 0.004)
    (note,) = trace.problems
    assert "are taken as positions of joint_a1 .. joint_a6" in note


def test_plain_names_are_degrees_only_where_that_is_proved(tmp_path: Path) -> None:
    headings = ["time", *(f"A{k}" for k in range(1, 7))]
    (note,) = read(table(tmp_path / "deg.csv", headings, timed(0.01, degrees()))).problems
    assert "which in rad is more than a turn" in note
    radians = table(tmp_path / "rad.csv", headings, timed(0.01, np.radians(degrees())))
    with pytest.raises(RecorderError, match=r"nothing proves one: .*A1 \[deg\]"):
        read(radians)


@given(scale=st.floats(0.0, 0.999))
def test_what_may_be_radians_is_never_taken_as_degrees(
    tmp_path_factory: pytest.TempPathFactory, scale: float
) -> None:
    """Axes 2 and 3 of an arm stay within a turn: values that do prove nothing."""
    values = scale * 2.0 * np.pi * np.cos(np.outer(np.arange(COUNT), np.arange(1, 7)))
    headings = ["time", *(f"A{k}" for k in range(1, 7))]
    path = table(tmp_path_factory.mktemp("log") / "a.csv", headings, timed(0.01, values))
    with pytest.raises(RecorderError, match="nothing proves one"):
        read(path)


@pytest.mark.parametrize(
    ("headings", "said"),
    [
        (["time", "A1", "A2", "A3", "A4", "A5", "A6", "A7"], "A7 is no joint"),
        (["time", "A1 [deg]", "A2", "A3", "A4", "A5", "A6"], "only some of"),
        (["Time", "A1", "A2", "A3", "A4", "A5", "A6"], "column Time has no unit"),
        (["A1", "A2", "A3", "A4", "A5", "A6"], "time: {step"),
    ],
)
def test_what_is_not_clear_is_refused(tmp_path: Path, headings: list[str], said: str) -> None:
    rows = np.tile(np.arange(COUNT)[:, None], (1, len(headings))) * 1.0
    path = table(tmp_path / "log.csv", headings, rows)
    with pytest.raises(RecorderError, match=said):
        read(path).joints(NAMES)


def test_columns_by_number_and_a_step(tmp_path: Path) -> None:
    mapping = tmp_path / "mapping.yaml"
    joints = "".join(f"  {name}: {{column: {k}, unit: deg}}\n" for k, name in enumerate(NAMES, 2))
    mapping.write_text(f"format: ir_trace/1\ncolumns:\n  time: {{column: 1, unit: ms}}\n{joints}")
    check(read(table(tmp_path / "bare.csv", [], timed(8.0, degrees())), mapping), 0.008)
    joints = "".join(f"  {name}: {{column: {k}, unit: deg}}\n" for k, name in enumerate(NAMES, 1))
    mapping.write_text(f"format: ir_trace/1\ncolumns:\n  time: {{step: 8, unit: ms}}\n{joints}")
    check(read(table(tmp_path / "timeless.csv", [], degrees()), mapping), 0.008)
    with pytest.raises(RecorderError, match="7 columns without headings"):
        read(tmp_path / "bare.csv")
    mapping.write_text(mapping.read_text().replace("column: 6", "column: 7"))
    with pytest.raises(RecorderError, match="no column 7"):
        read(tmp_path / "timeless.csv", mapping)


@pytest.mark.parametrize("step", ["0", "-1", "true", "x", "1e9", ".nan"])
def test_a_step_that_is_none_is_refused(tmp_path: Path, step: str) -> None:
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text(f"format: ir_trace/1\ncolumns:\n  time: {{step: {step}}}\n  joint_a1: 1\n")
    with pytest.raises(RecorderError, match="time"):
        read_mapping(mapping)


def rsi(rows: np.ndarray, clock: int = 4208163632) -> str:
    packets = []
    for k, row in enumerate(rows):
        axes = " ".join(f'A{i}="{value:.7f}"' for i, value in enumerate(row, 1))
        packets.append(
            f'<Rob Type="KUKA"><RIst X="1.0" A="9.0"/>\n<AIPos {axes}/><EIPos E1="{k}.0"/>'
            f"<IPOC>{clock + 4 * k}</IPOC></Rob>\n"
        )
    return "".join(packets)


def test_packets_of_rsi(tmp_path: Path) -> None:
    path = tmp_path / "rsi.xml"
    path.write_text(rsi(degrees()))
    trace = read(path)
    check(trace, 0.004)
    assert any("external axes E1 move" in each for each in trace.problems)


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ('A4="', 'A9="', r"rsi.xml:5: this packet of RSI has no AIPos A4"),
        ("IPOC>4208163640", "IPOC>soon", r"rsi.xml:5: IPOC is 'soon'"),
        ("</Rob>", "", "no packet of RSI"),
    ],
)
def test_a_damaged_packet_is_named(tmp_path: Path, before: str, after: str, said: str) -> None:
    path = tmp_path / "rsi.xml"
    text = rsi(degrees())
    third = text.index("<Rob", text.index("<Rob", 10) + 1)
    changed = (
        text.replace(before, after)
        if not after
        else (text[:third] + text[third:].replace(before, after, 1))
    )
    path.write_text(changed)
    with pytest.raises(RecorderError, match=said):
        read(path)


def kuka_trace(path: Path, rows: np.ndarray, name: str = "A{}", unit: str = "deg") -> Path:
    channel = "#BEGINCHANNELHEADER\n200,{}\n202,{}\n210,{}\n{}220,{}\n{}#ENDCHANNELHEADER\n"
    text = "DIAEXTENDED {@:ENGLISH\n#BEGINGLOBALHEADER\n1,WINDOWS 32Bit\n#ENDGLOBALHEADER\n"
    text += channel.format("Zeit", "s", "IMPLIZIT", "", len(rows), "240,0\n241,0.012\n")
    for k in range(6):
        own = f"211,{path.stem.upper()}.r64\n213,BLOCK\n214,REAL64\n"
        text += channel.format(
            name.format(k + 1), unit, "EXPLIZIT", own, len(rows), f"221,{k + 1}\n240,0\n241,0.5\n"
        )
    path.write_text(text)
    path.with_suffix(".r64").write_bytes((2.0 * rows).astype("<f8").tobytes())
    return path


def test_a_trace_of_a_kuka_controller(tmp_path: Path) -> None:
    check(read(kuka_trace(tmp_path / "ipo.dat", degrees())), 0.012)


def test_a_trace_that_was_cut_or_lacks_its_numbers_is_refused(tmp_path: Path) -> None:
    path = kuka_trace(tmp_path / "ipo.dat", degrees())
    numbers = path.with_suffix(".r64")
    numbers.write_bytes(numbers.read_bytes()[:-48])
    with pytest.raises(RecorderError, match="was it cut"):
        read(path)
    numbers.unlink()
    with pytest.raises(RecorderError, match="is not beside the header"):
        read(path)


def test_power_of_a_ur_is_its_voltage_times_its_current(tmp_path: Path) -> None:
    rows = timed(0.008, np.radians(degrees()))
    volts = 48.0 + 0.01 * np.arange(COUNT)
    amperes = 1.0 + 0.02 * np.arange(COUNT)
    heads = ["timestamp", *(f"actual_q_{k}" for k in range(6))]
    heads += ["actual_robot_voltage", "actual_robot_current"]
    table(tmp_path / "log.csv", heads, np.column_stack([rows, volts, amperes]), " ")
    trace = read(tmp_path / "log.csv")
    check(trace, 0.008)
    assert trace.columns["power"] == pytest.approx(volts * amperes)


def test_rows_that_are_counted_are_no_time_beside_the_clock_of_the_controller(
    tmp_path: Path,
) -> None:
    """Logs that went through a spreadsheet number their rows in a column time."""
    counted = np.column_stack([np.arange(1, COUNT + 1), timed(0.04, np.radians(degrees()))])
    heads = ["time", "timestamp", *(f"actual_q_{k}" for k in range(6))]
    trace = read(table(tmp_path / "log.csv", heads, counted))
    check(trace, 0.04)
    assert "timestamp as time, not time" in trace.problems[0]


def vectors(between: str, ends: str) -> list[str]:
    """Lines with all positions in one cell."""
    heads = '"timestamp";"actual_q";"actual_qd";"actual_robot_voltage";"actual_robot_current"'
    cells = [between.join(map(repr, row)) for row in np.radians(degrees()).tolist()]
    rest = f"[{', '.join('0' * 6)}];48;2"
    rows = [f'{0.008 * k};"{ends[0]}{each}{ends[1]}";{rest}' for k, each in enumerate(cells)]
    return [heads, *rows, ""]


@pytest.mark.parametrize("sign", [";", ","])
@pytest.mark.parametrize(("between", "ends"), [(", ", "[]"), (" ", "[]"), (",", "()")])
def test_vectors_in_one_cell_are_columns_of_their_own(
    tmp_path: Path, between: str, ends: str, sign: str
) -> None:
    lines = vectors(between, ends)
    if sign == ",":
        rows = [line.replace('"', "").split(";") for line in lines[:-1]]
        lines = [*(",".join(f'"{cell}"' for cell in row) for row in rows), ""]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines))
    trace = read(path)
    check(trace, 0.008)
    assert trace.columns["power"] == pytest.approx(96.0)
    assert trace.columns["joint_a6_velocity"] == pytest.approx(0.0)


def test_a_vector_of_another_length_is_named_with_its_line(tmp_path: Path) -> None:
    lines = vectors(", ", "[]")
    lines[7] = lines[7].replace("[", "[0.5, ", 1)
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines))
    with pytest.raises(RecorderError, match=":8: has 16 values, the header and the first row name"):
        read(path)


def test_a_log_of_a_ur_without_joints_is_a_meter(tmp_path: Path) -> None:
    heads = ["timestamp", "actual_TCP_pose_0", "actual_robot_voltage", "actual_robot_current"]
    rows = timed(0.008, np.tile([0.3, 48.0, 1.5], (COUNT, 1)))
    trace = read(table(tmp_path / "log.csv", heads, rows))
    assert trace.period == pytest.approx(0.008)
    assert trace.columns["power"] == pytest.approx(72.0)
    assert "timestamp is taken as time" in trace.problems[0]


@pytest.mark.parametrize("pattern", ["joint_a{}", "actual_q_{}", "A{}_deg"])
def test_a_log_without_time_is_read_by_its_step(tmp_path: Path, pattern: str) -> None:
    """Also where a column numbers the rows."""
    scale = 180 / np.pi if "deg" in pattern else 1.0
    first = 0 if "actual" in pattern else 1
    heads = ["time", *(pattern.format(first + k) for k in range(6))]
    counted = timed(1.0, scale * np.radians(degrees()))
    path = table(tmp_path / "log.csv", heads, counted)
    bare = table(tmp_path / "bare.csv", heads[1:], counted[:, 1:])
    for each in (path, bare):
        (trace,) = read_traces(each, TraceMapping(step=0.008), NAMES)
        check(trace, 0.008)
    with pytest.raises(RecorderError, match="ir energy --rate"):
        read(bare)


UR = ["timestamp", *(f"actual_q_{k}" for k in range(6))]
POWER = ["actual_robot_voltage", "actual_robot_current [mA]"]


def ur_rows(*more: float) -> np.ndarray:
    """Positions as RTDE gives them, and further columns of constants."""
    rows = timed(0.008, np.radians(degrees()))
    return np.column_stack([rows, np.tile(more, (COUNT, 1))])


def test_units_of_headings_count_in_a_product(tmp_path: Path) -> None:
    path = table(tmp_path / "log.csv", [*UR, *POWER], ur_rows(48.0, 2000.0))
    assert read(path).columns["power"] == pytest.approx(96.0)


def test_a_meters_own_column_comes_before_the_power_of_the_bus(tmp_path: Path) -> None:
    path = table(tmp_path / "log.csv", [*UR, *POWER, "power_kW"], ur_rows(48.0, 2000.0, 0.12))
    assert read(path).columns["power"] == pytest.approx(120.0)


def test_a_unit_that_nobody_knows_is_refused(tmp_path: Path) -> None:
    headings = ["timestamp", *(f"actual_q_{k} [gon]" for k in range(6))]
    path = table(tmp_path / "log.csv", headings, ur_rows())
    with pytest.raises(RecorderError, match="unit 'gon' is unknown"):
        read(path)


def test_a_joint_that_is_missing_is_named(tmp_path: Path) -> None:
    path = table(tmp_path / "log.csv", UR[:-1], ur_rows()[:, :-1])
    with pytest.raises(RecorderError, match=r"actual_q_0 and no actual_q_5: the robot has 6"):
        read(path)


def test_files_of_one_axis_each_are_joined(tmp_path: Path) -> None:
    rows = degrees()
    for k in range(6):
        one = np.tile(rows[:, k : k + 1], (1, 6))
        path = kuka_trace(tmp_path / f"run_A{k + 1}.dat", one, "Torque {}", "Nm")
        path.write_text(path.read_text().replace("200,Torque 1\n202,Nm", "200,AXIS_ACT\n202,deg"))
    trace = read(tmp_path / "run_A4.dat")
    check(trace, 0.012)
    assert any("run_A1.dat .. run_A6.dat are joined" in each for each in trace.problems)
    third = tmp_path / "run_A3.dat"
    third.write_text(third.read_text().replace("241,0.012", "241,0.004"))
    with pytest.raises(RecorderError, match=r"run_A3\.dat: its instants are not those"):
        read(tmp_path / "run_A1.dat")


def test_runs_that_are_counted_are_not_joined(tmp_path: Path) -> None:
    for k in range(1, 7):
        kuka_trace(tmp_path / f"run_{k}.dat", degrees() + k)
    trace = read(tmp_path / "run_2.dat")
    assert trace.columns["joint_a5"] == pytest.approx(np.radians(degrees()[:, 4] + 2))
    assert not any("joined" in each for each in trace.problems)


def varint(value: int) -> bytes:
    out = b""
    while value > 0x7F:
        out += bytes([value & 0x7F | 0x80])
        value >>= 7
    return out + bytes([value])


def field(number: int, value: int | bytes) -> bytes:
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    return varint(number << 3 | 2) + varint(len(value)) + value


def egm(
    number: int, joints: np.ndarray, *, clock: bool, packed: bool = False, begin: int = 0
) -> bytes:
    """A message EgmRobot, by the numbers of ABB's egm.proto. begin: the clock's ms at number 0."""
    values = (
        field(1, np.asarray(joints, "<f8").tobytes())
        if packed
        else b"".join(b"\x09" + np.float64(each).tobytes() for each in joints)
    )
    seconds, rest = divmod(1_700_000_000_000 + 4 * number, 1000)
    time = field(4, field(1, seconds) + field(2, 1000 * rest)) if clock else b""
    header = field(1, number) + field(2, (begin + 4 * number) % 2**32) + field(3, 2)
    pose = field(2, field(1, b"\x09" + bytes(8)))
    return (
        field(1, header) + field(2, field(1, values) + pose + time) + field(10, b"\x09" + bytes(8))
    )


FRAMES = {
    "varint": lambda each: varint(len(each)) + each,
    "little": lambda each: len(each).to_bytes(4, "little") + each,
    "big": lambda each: len(each).to_bytes(4, "big") + each,
    "none": lambda each: each,
}


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("clock", [True, False])
def test_messages_of_egm(tmp_path: Path, frame: str, clock: bool) -> None:
    messages = [
        FRAMES[frame](egm(k, row, clock=clock, packed=clock)) for k, row in enumerate(degrees())
    ]
    path = tmp_path / "log.egm"
    path.write_bytes(b"".join(messages))
    trace = read(path)
    check(trace, 0.004)
    assert any("joints in degrees" in each for each in trace.problems)
    late = [*messages[:5], messages[6], messages[5], *messages[7:]]
    path.write_bytes(b"".join(late) + messages[-1] + messages[3][:20])
    trace = read(path)
    check(trace, 0.004)
    said = " ".join(trace.problems)
    assert "1 messages came late" in said
    assert "have the time of another one" in said
    assert "bytes at the end" in said


def test_late_messages_of_egm_are_counted_and_a_second_session_is_refused(tmp_path: Path) -> None:
    """Ten steps are the bound: within it no order of two sessions looks like one."""
    path = tmp_path / "log.egm"
    messages = [
        varint(len(m)) + m for m in (egm(k, r, clock=False) for k, r in enumerate(degrees()))
    ]
    held = 5
    for delay in (1, 9, 10, 11):
        moved = messages[:held] + messages[held + 1 : held + 1 + delay]
        path.write_bytes(b"".join([*moved, messages[held], *messages[held + 1 + delay :]]))
        if delay > 10:
            with pytest.raises(RecorderError, match=r"message 17 .*time is 0\.02 s, 0\.064 s"):
                read(path)
            continue
        trace = read(path)
        check(trace, 0.004)
        assert any(each.startswith("1 messages came late") for each in trace.problems)
    block = messages[:20] + messages[23:26] + messages[20:23] + messages[26:]
    path.write_bytes(b"".join(block))
    trace = read(path)
    check(trace, 0.004)
    assert any(each.startswith("3 messages came late") for each in trace.problems)
    mixed = np.random.default_rng(1).permutation(len(messages))
    path.write_bytes(b"".join(messages[k] for k in mixed))
    with pytest.raises(RecorderError, match="the clock began anew"):
        read(path)
    again = [egm(k, row + 1.0, clock=False, begin=2) for k, row in enumerate(degrees())]
    path.write_bytes(b"".join([*messages, *(varint(len(each)) + each for each in again)]))
    last = 0.004 * (len(messages) - 1)
    said = rf"message {len(messages) + 1} .*number 0\): time is 0\.002 s, {last:g} s came before"
    with pytest.raises(RecorderError, match=said):
        read(path)


def test_the_clock_of_egm_goes_on_where_its_32_bits_end(tmp_path: Path) -> None:
    path = tmp_path / "log.egm"
    rows = list(enumerate(degrees()))
    whole = [egm(k, row, clock=False, begin=2**32 - 40) for k, row in rows]
    for messages in (whole, [*whole[:9], whole[10], whole[9], *whole[11:]]):
        path.write_bytes(b"".join(varint(len(each)) + each for each in messages))
        trace = read(path)
        check(trace, 0.004)
        assert any("begins again at 2^32: 1 times" in each for each in trace.problems)
    far = [egm(k, row, clock=False, begin=-(2**31) if k < 9 else 0) for k, row in rows]
    path.write_bytes(b"".join(varint(len(each)) + each for each in far))
    with pytest.raises(RecorderError, match="the clock began anew"):
        read(path)


def test_what_is_no_log_of_a_robots_egm_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.egm"
    whole = [egm(k, row, clock=True) for k, row in enumerate(degrees())]
    command = [field(1, field(1, k) + field(3, 3)) + field(2, b"") for k in range(9)]
    seven = [egm(k, np.append(row, 0.0), clock=True) for k, row in enumerate(degrees())]
    cases = {
        b"".join(varint(len(each)) + each for each in command): "no feedback of the robot",
        b"".join(varint(len(each)) + each for each in seven): "must be 6 finite numbers",
        b"time,j1,j2\n0,1,2\n" * 9: "is no log of EGM",
        b"\xff\xff" + b"".join(whole): "is no log of EGM",
        b"": "is no log of EGM",
    }
    for content, said in cases.items():
        path.write_bytes(content)
        with pytest.raises(RecorderError, match=said):
            read(path)
