"""A fit finds the robot that drew the power, says how sure it is, and what the data do not
determine.

The robots here are drawn from the prior and run through the forward model with noise; other plants
are `benchmarks/truth.py`'s.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from ir_cli.main import main
from ir_description import PowerParameters, data_sheet, load_cell, load_power_data
from ir_description.library import load_power_parameters
from ir_description.robot import physical_bounds
from ir_recorder.errors import RecorderError
from ir_recorder.fit import DataSource, Fit, fit, fit_data, sentences
from ir_recorder.fit.fit_data import check_range, check_readings, check_speed
from ir_recorder.fit.power_estimate import by_window
from ir_recorder.measure import PowerModel, Samples, movements
from ir_recorder.traces import Trace

CELL = load_cell("demo")
PRIOR = data_sheet()
STEP = 0.01
MODEL = PowerModel(CELL.robot, load_power_data().dc_link, CELL.base_pose, PRIOR)
NOISE = 20.0  # W of a sample


def programme(seed: int, count: int, modes: int) -> Samples:
    """Movements between random postures about home at several speeds, then `modes` modes for 5 s
    each.
    """
    rng = np.random.default_rng(seed)
    robot = CELL.robot
    here = np.array(robot.machine_home)
    parts = []
    low = np.maximum(robot.position_min, here - 1.2)
    high = np.minimum(robot.position_max, here + 1.2)
    for k in range(count):
        there = np.where(rng.random(6) < 0.6, rng.uniform(low, high), here)
        travel = there - here
        seconds = (
            np.sqrt((np.abs(travel) * 5.8 / robot.acceleration_max).max() + 0.01)
            + 1.9 * (np.abs(travel) / robot.velocity_max).max()
        )
        seconds *= rng.choice([1.0, 1.5, 3.0])
        x = ((np.arange(int(seconds / STEP)) + 0.5) * STEP / seconds)[:, None]
        q = here + travel * (10 * x**3 - 15 * x**4 + 6 * x**5)
        qd = travel * (30 * x**2 - 60 * x**3 + 30 * x**4) / seconds
        qdd = travel * (60 * x - 180 * x**2 + 120 * x**3) / seconds**2
        parts.append((np.stack([q, qd, qdd]), 0, int(k >= count // 2)))
        parts.append((_still(there, 50), 0, int(k >= count // 2)))
        here = there
    parts += [(_still(here, 500), mode, 1) for mode in range(modes)]
    motion = np.concatenate([each for each, _, _ in parts], axis=1)
    mode, load = (np.concatenate([np.full(p[0].shape[1], p[k]) for p in parts]) for k in (1, 2))
    time = (np.arange(len(mode)) + 0.5) * STEP
    loads = ((CELL.tool,), CELL.loads(CELL.parts[0].name))
    return Samples(STEP, time, *motion, mode, load, mode == 0, np.full(len(mode), np.nan), loads)


def _still(q: np.ndarray, count: int) -> np.ndarray:
    return np.stack([np.tile(q, (count, 1)), np.zeros((count, 6)), np.zeros((count, 6))])


def metered(samples: Samples, truth: PowerParameters, seed: int) -> Samples:
    watts = MODEL.watts(truth.mean, MODEL.prepare(samples))
    return replace(
        samples, watts=watts + np.random.default_rng(seed).normal(0.0, NOISE, len(watts))
    )


@dataclass(frozen=True)
class Case:
    truth: PowerParameters
    found: Fit


@pytest.fixture(scope="module", params=[1, pytest.param(2, marks=pytest.mark.long)])
def case(request: pytest.FixtureRequest) -> Case:
    truth = PRIOR.drawn(request.param)
    return Case(truth, fit(metered(programme(request.param, 30, 4), truth, 1), MODEL, PRIOR))


def test_energies_of_other_movements_are_predicted_and_covered(case: Case) -> None:
    others = programme(99, 25, 0)
    prepared = MODEL.prepare(others)
    truth = MODEL.watts(case.truth.mean, prepared)
    after = MODEL.watts(case.found.parameters.mean, prepared)
    drawn = np.array([MODEL.watts(draw, prepared) for draw in case.found.parameters.draws(60, 0)])
    errors = []
    inside = []
    for first, behind in movements(others):
        energy = truth[first:behind].sum()
        errors.append(abs(after[first:behind].sum() / energy - 1.0))
        low, high = np.percentile(drawn[:, first:behind].sum(axis=1), [5.0, 95.0])
        inside.append(low <= energy <= high)
    assert np.median(errors) < 0.002
    assert max(errors) < 0.01
    assert (
        np.mean(inside) > 0.4
    )  # of one robot's movements, which share their errors; 0.9 over many robots


def test_what_is_fitted_is_physical_and_no_less_certain(case: Case) -> None:
    low, high = physical_bounds(PRIOR.names)
    found = case.found.parameters
    assert (found.mean >= low).all()
    assert (found.mean <= high).all()
    assert (found.deviation <= PRIOR.deviation * (1.0 + 1e-6)).all()
    fitted = case.found.determined
    off = np.abs(found.mean - case.truth.mean)[fitted] / found.deviation[fitted]
    assert np.mean(off < 2.5) > 0.8


def test_the_noise_is_that_of_the_meter(case: Case) -> None:
    for noise in case.found.noise:
        assert noise == pytest.approx(NOISE / np.sqrt(5.0), rel=0.15)
    for each in case.found.movements:
        assert each.after == pytest.approx(each.measured, rel=0.02)


def test_what_the_data_do_not_show_is_named_and_kept() -> None:
    samples = metered(programme(3, 12, 1), PRIOR.drawn(3), 3)  # no mode but motors on
    still = replace(samples, q=samples.q.copy(), qd=samples.qd.copy(), qdd=samples.qdd.copy())
    for array in (still.q, still.qd, still.qdd):
        array[:, 3] = 0.0  # A4 never moves
    found = fit(metered(still, PRIOR.drawn(3), 3), MODEL, PRIOR)
    kept = {"viscous.joint_a4", "coulomb.joint_a4", "watts.BUS_POWER_OFF", "watts.HIBERNATION"}
    assert kept <= set(found.kept)
    for name in kept:
        assert found.parameters.value(name) == pytest.approx(PRIOR.value(name))
    assert "watts.HIBERNATION" in " ".join(sentences(found))


def test_a_meter_that_reads_too_seldom_is_refused_with_its_interval() -> None:
    time = np.arange(0.0, 60.0, 1.0)
    check_readings(Trace("meter.csv", 0.1 * time, {"power": 500.0 + time}))
    with pytest.raises(
        RecorderError,
        match=r"meter\.csv: a reading of power every 1 s, a fit needs one every 0\.25 s",
    ):
        check_readings(Trace("meter.csv", time, {"power": 500.0 + time}))


def test_data_without_motion_say_so_and_data_that_determine_nothing_are_refused() -> None:
    """A robot at rest shows the watts of its modes, but nothing of motion; in one mode not even
    these.
    """
    whole = programme(6, 1, 3)
    still = replace(
        whole, q=np.tile(whole.q[-1], (len(whole), 1)), qd=0.0 * whole.qd, qdd=0.0 * whole.qdd
    )
    rests = metered(still.part(still.time[-1500], np.inf), PRIOR.drawn(6), 6)
    found = fit(rests, MODEL, PRIOR)
    assert not found.movements
    assert {name.partition(".")[0] for name in found.kept} >= {"viscous", "coulomb", "iron", "gear"}
    assert any("nothing moves" in sentence for sentence in sentences(found))
    one = metered(still.part(still.time[-1500], still.time[-1000]), PRIOR.drawn(6), 6)
    with pytest.raises(
        RecorderError, match=r"none of the \d+ power parameters.* moves in 0\.0 of 5\.0 s"
    ):
        fit(one, MODEL, PRIOR)


SMALL = [
    (1, 6),
    *(pytest.param(*each, marks=pytest.mark.long) for each in ((3, 8), (4, 6), (7, 5))),
]


@pytest.mark.parametrize(("seed", "count"), SMALL)
def test_a_small_programme_ends_in_no_local_minimum(seed: int, count: int) -> None:
    """Least squares of SciPy's, begun at the robot that gave the data, finds nothing cheaper."""
    truth = PRIOR.drawn(seed)
    samples = metered(programme(seed, count, 1), truth, seed)
    prepared = MODEL.prepare(samples)
    white = PRIOR.deviation

    def missing(mean: np.ndarray) -> np.ndarray:
        pull = (mean - PRIOR.mean) / white
        return np.concatenate(
            [by_window(MODEL.watts(mean, prepared) - samples.watts) / NOISE, pull]
        )

    def slopes(mean: np.ndarray) -> np.ndarray:
        rows = by_window(MODEL.watts_and_slopes(mean, prepared)[1]) / NOISE
        return np.concatenate([rows, np.diag(1.0 / white)])

    low, high = physical_bounds(PRIOR.names)
    begun = np.clip(truth.mean, low + 1e-9, high - 1e-9)
    judge = least_squares(missing, begun, slopes, (low - 1e-12, high), x_scale=white, max_nfev=30)
    found = missing(fit(samples, MODEL, PRIOR).parameters.mean)
    data = slice(0, -len(white))  # the fit weighs prior against data by a noise that it estimates
    assert np.mean(found[data] ** 2) < 1.5 * np.mean(judge.fun[data] ** 2)


