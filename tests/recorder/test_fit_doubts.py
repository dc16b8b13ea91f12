"""Data that fit badly, but fit, are told: clocks, columns, signs; and centres of mass are found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ir_description import Load, PowerParameters, RobotModel, data_sheet_of, load_robot
from ir_description.files import power_parameters_to_yaml
from ir_description.library import power_parameters_of
from ir_description.robot import centre_deviations
from ir_recorder.errors import RecorderError
from ir_recorder.fit import Estimate, doubts, fit, recommendation, result
from ir_recorder.measure import PowerModel, Samples

ROBOT = load_robot("kr6_r900_2")
STEP = 0.01
SECONDS = 20.0


def moved(robot: RobotModel, seed: int) -> Samples:
    """Rests, and swings of all axes between them."""
    rng = np.random.default_rng(seed)
    time = (np.arange(int(SECONDS / STEP)) + 0.5) * STEP
    q = np.tile(robot.machine_home, (len(time), 1))
    qd = np.zeros_like(q)
    qdd = np.zeros_like(q)
    for begin in np.arange(0.5, SECONDS - 1.5, 1.5):
        rows = (time >= begin) & (time < begin + 1.2)
        rate = 2.0 * np.pi / 1.2
        x = rate * (time[rows] - begin)[:, None]
        size = rng.uniform(-0.4, 0.4, robot.n)
        q[rows] += size * (1.0 - np.cos(x))
        qd[rows] = size * np.sin(x) * rate
        qdd[rows] = size * np.cos(x) * rate**2
    none = np.zeros(len(time), int)
    on = np.ones(len(time), bool)
    watts = np.full(len(time), np.nan)
    return Samples(STEP, time, q, qd, qdd, none, none, on, watts, ((),))


def model_of(robot: RobotModel, *, centres: bool = False) -> tuple[PowerModel, PowerParameters]:
    prior = data_sheet_of(robot, robot.controller)
    if centres:
        prior = prior.with_centres(centre_deviations(robot))
    return PowerModel(robot, robot.controller.dc_link, np.eye(4), prior), prior


def metered(seed: int) -> Samples:
    """What a meter shows of a robot that is as its data, at 90 W."""
    model, prior = model_of(ROBOT)
    samples = moved(ROBOT, seed)
    noise = np.random.default_rng(seed).normal(0.0, 2.0, len(samples))
    return replace(samples, watts=model.watts(prior.mean, model.prepare(samples)) + 90.0 + noise)


def doubted(samples: Samples) -> str:
    model, prior = model_of(ROBOT)
    estimate = Estimate([samples], ["run"], model, prior)
    try:
        found = result(estimate, "x")
    except RecorderError as error:
        return str(error)
    return " ".join(doubts(estimate, found).sentences)


@pytest.mark.long
def test_nothing_speaks_against_good_data() -> None:
    assert doubted(metered(1)) == ""


def drawn_meter(seed: int) -> Samples:
    """What a meter shows of a robot that is drawn from what is known of it."""
    model, prior = model_of(ROBOT)
    samples = moved(ROBOT, seed)
    truth = prior.drawn(seed).mean
    noise = np.random.default_rng(seed).normal(0.0, 2.0, len(samples))
    return replace(samples, watts=model.watts(truth, model.prepare(samples)) + 90.0 + noise)


def with_columns(samples: Samples, order: list[int], factor: np.ndarray) -> Samples:
    """Columns of joints in another order, times factors; a factor of 0 is a column that stands."""
    home = np.array(ROBOT.machine_home)
    q, qd, qdd = (each[:, order] * factor for each in (samples.q, samples.qd, samples.qdd))
    q = np.where(factor == 0.0, home, q)
    return replace(samples, q=q, qd=qd, qdd=qdd)


STRAIGHT = list(range(6))
CORRUPTIONS = {
    "one phase": lambda samples: replace(samples, watts=samples.watts / 3.0),
    "kW as W": lambda samples: replace(samples, watts=samples.watts / 1e3),
    "A5 stands": lambda s: with_columns(s, STRAIGHT, np.array([1, 1, 1, 1, 0, 1.0])),
    "A2 and A3": lambda s: with_columns(s, [0, 2, 1, 3, 4, 5], np.ones(6)),
    "sign of A2": lambda s: with_columns(s, STRAIGHT, np.array([1, -1, 1, 1, 1, 1.0])),
    "late": lambda samples: replace(samples, watts=np.roll(samples.watts, 8)),
}
SEEDS = [1, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(2, 6))]


@pytest.mark.long
@pytest.mark.parametrize("seed", SEEDS)
def test_a_drawn_robot_that_is_recorded_well_is_not_doubted(seed: int) -> None:
    assert doubted(drawn_meter(seed)) == ""


@pytest.mark.sampled
@pytest.mark.parametrize(
    "kind",
    ["one phase", "kW as W", "A5 stands"]  # clocks, columns and signs of one robot are tested below
    + [pytest.param(kind, marks=pytest.mark.long) for kind in ("A2 and A3", "sign of A2", "late")],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_no_corrupted_recording_is_taken_without_a_word(seed: int, kind: str) -> None:
    assert doubted(CORRUPTIONS[kind](drawn_meter(seed)))


@pytest.mark.parametrize("steps", [-30, pytest.param(12, marks=pytest.mark.long)])
def test_a_meter_whose_clock_is_off_is_told_with_the_seconds_to_add(steps: int) -> None:
    samples = metered(2)
    said = doubted(replace(samples, watts=np.roll(samples.watts, steps)))
    assert f"add {-steps * STEP:.2f} s to the clock_offset" in said


@pytest.mark.long
def test_columns_that_were_taken_for_each_other_are_named() -> None:
    samples = metered(3)
    order = [0, 2, 1, 3, 4, 5]
    swapped = replace(
        samples, q=samples.q[:, order], qd=samples.qd[:, order], qdd=samples.qdd[:, order]
    )
    joints = ROBOT.joint_names
    assert f"the columns of {joints[1]} and {joints[2]} swapped" in doubted(swapped)


@pytest.mark.long
def test_columns_of_a_wrist_that_are_exchanged_are_doubted_or_said_to_be_undecided() -> None:
    model, prior = model_of(ROBOT)
    swapped = with_columns(drawn_meter(1), [0, 1, 2, 4, 3, 5], np.ones(6))
    estimate = Estimate([swapped], ["run"], model, prior)
    found = doubts(estimate, result(estimate, "x"))
    said = " ".join((*found.sentences, *found.undecided))
    assert f"the columns of {ROBOT.joint_names[3]} and {ROBOT.joint_names[4]} swapped" in said


ZEROS = [
    ("kr6_r900_2", 1, 2, 0.9),
    *(
        pytest.param(*case, marks=pytest.mark.long)
        for case in (("kr6_r900_2", 2, 2, -0.9), ("kr6_r900_2", 3, 1, 0.9), ("ur10e", 1, 2, 1.5))
    ),
]


@pytest.mark.long
@pytest.mark.parametrize(("name", "seed", "joint", "off"), ZEROS)
def test_a_joint_whose_zero_is_elsewhere_is_named_by_the_watts(
    name: str, seed: int, joint: int, off: float
) -> None:
    robot = load_robot(name)
    model, prior = model_of(robot, centres=True)
    samples = moved(robot, seed)
    watts = model.watts(prior.drawn(seed).mean, model.prepare(samples)) + 90.0
    noise = np.random.default_rng(seed).normal(0.0, 2.0, len(samples))
    zero = np.where(np.arange(robot.n) == joint, off, 0.0)
    shifted = replace(samples, watts=watts + noise, q=samples.q + zero)
    estimate = Estimate([shifted], ["run"], model, prior)
    said = " ".join(doubts(estimate, result(estimate, "x")).sentences)
    assert f"{-45 * np.sign(off):.0f} degrees" in said or f"{-90 * np.sign(off):.0f} deg" in said
    assert f"added to {robot.joint_names[joint]}" in said


@pytest.mark.long
def test_a_meter_of_two_phases_of_three_is_told_or_may_be_one() -> None:
    model, prior = model_of(ROBOT, centres=True)
    samples = moved(ROBOT, 1)
    watts = model.watts(prior.drawn(4).mean, model.prepare(samples)) + 90.0
    estimate = Estimate([replace(samples, watts=2.0 / 3.0 * watts)], ["run"], model, prior)
    found = result(estimate, "x")
    said = doubts(estimate, found)
    assert "two thirds" in " ".join((*said.sentences, *said.undecided))


@pytest.mark.long
def test_a_part_of_known_mass_and_none_prove_that_all_phases_are_in() -> None:
    """Masses of the robot are known to 10 %, that of the part to 1 %."""
    model, prior = model_of(ROBOT, centres=True)
    load = Load("part", "part", 6.0, np.zeros(3), 0.01 * np.eye(3))
    truth = prior.drawn(4).mean
    runs = []
    for seed, loads in ((1, ()), (2, (load,))):
        samples = replace(moved(ROBOT, seed), loads=(loads,))
        watts = model.watts(truth, model.prepare(samples)) + 90.0
        noise = np.random.default_rng(seed).normal(0.0, 2.0, len(samples))
        runs.append(replace(samples, watts=watts + noise))
    estimate = Estimate(runs, ["without", "with"], model, prior)
    said = doubts(estimate, result(estimate, "x"))
    assert "phases" not in " ".join((*said.sentences, *said.undecided))


def test_a_zero_that_is_off_is_no_mass_of_the_robot() -> None:
    robot = load_robot("kr210_r2700_extra")
    model, prior = model_of(robot, centres=True)
    samples = moved(robot, 6)
    told = replace(samples, effort=model.torque(prior.mean, model.prepare(samples)))
    shifted = replace(told, q=told.q + np.array([0.0, 0.0, 0.6, 0.0, 0.0, 0.0]))
    said = []
    for run in (told, shifted):
        estimate = Estimate([run], ["run"], model, prior, motors=True)
        said.append(" ".join(doubts(estimate, result(estimate, "x")).sentences))
    assert said[0] == ""
    assert "zeros and signs of the joints" in said[1]


def test_power_with_the_wrong_sign_is_refused() -> None:
    samples = metered(4)
    model, prior = model_of(ROBOT)
    with pytest.raises(RecorderError, match="is a sign or a clamp turned round"):
        fit(replace(samples, watts=-samples.watts), model, prior)


def test_a_doubted_fit_is_not_recommended_and_neither_is_one_without_movements() -> None:
    assert "not known" in recommendation([])


def test_centres_of_mass_are_found_from_torques_and_planned_with() -> None:
    robot = load_robot("kr210_r2700_extra")
    model, prior = model_of(robot, centres=True)
    places = np.arange(len(prior.names))[prior.centre_places()]
    mean = prior.mean.copy()
    mean[places[1:3]] = 0.03, -0.04  # of axes 2 and 3
    truth = replace(prior, mean=mean)
    plain = data_sheet_of(robot, robot.controller)
    moved_robot = truth.robot_with(robot)
    samples = moved(robot, 5)
    own = PowerModel(moved_robot, robot.controller.dc_link, np.eye(4), plain)
    told = replace(samples, effort=own.torque(plain.mean, own.prepare(samples)))
    errors = []
    for each, start in ((model, prior), (model_of(robot)[0], plain)):
        found = fit([told], each, start, motors=True).parameters
        back = power_parameters_of(power_parameters_to_yaml(found), "x", robot)
        assert back.names == found.names
        torque = each.torque(back.mean, each.prepare(samples))
        errors.append(np.abs(told.effort - torque).max())
    assert errors[0] < 0.3 * errors[1]
