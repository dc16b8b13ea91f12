"""Fits by what a controller says of its motors, by meters that read seldom, over several
recordings; and their worth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ir_description import PowerParameters, RobotModel, data_sheet_of, load_cell, load_robot
from ir_recorder.errors import RecorderError
from ir_recorder.fit import (
    Estimate,
    LeftOut,
    doubts,
    fit,
    left_out,
    recommendation,
    sentences,
    shaft_work,
    write_fit_picture,
)
from ir_recorder.fit.fit_data import DataSource, check_efforts, fit_data, without_turns
from ir_recorder.measure import PowerModel, Samples, samples_of
from ir_recorder.measure.arm import arm_torques
from ir_recorder.traces import Trace

STEP = 0.01
ROBOTS = ("ur10e", "kr6_r900_2")


def moved(robot: RobotModel, seed: int, seconds: float = 12.0) -> Samples:
    """A sum of sines about home."""
    rng = np.random.default_rng(seed)
    time = (np.arange(int(seconds / STEP)) + 0.5) * STEP
    speed = rng.uniform(0.5, 2.5, (3, robot.n))
    size = rng.uniform(0.1, 0.35, (3, robot.n))
    phase = rng.uniform(0.0, 6.0, (3, robot.n))
    angle = speed * time[:, None, None] + phase
    q = robot.machine_home + (size * np.sin(angle)).sum(axis=1)
    qd = (size * speed * np.cos(angle)).sum(axis=1)
    qdd = -(size * speed**2 * np.sin(angle)).sum(axis=1)
    n = len(time)
    none = np.zeros(n, int)
    on = np.ones(n, bool)
    return Samples(STEP, time, q, qd, qdd, none, none, on, np.full(n, np.nan), ((),))


def model_of(robot: RobotModel) -> tuple[PowerModel, PowerParameters]:
    prior = data_sheet_of(robot, robot.controller)
    return PowerModel(robot, robot.controller.dc_link, np.eye(4), prior), prior


def truth_of(prior: PowerParameters, seed: int) -> np.ndarray:
    """Friction 0.4 to 2.5 times the data sheet's: far beyond what its marks allow."""
    rng = np.random.default_rng(seed)
    mean = prior.mean.copy()
    for term in ("viscous", "coulomb"):
        places = prior.places(term)
        mean[places] *= np.exp(rng.uniform(np.log(0.4), np.log(2.5), places.stop - places.start))
    return mean


def told(samples: Samples, model: PowerModel, mean: np.ndarray, gains: object = 1.0) -> Samples:
    torque = model.torque(mean, model.prepare(samples))
    noise = np.random.default_rng(1).normal(0.0, 0.01 * np.abs(torque).max(axis=0), torque.shape)
    return replace(samples, effort=(torque + noise) * gains, currents=gains != 1.0)


@pytest.mark.parametrize("name", ROBOTS)
def test_friction_is_found_from_torques_without_a_meter(name: str) -> None:
    robot = load_robot(name)
    model, prior = model_of(robot)
    truth = truth_of(prior, 4)
    runs = [told(moved(robot, seed), model, truth) for seed in (1, 2)]
    found = fit(runs, model, prior, motors=True)
    unknown = moved(robot, 3)
    prepared = model.prepare(unknown)
    true, own, sheet = (
        shaft_work(model.torque(mean, prepared), prepared.speed)
        for mean in (truth, found.parameters.mean, prior.mean)
    )
    assert abs(own / true - 1.0) < 0.01 < abs(sheet / true - 1.0)
    assert len(found.measured) == 0


def given_way(speed: np.ndarray, step: float, travel: float) -> np.ndarray:
    """Shares (M,) of dry friction by Dahl's equation in small steps: dz/dx = (1 - z sign v) / X."""
    share = 0.0
    shares = []
    for v in speed.tolist():
        for _ in range(200):
            share += (1.0 - share * np.sign(v)) * v * step / 200.0 / travel
        shares.append(share)
    return np.array(shares)


def test_a_travel_over_which_dry_friction_turns_is_found_where_there_is_one() -> None:
    robot = load_robot("ur10e")
    model, prior = model_of(robot)
    truth = truth_of(prior, 3)
    coulomb = truth[prior.places("coulomb")]
    travels = (2e-4, 5e-4, 0.0, 2e-3, 1e-3, 0.0)
    runs = []
    for seed in (1, 2):
        run = told(moved(robot, seed), model, truth)
        assert run.effort is not None
        effort = run.effort.copy()
        for j, travel in enumerate(travels):
            if travel:
                soft = given_way(run.qd[:, j], run.step, travel)
                effort[:, j] += coulomb[j] * (soft - np.sign(run.qd[:, j]))
        runs.append(replace(run, effort=effort))
    estimate = Estimate(runs, ["a", "b"], model, prior, motors=True)
    found = estimate.result("x")
    for travel, own in zip(travels, found.travel, strict=True):
        assert travel / 4.0 <= own <= 4.0 * travel
    rms = {row.method: row.rms for row in left_out(estimate) if row.part == "b"}
    assert rms["fit"] < 0.7 * rms["regression"]