def test_too_little_data_are_refused() -> None:
    samples = programme(1, 1, 0)
    with pytest.raises(RecorderError, match=r"at least 5\.0 s are needed"):
        fit(samples, MODEL, PRIOR)


@pytest.mark.parametrize(
    "factor",
    [0.0, 1.0 / 3600.0, *(pytest.param(f, marks=pytest.mark.long) for f in (-1.0, 1000.0))],
)
def test_a_meter_that_no_parameters_explain_is_refused(factor: float) -> None:
    """A meter that stands, Wh or kW for J and W, a current transformer that is turned round."""
    samples = metered(programme(4, 4, 0), PRIOR.drawn(4), 4)
    with pytest.raises(RecorderError, match="no parameters explain the meter"):
        fit(replace(samples, watts=factor * samples.watts), MODEL, PRIOR)


@pytest.mark.parametrize("joint", range(6))
@pytest.mark.parametrize("factor", [3.0, np.degrees(1.0), 1000.0])
def test_speeds_that_no_axis_reaches_are_refused_and_a_spike_is_not(
    joint: int, factor: float
) -> None:
    robot = CELL.robot
    rng = np.random.default_rng(joint)
    qd = robot.velocity_max * rng.uniform(-1.1, 1.1, (5000, 6))
    qd[10] = np.nan  # where nobody knows it
    qd[20] *= 5.0  # a spike of the differentiation
    check_speed("run.csv", robot, qd)
    qd[:, joint] *= factor
    with pytest.raises(RecorderError, match=f"{robot.joint_names[joint]} moves at .*unit"):
        check_speed("run.csv", robot, qd)


