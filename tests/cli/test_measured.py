"""Measured positions: what their energy is worth, gaps, logs of controllers, standstills."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from ir_cli.errors import InputError
from ir_cli.offline.measured import measured
from ir_cli.offline.today_trace import stretches_of
from ir_cli.offline.trace_file import read_motion
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner, PlanOptions, parse_goal
from ir_planner.checks import movement_energy

TRACES = Path(__file__).resolve().parents[2] / "examples" / "traces"


@pytest.fixture(scope="module")
def planner() -> Planner:
    planner = Planner(time.monotonic)
    planner.set_cell("", "open")
    return planner


@pytest.fixture(scope="module")
def movement(planner: Planner) -> JointTrajectory:
    plan = planner.plan_regional(planner.cell.machine_home, parse_goal("p1", planner.cell), PlanOptions())
    assert plan.trajectory is not None
    return plan.trajectory


def sampled(movement: JointTrajectory, rate: float, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the movement with half a second of standstill around it."""
    times = np.arange(0.0, movement.duration + 1.0, 1.0 / rate)
    q = movement.sample(np.clip(times - 0.5, 0.0, movement.duration)).q
    return times, q + np.random.default_rng(1).normal(0.0, noise, q.shape)


@pytest.mark.parametrize(("rate", "noise"), [(250.0, 0.0), (83.3, 1e-5), (83.3, 1e-4), (20.0, 1e-5)])
def test_the_energy_of_positions_alone_holds_within_the_bound_that_is_stated(
    planner: Planner, movement: JointTrajectory, rate: float, noise: float
) -> None:
    scene = planner.scene("")
    still = movement_energy(movement, scene).total
    found = measured(
        JOINT_NAMES, *sampled(movement, rate, noise), lambda one: movement_energy(one, scene).total, 8.0
    )
    stretches, lost = stretches_of(found.trajectory)
    stretch = max(stretches, key=lambda one: one.seconds)
    assert stretch.trajectory is not None
    moving = movement_energy(stretch.trajectory, scene).total
    beyond = (stretch.seconds - movement.duration) * 800.0  # W: more than motors at rest take
    assert abs(moving - still) <= found.bound + max(beyond, 0.0)
    assert found.bound < 0.1 * still
    assert sum(one.seconds for one in stretches) + lost == pytest.approx(found.trajectory.duration, abs=1e-6)


def test_much_noise_leaves_much_open(planner: Planner, movement: JointTrajectory) -> None:
    scene = planner.scene("")
    joules = lambda one: movement_energy(one, scene).total  # noqa: E731
    bounds = [measured(JOINT_NAMES, *sampled(movement, 83.3, s), joules, 16.0).bound for s in (1e-6, 3e-4)]
    assert bounds[1] > 2.0 * bounds[0]


@pytest.mark.parametrize("name", ["kuka_trace", "rsi_log", "rtde_log"])
def test_logs_of_controllers_are_read_by_their_mapping(name: str) -> None:
    found = read_motion(TRACES / f"{name}.csv", JOINT_NAMES, TRACES / f"{name}.yaml")
    assert not isinstance(found, JointTrajectory)
    times, q = found
    assert times[0] == 0.0
    assert times[-1] == pytest.approx(4.79, abs=0.01)
    assert np.degrees(q[0]) == pytest.approx([0.0, -90.0, 90.0, 0.0, 0.0, 0.0], abs=0.01)


def trace_of(path: Path, rows: list[tuple[float, float]]) -> Path:
    head = "time," + ",".join(JOINT_NAMES)
    lines = [f"{t},{a},-1.5,1.5,0,0.5,0" for t, a in rows]
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return path


def test_a_gap_in_which_the_robot_moved_is_refused(tmp_path: Path) -> None:
    rows = [(0.01 * k, 0.0) for k in range(20)] + [(1.0 + 0.01 * k, 0.5) for k in range(20)]
    with pytest.raises(InputError, match=r"between 0.190 s and 1.000 s there are no rows"):
        read_motion(trace_of(tmp_path / "gap.csv", rows), JOINT_NAMES)


def test_a_gap_at_a_standstill_is_one(tmp_path: Path) -> None:
    rows = [(0.01 * k, 0.0) for k in range(20)] + [(1.0 + 0.01 * k, 0.0) for k in range(20)]
    times, _ = read_motion(trace_of(tmp_path / "still.csv", rows), JOINT_NAMES)
    assert times[-1] == pytest.approx(1.19)


def test_rows_in_a_wrong_unit_of_time_are_a_sentence() -> None:
    """Milliseconds taken for seconds: an hour of rows 12 s apart was smoothed for minutes."""
    time = 12.0 * np.arange(300)
    with pytest.raises(InputError, match=r"the rows are 12 s apart: .* at most 0.1 s; is the unit of time"):
        measured(("a",), time, np.zeros((300, 1)), lambda _: 0.0)


def test_few_rows_are_a_sentence() -> None:
    with pytest.raises(InputError, match="3 rows of positions alone: 8 to"):
        measured(JOINT_NAMES, np.arange(3.0), np.zeros((3, 6)), lambda _: 1.0)


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