def test_currents_give_the_gains_of_the_motors_too() -> None:
    robot = load_robot("ur10e")
    model, prior = model_of(robot)
    truth = truth_of(prior, 5)
    gains = np.array([0.1, 0.1, 0.11, 0.2, 0.21, 0.2])
    runs = []
    for seed in (1, 2):
        run = told(moved(robot, seed), model, truth)
        assert run.effort is not None
        runs.append(replace(run, effort=run.effort * gains, currents=True))
    found = fit(runs, model, prior, motors=True)
    assert found.scales[:3] == pytest.approx(gains[:3], rel=0.15)  # masses are known to 10 %


def test_gains_are_no_surer_than_the_rotor_of_each_axis() -> None:
    """Currents part no motor constant from a rotor of its own axis that is not as in the data."""
    inside = []
    for name in ROBOTS:
        robot = load_robot(name)
        model, prior = model_of(robot)
        known = prior.deviation[prior.index("rotor_inertia")]
        for seed in range(6):
            rng = np.random.default_rng(seed)
            samples = moved(robot, seed)
            gains = 0.05 * np.exp(rng.uniform(-0.7, 0.7, robot.n))
            other = rng.lognormal(0.0, known, robot.n) - 1.0
            torque = model.torque(prior.mean, model.prepare(samples))
            torque += other * robot.reflected_inertia * samples.qdd
            noise = rng.normal(0.0, 0.01, torque.shape) * np.abs(torque).max(axis=0)
            run = replace(samples, effort=(torque + noise) * gains, currents=True)
            found = fit(run, model, prior, motors=True)
            off = np.abs(np.array(found.scales) - gains) / found.scale_deviations
            inside += (off < 1.645).tolist()
            assert any("an ampere of the motors is" in each for each in sentences(found))
    assert np.mean(inside) > 0.85  # of 72: 90 % less a deviation and a half


def test_a_picture_of_a_fit_without_a_meter_shows_its_parameters(tmp_path: Path) -> None:
    robot = load_robot("kr6_r900_2")
    model, prior = model_of(robot)
    estimate = Estimate(
        [told(moved(robot, 1), model, truth_of(prior, 4))], ["a"], model, prior, motors=True
    )
    found = estimate.result("x")
    path = write_fit_picture(found, estimate.prior, tmp_path / "fit.png")
    assert path.read_bytes().startswith(b"\x89PNG")


def test_every_recording_is_left_out_once_and_the_fit_is_recommended_where_it_is_better() -> None:
    robot = load_robot("kr6_r900_2")
    model, prior = model_of(robot)
    runs = [told(moved(robot, seed), model, truth_of(prior, 6)) for seed in (1, 2, 3)]
    estimate = Estimate(runs, ["a", "b", "c"], model, prior, motors=True)
    estimate.result("x")
    rows = left_out(estimate)
    assert [(row.part, row.method) for row in rows if row.method == "fit"] == [
        (name, "fit") for name in "abc"
    ]
    assert "plan with the fit" in recommendation(rows)


def held(samples: Samples, moves: Sequence[int]) -> Samples:
    """The same with all other joints at home."""
    some = np.isin(np.arange(samples.q.shape[1]), moves)
    home = load_robot("kr6_r900_2").machine_home
    still = np.where(some, samples.q, home)
    return replace(samples, q=still, qd=samples.qd * some, qdd=samples.qdd * some)


def test_axes_that_move_in_one_recording_alone_are_left_out_in_quarters() -> None:
    robot = load_robot("kr6_r900_2")
    model, prior = model_of(robot)
    truth = truth_of(prior, 7)
    runs = [
        told(held(moved(robot, seed), axes), model, truth)
        for seed, axes in ((1, (0, 1, 2)), (2, (3, 4, 5)))
    ]
    estimate = Estimate(runs, ["a", "b"], model, prior, motors=True)
    estimate.result("x")
    rows = left_out(estimate)
    fitted = [row for row in rows if row.method == "fit"]
    assert [row.part for row in fitted] == [f"part {k} of 4" for k in range(1, 5)]
    assert max(abs(row.errors[0]) for row in fitted) < 0.03
    assert "plan with the fit" in recommendation(rows)


