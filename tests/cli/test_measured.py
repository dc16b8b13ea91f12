"""Measured positions: what their energy is worth, gaps, logs of controllers, standstills."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from ir_cli.errors import InputError
from ir_cli.main import main
from ir_cli.output import ProgressLine
from ir_cli.smoothing import measured
from ir_cli.trace_programs import stretches_of
from ir_cli.traces import Rows, between, counted_turns, read_motion, write_trace
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner, parse_goal
from ir_planner.checks import movement_energy

TRACES = Path(__file__).resolve().parents[2] / "examples" / "traces"


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner("open", clock=lambda: 0.0)


@pytest.fixture(scope="module")
def movement(planner: Planner) -> JointTrajectory:
    plan = planner.plan_regional(
        start=planner.cell.machine_home, goal=parse_goal("p1", planner.cell)
    )
    assert plan.trajectory is not None
    return plan.trajectory


def sampled(
    movement: JointTrajectory, rate: float, noise: float, seed: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the movement with half a second of standstill around it."""
    times = np.arange(0.0, movement.duration + 1.0, 1.0 / rate)
    q = movement.sample(np.clip(times - 0.5, 0.0, movement.duration)).q
    return times, q + np.random.default_rng(seed).normal(0.0, noise, q.shape)


@pytest.mark.parametrize(
    ("rate", "noise"), [(250.0, 0.0), (83.3, 1e-5), (83.3, 1e-4), (20.0, 1e-5)]
)
def test_the_energy_of_positions_alone_holds_within_the_bound_that_is_stated(
    planner: Planner, movement: JointTrajectory, rate: float, noise: float
) -> None:
    scene = planner.scene("")
    still = movement_energy(movement, scene).total
    found = measured(
        JOINT_NAMES,
        *sampled(movement, rate, noise),
        lambda one: movement_energy(one, scene).total,
        8.0,
    )
    stretches, lost = stretches_of(found.trajectory)
    stretch = max(stretches, key=lambda one: one.seconds)
    assert stretch.trajectory is not None
    moving = movement_energy(stretch.trajectory, scene).total
    beyond = (stretch.seconds - movement.duration) * 800.0  # W: more than motors at rest take
    assert abs(moving - still) <= found.bound + max(beyond, 0.0)
    assert found.bound < 0.1 * still
    assert sum(one.seconds for one in stretches) + lost == pytest.approx(
        found.trajectory.duration, abs=1e-6
    )


def test_much_noise_leaves_much_open(planner: Planner, movement: JointTrajectory) -> None:
    scene = planner.scene("")
    joules = lambda one: movement_energy(one, scene).total  # noqa: E731
    bounds = [
        measured(JOINT_NAMES, *sampled(movement, 83.3, s), joules, 16.0).bound for s in (1e-6, 3e-4)
    ]
    assert bounds[1] > 2.0 * bounds[0]


@pytest.mark.parametrize("name", ["kuka_trace", "rsi_log", "rtde_log"])
def test_logs_of_controllers_are_read_by_their_mapping(name: str) -> None:
    found = read_motion(TRACES / f"{name}.csv", JOINT_NAMES, TRACES / f"{name}.yaml")
    assert not isinstance(found, JointTrajectory)
    times, q, _ = found
    assert times[0] == 0.0
    assert times[-1] == pytest.approx(4.79, abs=0.01)
    assert np.degrees(q[0]) == pytest.approx([0.0, -90.0, 90.0, 0.0, 0.0, 0.0], abs=0.01)


def trace_of(path: Path, rows: list[tuple[float, float]]) -> Path:
    head = "time," + ",".join(JOINT_NAMES)
    lines = [f"{t},{a},-1.5,1.5,0,0.5,0" for t, a in rows]
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return path


SWING = [(0.01 * k, round(0.3 * np.sin(0.01 * k) ** 2, 6)) for k in range(200)]


