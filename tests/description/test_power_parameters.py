"""Power parameters: the prior of the marks, draws within physics, files that come back as they
went.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import (
    DescriptionError,
    DescriptionFileError,
    InvalidValueError,
    PowerParameters,
    UnknownNameError,
    load_power_data,
    load_robot,
)
from ir_description.files import power_parameters_to_yaml
from ir_description.library import load_power_parameters
from ir_description.robot import interval_over, parameter_unit, physical_bounds


@pytest.fixture
def sheet() -> PowerParameters:
    return load_power_parameters()


def test_the_data_sheet_has_the_data_as_its_mean(sheet: PowerParameters) -> None:
    robot = load_robot()
    power = load_power_data()
    assert np.array_equal(sheet.axis("viscous"), robot.friction_viscous)
    assert np.array_equal(sheet.axis("copper"), robot.copper_loss)
    assert not np.any([sheet.axis(term) for term in ("iron", "inverter", "gear")])
    assert sheet.value("idle_watts") == 0.0
    assert sheet.value("drives_watts") == power.drives_and_brake_release
    same = sheet.robot_with(robot)
    assert np.array_equal(same.link_mass, robot.link_mass)
    assert same.counterbalance is not None
    assert robot.counterbalance is not None
    assert same.counterbalance.charge_pressure == robot.counterbalance.charge_pressure
    assert sheet.power_with(power) == power
    assert (sheet.deviation > 0.0).all()


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32), widening=st.floats(0.0, 20.0))
def test_draws_are_possible_robots_and_follow_the_seed(seed: int, widening: float) -> None:
    sheet = load_power_parameters()
    wide = replace(sheet, covariance=sheet.covariance * widening)
    draws = wide.draws(20, seed)
    low, high = physical_bounds(sheet.names)
    assert (draws >= low).all()
    assert (draws <= high).all()
    assert np.array_equal(draws, wide.draws(20, seed))
    wide.drawn(seed).robot_with(load_robot())  # makes a robot, or raises


def test_draws_at_a_bound_keep_their_correlations(sheet: PowerParameters) -> None:
    a = sheet.index("iron.joint_a1")
    b = sheet.index("viscous.joint_a1")
    covariance = sheet.covariance.copy()
    covariance[a, b] = covariance[b, a] = -0.95 * sheet.deviation[a] * sheet.deviation[b]
    draws = replace(sheet, covariance=covariance).draws(4000, 1)
    moved = (draws - sheet.mean) / sheet.deviation
    normal = np.random.default_rng(2).multivariate_normal(
        [0.0, 0.0], [[1.0, -0.95], [-0.95, 1.0]], 40_000
    )
    allowed = normal[normal[:, 0] >= 0.0]  # of all normal draws those that physics allows
    np.testing.assert_allclose(moved[:, [a, b]].mean(axis=0), allowed.mean(axis=0), atol=0.05)
    np.testing.assert_allclose(moved[:, [a, b]].std(axis=0), allowed.std(axis=0), atol=0.05)


def test_draws_have_the_covariance_where_no_bound_is_near(sheet: PowerParameters) -> None:
    a = sheet.index("viscous.joint_a1")
    b = sheet.index("coulomb.joint_a1")
    covariance = sheet.covariance.copy()
    covariance[a, b] = covariance[b, a] = -0.8 * sheet.deviation[a] * sheet.deviation[b]
    draws = replace(sheet, covariance=covariance).draws(20_000, 1)
    assert np.corrcoef(draws[:, a], draws[:, b])[0, 1] == pytest.approx(-0.8, abs=0.02)
    assert draws[:, a].std() == pytest.approx(sheet.deviation[a], rel=0.03)
    assert draws[:, a].mean() == pytest.approx(sheet.mean[a], rel=0.01)


def test_a_file_comes_back_as_it_went(sheet: PowerParameters, tmp_path) -> None:  # type: ignore[no-untyped-def]
    a = sheet.index("viscous.joint_a1")
    b = sheet.index("coulomb.joint_a3")
    covariance = 0.1 * sheet.covariance
    mean = sheet.mean * 1.0
    covariance[a, b] = covariance[b, a] = 0.5 * np.sqrt(covariance[a, a] * covariance[b, b])
    mean[sheet.index("iron.joint_a2")] = 12.5
    mean[sheet.index("rectifier_efficiency")] = 0.97
    fitted = replace(sheet, name="cell_3", mean=mean, covariance=covariance)
    path = tmp_path / "fitted.yaml"
    path.write_text(power_parameters_to_yaml(fitted, 'ir energy fit "run 1"'), encoding="utf-8")
    read = load_power_parameters(str(path))
    assert read.name == "cell_3"
    assert read.sources == fitted.sources
    assert read.mean == pytest.approx(fitted.mean, rel=1e-8)
    assert read.covariance == pytest.approx(fitted.covariance, rel=1e-5, abs=1e-12)


HEAD = (
    "format: ir_description/power_parameters/1\nname: x\nrobot: "
    "kr210_r2700_extra\ncontroller: kr_c4\n"
)


def test_what_a_file_does_not_name_stays_as_the_data_have_it(
    sheet: PowerParameters, tmp_path
) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "one.yaml"
    path.write_text(
        HEAD + "parameters: [{name: drives_watts, value: 300, deviation: 2}]\n", encoding="utf-8"
    )
    read = load_power_parameters(str(path))
    k = sheet.index("drives_watts")
    assert (read.mean[k], read.deviation[k], read.sources[k]) == (300.0, 2.0, "file")
    others = np.arange(len(sheet.names)) != k
    assert np.array_equal(read.mean[others], sheet.mean[others])
    assert read.deviation[others] == pytest.approx(sheet.deviation[others])


@pytest.mark.parametrize(
    ("rest", "named"),
    [
        ("parameters: [{name: warp.joint_a1, value: 1, deviation: 1}]", "warp.joint_a1"),
        ("parameters: [{name: drives_watts, value: -1, deviation: 1}]", "drives_watts is -1 W"),
        ("parameters: [{name: gear.joint_a1, value: 0.95, deviation: 1}]", "[0, 0.9]"),
        ("parameters: [{name: drives_watts, value: 1, deviation: 1, unit: Nm}]", "must be W"),
        ("parameters: [{name: load_mass, value: 1, deviation: -1}]", "must be in [0"),
        ("parameters: [{name: load_mass, value: .nan, deviation: 1}]", "value is"),
        ("parameters: [{name: load_mass, value: 1, deviation: .inf}]", "deviation is"),
        (
            "parameters: [{name: load_mass, value: 1, deviation: 1e308}]",
            "deviation is 1e308, must be in [0, 1e+12]",
        ),
        ("parameters: [{name: load_mass, value: 1e308, deviation: 1}]", "value is 1e308, must be"),
        ("parameters: [{name: load_mass, value: one, deviation: 1}]", "one"),
        ("parameters: {load_mass: 1}", "must be a list"),
        ("parameters: []\ncorrelation: {names: [load_mass, link_mass], below: [[.nan]]}", "nan"),
        ("parameters: []\ncorrelation: {names: [load_mass, load_mass], below: [[0]]}", "twice"),
        (
            "parameters:\n" + 2 * "- {name: load_mass, value: 1, deviation: 1}\n",
            "named twice",
        ),
        ("parameters: []\ncorrelation: {names: [load_mass, link_mass], below: [[1.5]]}", "[-1, 1]"),
        (
            "parameters: []\ncorrelation: {names: [load_mass, link_mass, tool_watts], below: "
            "[[1], [1, -1]]}",
            "negative eigenvalue",
        ),
    ],
)
def test_a_file_that_makes_no_sense_is_refused_by_name(rest: str, named: str, tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "bad.yaml"
    path.write_text(HEAD + rest + "\n", encoding="utf-8")
    with pytest.raises(DescriptionFileError) as refused:
        load_power_parameters(str(path))
    assert named in str(refused.value)


@pytest.mark.parametrize(
    ("head", "named"),
    [
        (HEAD.replace("kr_c4", "kr_c5"), "kr_c5"),
        (HEAD.replace("kr210_r2700_extra", "arm"), "arm"),
        (HEAD.replace("/1", "/2"), "ir_description/power_parameters/1"),
        ("\0", "other.yaml"),
    ],
)
def test_a_file_of_something_else_is_refused_by_name(head: str, named: str, tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "other.yaml"
    path.write_text(head + "parameters: []\n", encoding="utf-8")
    with pytest.raises(DescriptionError, match=named):
        load_power_parameters(str(path))


def test_what_a_file_leaves_open_is_drawn_within_physics(tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "open.yaml"
    rows = [
        "{name: load_mass, value: 1, deviation: 1e12}",
        "{name: gear.joint_a1, value: 0, deviation: 1e9}",
    ]
    below = "correlation: {names: [load_mass, gear.joint_a1], below: [[0.999999]]}\n"
    path.write_text(f"{HEAD}parameters: [{', '.join(rows)}]\n{below}", encoding="utf-8")
    read = load_power_parameters(str(path))
    low, high = physical_bounds(read.names)
    draws = read.draws(50, 0)
    assert ((draws >= low) & (draws <= high)).all()


def test_a_file_of_100_mb_is_refused_before_it_is_read(tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "huge.yaml"
    with path.open("w", encoding="utf-8") as file:
        file.write(HEAD)
        file.truncate(100_000_000)
    with pytest.raises(DescriptionFileError, match="bytes"):
        load_power_parameters(str(path))


def test_unknown_names_list_the_known(sheet: PowerParameters) -> None:
    with pytest.raises(UnknownNameError, match="data_sheet"):
        load_power_parameters("fitted")
    with pytest.raises(UnknownNameError, match="viscous"):
        sheet.value("viscous")
    assert parameter_unit("viscous.joint_a3") == "Nm s/rad"
    assert parameter_unit("watts.HIBERNATION") == "W"


def test_a_covariance_that_is_none_is_refused(sheet: PowerParameters) -> None:
    covariance = sheet.covariance.copy()
    covariance[0, 1] = 1.0
    with pytest.raises(InvalidValueError, match="symmetric"):
        replace(sheet, covariance=covariance)


def test_an_interval_over_robots_leaves_out_a_twentieth_on_each_side_and_holds_the_nominal_figure() -> (  # noqa: E501
    None
):
    added = np.arange(0.0, 101.0)
    assert interval_over(1000.0, added - 50.0) == (955.0, 1045.0)
    assert interval_over(1000.0, added) == (1000.0, 1095.0)
    assert interval_over(1000.0, added - 200.0) == (805.0, 1000.0)