def test_what_friction_holds_at_rest_spoils_no_fit() -> None:
    robot = load_robot("kr6_r900_2")
    model, prior = model_of(robot)
    truth = truth_of(prior, 8)
    rng = np.random.default_rng(8)
    runs = []
    for axis in range(robot.n):
        run = told(held(moved(robot, axis, 6.0), (axis,)), model, truth)
        assert run.effort is not None
        holds = rng.uniform(-1.0, 1.0, (6, robot.n)).repeat(len(run) // 6, axis=0)
        holds *= truth[prior.places("coulomb")] * (np.arange(robot.n) != axis)
        runs.append(replace(run, effort=run.effort + holds))
    estimate = Estimate(runs, list("abcdef"), model, prior, motors=True)
    found = estimate.result("x")
    unknown = moved(robot, 9)
    prepared = model.prepare(unknown)
    true, own = (
        shaft_work(model.torque(mean, prepared), prepared.speed)
        for mean in (truth, found.parameters.mean)
    )
    assert abs(own / true - 1.0) < 0.01
    assert doubts(estimate, found).sentences == ()


def test_a_data_sheet_is_not_given_the_gains_of_what_it_has_not_seen() -> None:
    robot = load_robot("ur10e")
    model, prior = model_of(robot)
    runs = [
        told(moved(robot, seed), model, prior.mean, gain) for seed, gain in ((1, 0.1), (2, 0.2))
    ]
    estimate = Estimate(runs, ["a", "b"], model, prior, motors=True)
    estimate.result("x")
    sheet = [row.errors[0] for row in left_out(estimate) if row.method == "data sheet"]
    assert sheet == pytest.approx([1.0, -0.5], abs=0.01)


def test_a_fit_that_is_worse_recommends_the_data_sheet() -> None:
    def of(method: str, error: float) -> LeftOut:
        return LeftOut("a", method, 1.0, (error,), None)

    rows = [of("fit", 0.05), of("data sheet", -0.02), of("regression", 0.03)]
    assert "plan with the data sheet" in recommendation(rows)
    assert "plan with mine, this fit is worse" in recommendation(rows, begun="mine")


def test_where_a_regression_is_nearer_it_is_said_how_near_the_fit_is() -> None:
    def of(method: str, error: float) -> LeftOut:
        return LeftOut("a", method, 1.0, (error,), None)

    for nearer in (0.018, 0.0299):
        rows = [of("fit", 0.03), of("data sheet", 0.08), of("regression", nearer)]
        assert "plan with the fit only if 3.0 % is near enough" in recommendation(rows)
    rows = [of("fit", 0.03), of("data sheet", 0.08), of("regression", 0.03)]
    assert recommendation(rows).endswith("plan with the fit")


def test_coupled_motors_give_the_power_that_the_joints_take() -> None:
    """Whatever turns what, the power of all motors is that of all joints."""
    turns = np.eye(6)
    turns[5, 4] = 1.0
    turns[4, 3] = -0.4
    robot = replace(load_robot("kr6_r900_2"), motor_turns=turns)
    model, _ = model_of(robot)
    samples = moved(robot, 7)
    prepared = model.prepare(samples)
    motors = ((prepared.torques.links - prepared.torques.counterbalance) * prepared.speed).sum(1)
    own = arm_torques(robot, (), np.eye(4), np.stack([samples.q, samples.qd, samples.qdd]))
    assert np.abs(motors - (own.links * samples.qd).sum(axis=1)).max() < 1e-8
    assert np.abs(prepared.speed - samples.qd)[:, 5].max() > 0.1


def joints(robot: RobotModel, q: np.ndarray) -> Trace:
    columns: dict[str, np.ndarray] = {
        name: q[:, k].copy() for k, name in enumerate(robot.joint_names)
    }
    return Trace("run.csv", np.arange(len(q)) * 0.01, columns)


@pytest.mark.parametrize("turns", [-2, 1, 3])
def test_a_joint_without_an_end_is_brought_back_and_its_jumps_are_followed(turns: int) -> None:
    robot = load_robot("ur10e")
    q = moved(robot, 8).q
    beyond = q.copy()
    beyond[:, 5] = (q[:, 5] + np.pi) % (2.0 * np.pi) - np.pi + 2.0 * np.pi * turns
    back, said = without_turns(joints(robot, beyond), robot)
    found = back.columns[robot.joint_names[5]]
    assert np.abs(np.diff(found)).max() < 0.2
    off = (found - q[:, 5]) / (2.0 * np.pi)
    assert np.abs(off - np.round(off)).max() < 1e-9
    assert robot.position_min[5] - 0.2 <= found.min() <= found.max() <= robot.position_max[5] + 0.2
    assert turns in (-2, 1) or "brought back by" in said[0]


def test_too_little_is_refused_with_what_there_is() -> None:
    robot = load_robot("ur10e")
    model, prior = model_of(robot)
    short: Sequence[Samples] = [told(moved(robot, 1, 2.0), model, prior.mean)]
    with pytest.raises(RecorderError, match=r"2\.0 s have torques"):
        fit(short, model, prior, motors=True)


REST = 90.0


def seen(samples: Samples, model: PowerModel, mean: np.ndarray, period: float) -> Samples:
    """The samples with a meter that reads every so many seconds, and not where the samples end."""
    watts = model.watts(mean, model.prepare(samples)) + REST
    time = np.arange(0.037, samples.time[-1], period)
    edges = np.concatenate([[0.0], samples.time + 0.5 * samples.step])
    count = np.concatenate([[0.0], np.cumsum(watts * samples.step)])
    energy = np.interp(time, edges, count)
    names = model.layout.joints
    columns = {name: samples.q[:, k].copy() for k, name in enumerate(names)}
    joints = Trace("joints", samples.time, columns)
    meter = Trace("meter", time, {"energy": energy})
    return samples_of(joints, meter, names, model.layout.modes, [(-np.inf, np.inf, ())])


@pytest.mark.parametrize("period", [0.04, 0.1, 0.2])
def test_what_is_predicted_is_averaged_as_the_meter_does(period: float) -> None:
    model, prior = model_of(load_robot("kr6_r900_2"))
    samples = seen(moved(load_robot("kr6_r900_2"), 3), model, prior.mean, period)
    assert samples.readings is not None
    watts = model.watts(prior.mean, model.prepare(samples)) + REST
    shown = samples.metered(watts)
    inner = slice(30, -30)  # beside both ends
    plain = np.sqrt(np.mean((watts - samples.watts)[inner] ** 2))
    assert np.sqrt(np.mean((shown - samples.watts)[inner] ** 2)) < 0.35 * plain
    assert shown.sum() == pytest.approx(watts.sum())
    assert samples.metered(shown) == pytest.approx(shown)
    both = np.column_stack([watts, 2.0 * watts])
    assert samples.metered(both)[:, 1] == pytest.approx(2.0 * shown)
    fine = replace(samples, readings=None)
    assert fine.metered(watts) is watts


def test_friction_is_found_by_a_meter_of_ten_readings_a_second() -> None:
    robot = load_robot("kr6_r900_2")
    model, prior = model_of(robot)
    truth = truth_of(prior, 5)
    standing = replace(prior, covariance=prior.covariance + np.diag(_open(prior.names, 30.0)))
    runs = [seen(moved(robot, seed), model, truth, 0.1) for seed in (1, 2)]
    found = fit(runs, model, standing)
    for movement in found.movements:
        assert abs(movement.after / movement.measured - 1.0) < 0.03


def _open(names: tuple[str, ...], deviation: float) -> np.ndarray:
    return np.array([deviation**2 if name.startswith("watts.") else 0.0 for name in names])


@pytest.mark.parametrize(("period", "shift"), [(0.1, 1.37), (0.2, -2.4), (0.04, 0.5)])
def test_the_clock_of_a_slow_meter_is_found(period: float, shift: float, tmp_path: Path) -> None:
    """A reading is the mean since the one before: it belongs to the middle between them."""
    robot = load_robot("kr6_r900_2")
    model, prior = model_of(robot)
    samples = moved(robot, 6, 20.0)
    watts = model.watts(prior.mean, model.prepare(samples)) + REST
    each = round(period / samples.step)
    means = watts[: len(watts) // each * each].reshape(-1, each).mean(axis=1)
    time = period * (np.arange(len(means)) + 1)
    heads = ",".join(["time", *robot.joint_names])
    rows = np.column_stack([samples.time, samples.q])
    np.savetxt(tmp_path / "joints.csv", rows, "%.9g", ",", header=heads, comments="")
    meter = tmp_path / "meter.csv"
    np.savetxt(
        meter, np.column_stack([time + shift, means]), "%.9g", ",", header="time,power", comments=""
    )
    source = DataSource(tmp_path / "joints.csv", meter, cell=load_cell("kr6_bench"), load="none")
    data = fit_data(source, prior)
    (said,) = (note for note in data.notes if "on its clock" in note)
    found = float(said.split(": ")[1].split(" s ")[0])
    assert found == pytest.approx(-shift, abs=0.02)


def test_efforts_that_are_zero_though_the_joint_moves_were_not_measured() -> None:
    time = np.arange(0.0, 2.0, 0.01)
    columns = {"a": np.sin(time), "b": np.zeros(len(time))}
    efforts = {"a_effort": np.zeros(len(time)), "b_effort": np.zeros(len(time))}
    with pytest.raises(RecorderError, match="a_effort is 0 all the time, though a moves"):
        check_efforts(Trace("log", time, columns | efforts), ("a", "b"))
    efforts["a_effort"] = np.cos(time)
    check_efforts(Trace("log", time, columns | efforts), ("a", "b"))