def test_degrees_without_their_unit_and_other_robots_are_refused() -> None:
    q = programme(4, 2, 0).q
    check_range("run.csv", CELL.robot, q)
    with pytest.raises(
        RecorderError,
        match=r"run\.csv: joint_a. is .* rad, .* reaches .*_deg; or is it another robot",
    ):
        check_range("run.csv", CELL.robot, np.degrees(q))


@pytest.mark.long
def test_a_meter_with_a_clock_of_its_own_is_fitted_from_csv(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = PRIOR.drawn(5)
    samples = metered(programme(5, 12, 0), truth, 5)
    samples = replace(samples, load=np.zeros_like(samples.load))
    samples = metered(samples, truth, 5)
    names = ",".join(f"{name}_deg" for name in CELL.robot.joint_names)
    rows = np.column_stack([samples.time, np.degrees(samples.q)])
    np.savetxt(tmp_path / "joints.csv", rows, "%.6f", ",", header=f"time,{names}", comments="")
    rows = np.column_stack([1e3 * (samples.time + 100.0 + 0.5 * STEP), samples.watts / 1e3])
    np.savetxt(tmp_path / "meter.csv", rows, "%.6f", ";", header="time [ms];power_kW", comments="")
    words = ["energy", "fit", str(tmp_path / "joints.csv"), "--meter", str(tmp_path / "meter.csv")]
    words += ["--cell", "demo", "--load", CELL.tool.name, "--output", str(tmp_path / "power.yaml")]
    assert main([*words, "--picture", str(tmp_path / "fit.png")]) == 0
    printed = capsys.readouterr().out
    clock = re.search(
        r"(\S+) s on its meter's clock agrees best with the power of the fit", printed
    )
    assert clock is not None
    assert float(clock[1]) == pytest.approx(-100.0, abs=2e-3)
    found = load_power_parameters(str(tmp_path / "power.yaml"))
    assert found.value("coulomb.joint_a1") == pytest.approx(
        truth.value("coulomb.joint_a1"), rel=0.05
    )
    assert (tmp_path / "fit.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("load", "name"), [("anvil", "anvil"), ("gripper+anvil", "anvil"), ("GRIPPER", "GRIPPER")]
)
def test_what_is_held_all_the_time_is_refused_where_the_cell_does_not_have_it(
    load: str, name: str
) -> None:
    with pytest.raises(
        RecorderError, match=f"^load '{name}' is unknown, known are gear, gripper, none"
    ):
        fit_data(DataSource(Path("joints.csv"), cell=CELL, load=load), PRIOR)