@pytest.mark.parametrize(("given", "total"), [((), 24), (("--bandwidth", "11"), 6)])
@pytest.mark.parametrize("cut", [(), ("--between", "0.5", "1.5")])
def test_a_trace_says_how_far_its_smoothing_is(
    given: tuple[str, ...],
    total: int,
    cut: tuple[str, ...],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shown: list[tuple[str, int, int]] = []
    monkeypatch.setattr(
        ProgressLine, "show", lambda line, phase, done, of, cost: shown.append((phase, done, of))
    )
    trace = trace_of(tmp_path / "t.csv", SWING)
    main(["ask", "evaluate", "open", str(trace), *cut, *given])
    smoothing = [("smooth", done, total) for done in range(total + 1)]
    assert shown == [("read t.csv", 0, 1), *smoothing, ("evaluate", 0, 1)]
    assert capsys.readouterr().err == ""  # nobody looks


@pytest.mark.parametrize("command", ["optimize", "compare"])
def test_other_commands_with_a_trace_say_so_too(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class EnoughError(Exception):
        """The smoothing is done; what follows takes long."""

    def show(line: ProgressLine, phase: str, done: int, of: int, cost: float) -> None:
        if (phase, done) == ("smooth", of):
            raise EnoughError

    monkeypatch.setattr(ProgressLine, "show", show)
    trace = trace_of(tmp_path / "t.csv", SWING)
    with pytest.raises(EnoughError):
        main([command, "open", str(trace)])


def test_a_gap_in_which_the_robot_moved_is_refused(tmp_path: Path) -> None:
    rows = [(0.01 * k, 0.0) for k in range(20)] + [(1.0 + 0.01 * k, 0.5) for k in range(20)]
    with pytest.raises(InputError, match=r"between 0.190 s and 1.000 s there are no rows"):
        read_motion(trace_of(tmp_path / "gap.csv", rows), JOINT_NAMES)


def test_a_gap_at_a_standstill_is_one(tmp_path: Path) -> None:
    rows = [(0.01 * k, 0.0) for k in range(20)] + [(1.0 + 0.01 * k, 0.0) for k in range(20)]
    times, *_ = read_motion(trace_of(tmp_path / "still.csv", rows), JOINT_NAMES)
    assert times[-1] == pytest.approx(1.19)


def test_rows_in_a_wrong_unit_of_time_are_a_sentence() -> None:
    """Milliseconds taken for seconds: an hour of rows 12 s apart was smoothed for minutes."""
    time = 12.0 * np.arange(300)
    with pytest.raises(
        InputError, match=r"the rows are 12 s apart: .* at most 0.1 s; is the unit of time"
    ):
        measured(("a",), time, np.zeros((300, 1)), lambda _: 0.0)


def logged(movement: JointTrajectory) -> tuple[np.ndarray, np.ndarray]:
    times = np.arange(0.0, movement.duration, 0.004)
    return times, movement.sample(times).q


@pytest.mark.parametrize("first", [175.0, -175.0, 5.0])
def test_turns_that_a_log_does_not_count_are_counted(
    planner: Planner, movement: JointTrajectory, first: float
) -> None:
    """A log within half a turn jumps by a whole one where the joint goes on."""
    robot = planner.cell.robot
    (times, q) = logged(movement)
    q = q + np.radians([0, 0, 0, 0, 0, first])
    q[:, 5] += np.radians(20.0) * times / times[-1] * np.sign(first)
    written = (q + np.pi) % (2.0 * np.pi) - np.pi
    found, notes = counted_turns("log", times, written, robot)
    np.testing.assert_allclose(np.diff(found, axis=0), np.diff(q, axis=0), atol=1e-12)
    assert ((found >= robot.position_min) & (found <= robot.position_max)).all()
    turned = abs(first) > 90.0
    assert notes == (
        ("joint_a6 jumps by whole turns in the file: taken as going on",) if turned else ()
    )


def test_what_the_robot_can_not_have_driven_is_refused(
    planner: Planner, movement: JointTrajectory
) -> None:
    """A wrong unit was a movement of 38 MJ, of which the planner saved 99 %."""
    robot = planner.cell.robot
    (times, q) = logged(movement)
    jump = q + np.where(times > times[40], 0.5, 0.0)[:, None] * np.eye(6)[3]
    for time_, positions, words in (
        (times, np.degrees(q), "times as fast as it can: are the units"),
        (times * 1e-3, q, "times as fast as it can"),
        (times, jump, "joint_a4 moves by 28.6 deg between 0.160 s and 0.164 s"),
        (
            times,
            0.0 * q + np.eye(6)[0] * -90.0,
            "joint_a1 is at -5157 deg, its range is -185 to 185 deg",
        ),
    ):
        with pytest.raises(InputError, match=re.escape(words)):
            counted_turns("log", time_, positions, robot)


@pytest.mark.parametrize("factor", [0.0, -1.0, 57.3])
def test_speeds_that_positions_contradict_are_refused(
    movement: JointTrajectory, factor: float, tmp_path: Path
) -> None:
    """Speeds of zero made 690 kJ of a movement of 7 kJ."""
    at = movement.sample(np.arange(0.0, movement.duration, 0.012))
    path = tmp_path / "t.csv"
    times = np.arange(len(at.q)) * 0.012
    write_trace(path, JointTrajectory.from_seconds(JOINT_NAMES, times, at.q, at.qd, at.qdd))
    assert isinstance(read_motion(path, JOINT_NAMES), JointTrajectory)
    wrong = JointTrajectory.from_seconds(JOINT_NAMES, times, at.q, factor * at.qd, factor * at.qdd)
    write_trace(path, wrong)
    with pytest.raises(InputError, match=r"rad in all, by its speeds it is .* which is right"):
        read_motion(path, JOINT_NAMES)
    write_trace(path, JointTrajectory.from_seconds(JOINT_NAMES, times, at.q, factor * at.qd))
    assert not isinstance(
        read_motion(path, JOINT_NAMES), JointTrajectory
    )  # speeds alone are measured ones


def test_one_cycle_is_taken_out_of_a_long_file() -> None:
    rows = Rows(np.arange(10.0), np.zeros((10, 6)), ("a note",))
    found = between(Path("t.csv"), rows, 3.0, 6.0)
    np.testing.assert_array_equal(found.time, [0.0, 1.0, 2.0, 3.0])
    assert found.notes == ("a note",)
    for begin, end in ((6.0, 3.0), (100.0, 200.0), (float("nan"), 5.0)):
        with pytest.raises(InputError, match=r"holds no two rows of t\.csv, which lasts 9 s"):
            between(Path("t.csv"), rows, begin, end)


@pytest.mark.parametrize("bandwidth", [-1.0, 0.001, 1e9, float("nan"), float("inf")])
def test_a_bandwidth_that_makes_no_sense_is_refused(bandwidth: float) -> None:
    """0.001 Hz smoothed the movement away and stated a bound of a fifth of the error."""
    with pytest.raises(InputError, match="it must be 0, or 5 to 100 Hz"):
        measured(JOINT_NAMES, 0.01 * np.arange(20.0), np.zeros((20, 6)), lambda _: 1.0, bandwidth)


@pytest.mark.parametrize(
    ("columns", "words"), [("{time: t, powr: P}", "'powr' is no column of a trace")]
)
def test_a_name_that_a_mapping_gets_wrong_is_named(
    columns: str, words: str, tmp_path: Path
) -> None:
    (tmp_path / "m.yaml").write_text(f"format: ir_trace/1\ncolumns: {columns}\n", encoding="utf-8")
    with pytest.raises(InputError, match=words):
        read_motion(TRACES / "rsi_log.csv", JOINT_NAMES, tmp_path / "m.yaml")


def test_an_empty_column_is_named(tmp_path: Path) -> None:
    head = "time," + ",".join(JOINT_NAMES)
    (tmp_path / "t.csv").write_text(f"{head}\n0,0,0,,0,0,0\n1,0,0,,0,0,0\n", encoding="utf-8")
    with pytest.raises(InputError, match="the column of joint_a3 is empty"):
        read_motion(tmp_path / "t.csv", JOINT_NAMES)


def test_few_rows_are_a_sentence() -> None:
    with pytest.raises(InputError, match="3 rows of positions alone: 8 to"):
        measured(JOINT_NAMES, np.arange(3.0), np.zeros((3, 6)), lambda _: 1.0)


def test_a_movement_lasts_as_long_as_it_did(movement: JointTrajectory) -> None:
    """Below a threshold of speed 12 ms were cut off at each end: a fast movement seemed to break
    limits. Noise beside an end may look like motion: the median of nine draws is held to the bound.
    """
    lengths = []
    for seed in range(9):
        rows = sampled(movement, 500.0, 1e-5, seed)
        found = measured(JOINT_NAMES, *rows, lambda _: 1.0, 22.0)
        ((stretch,), lost) = stretches_of(found.trajectory)
        lengths.append(stretch.seconds)
        assert stretch.seconds + lost == pytest.approx(found.trajectory.duration, abs=1e-6)
    assert np.median(lengths) == pytest.approx(movement.duration, abs=0.016)


def test_pauses_of_a_trace_are_standstills_of_half_a_second(movement: JointTrajectory) -> None:
    """There, 0.7 s of rest, and back: two movements and a pause."""
    times = np.arange(0.0, 2.0 * movement.duration + 0.7, 0.004)
    there = movement.sample(np.clip(times, 0.0, movement.duration)).q
    home = movement.sample(np.clip(2.0 * movement.duration + 0.7 - times, 0.0, movement.duration)).q
    q = np.where((times < movement.duration + 0.35)[:, None], there, home)
    found = measured(JOINT_NAMES, times, q, lambda _: 1.0, 16.0)
    stretches, _ = stretches_of(found.trajectory)
    assert [one.trajectory is None for one in stretches] == [False, True, False]
    assert stretches[1].seconds == pytest.approx(0.7, abs=0.1)
