"""The robot's and the controller's figures agree with the checks that were published with them."""

from __future__ import annotations

from dataclasses import fields, replace
from importlib.resources import files

import numpy as np
import pytest

from ir_description import (
    InvalidValueError,
    RobotModel,
    UnknownNameError,
    load_cell,
    load_power_data,
    load_robot,
)
from ir_description.files import robot_from_yaml
from ir_description.robot import Counterbalance
from ir_values.errors import RobotFileError

GRAVITY = 9.80665
ROUNDING = 0.05  # W: copper losses are given to four digits
ROBOT_TEXT = (files("ir_description") / "data" / "robots" / "kr210_r2700_extra.yaml").read_text()


@pytest.fixture
def robot() -> RobotModel:
    return load_robot()


def counterbalance_torque(spring: Counterbalance, angle: float) -> float:
    """Torque [Nm] about the joint's positive axis, as the data file writes it down."""
    c = np.cos(angle)
    s = np.sin(angle)
    x, z = spring.rod_eye
    eye = np.array([c * x + s * z, -s * x + c * z])
    rod = spring.pivot - eye
    length = float(np.linalg.norm(rod))
    rest = spring.gas_volume - spring.piston_area * (length - spring.rod_length_at_charge)
    pressure = spring.charge_pressure * (spring.gas_volume / rest) ** spring.exponent
    force = spring.piston_area * pressure * rod / length
    return float(eye[1] * force[0] - eye[0] * force[1])


@pytest.mark.parametrize(
    ("angle_deg", "torque"),
    [
        (-140, 5116),
        (-120, 3254),
        (-90, -234),
        (-60, -3650),
        (-45, -5023),
        (-30, -6088),
        (-5, -7081),
    ],
)
def test_counterbalance_gives_the_published_torques(
    robot: RobotModel, angle_deg: float, torque: float
) -> None:
    assert robot.counterbalance is not None
    assert robot.counterbalance.joint == 1
    assert counterbalance_torque(robot.counterbalance, np.radians(angle_deg)) == pytest.approx(
        torque, abs=1.0
    )


def test_the_arm_weighs_what_the_source_says(robot: RobotModel) -> None:
    assert robot.link_mass.sum() == pytest.approx(1068.08)


def test_the_three_wrist_bodies_are_the_one_of_the_source(robot: RobotModel) -> None:
    """57.53 kg at 1.1612 m from A3 with 0.71, 1.90, 2.05 kg m^2 (kroshu), and no moment about
    A5.
    """
    mass = robot.link_mass[4:]
    offset = np.array([0.0, 1.2, 1.2 + 0.215])
    com = robot.link_com[4:, 0] + offset
    middle = mass @ com / mass.sum()
    assert mass.sum() == pytest.approx(57.53)
    assert middle == pytest.approx(1.1612, abs=1e-9)
    assert mass[1:] @ (com[1:] - 1.2) == pytest.approx(0.0, abs=1e-12)
    steiner = mass @ (com - middle) ** 2
    total = robot.link_inertia[4:].sum(axis=0) + np.diag([0.0, steiner, steiner])
    assert total == pytest.approx(np.diag([0.71, 1.90, 2.05]), abs=1e-9)


def test_inertias_are_those_of_bodies(robot: RobotModel) -> None:
    for inertia in robot.link_inertia:
        moments = np.linalg.eigvalsh(inertia)
        assert moments[0] > 0
        assert moments[2] <= moments[0] + moments[1]


def test_table_2_comes_out_of_the_calibrated_watts(robot: RobotModel) -> None:
    """Table II of the paper: all eight values, from controller, tool, drives and holding torque."""
    power = load_power_data()
    tool = load_cell("demo").tool
    assert tool is not None
    for payload in (0.0, 155.0):
        for mode in power.modes:
            watts = mode.controller_watts
            if payload:
                watts += tool.watts_always
                watts += tool.watts_drive_bus if mode.name.startswith("STAND_ON") else 0.0
            if mode.name == "STAND_ON_MOTORS":
                watts += power.drives_and_brake_release + holding_watts(robot, payload)
            assert watts == pytest.approx(power.measured(payload, mode.name), abs=ROUNDING)


def holding_watts(robot: RobotModel, payload: float) -> float:
    """Copper loss [W] of holding the arm at machine home, by levers alone."""
    arm = robot.link_mass[3] * robot.link_com[3, 0]
    arm += robot.link_mass[4:] @ (robot.link_com[4:, 0] + [0.0, 1.2, 1.415])
    assert robot.counterbalance is not None
    torque = np.zeros(6)
    torque[1] = torque[2] = GRAVITY * (arm + payload * (1.415 + 0.240))
    torque[1] += counterbalance_torque(robot.counterbalance, robot.machine_home[1])
    torque[4] = GRAVITY * payload * (0.215 + 0.240)
    return float(robot.copper_loss @ (torque / robot.gear_ratio) ** 2)


def test_table_1_is_complete() -> None:
    assert {share.consumer: share.percent for share in load_power_data().table_1} == {
        "robot_drives": 25.5,
        "resistance_spot_welding": 7.0,
        "gelation": 9.5,
        "gluing": 1.5,
        "plc_and_profinet": 2.0,
        "line_stand_by": 4.5,
        "factory_environment": 50.0,
    }


def test_the_dc_link_takes_106_joules() -> None:
    assert load_power_data().dc_link_capacity_energy == pytest.approx(106, abs=0.5)


def test_below_the_first_speed_the_smaller_of_gear_and_motor_binds(robot: RobotModel) -> None:
    assert robot.envelope_torque[:, 0] == pytest.approx([33 * 219.031, 8100, 5291, 2182, 1282, 825])


def test_speeds_are_those_of_the_machine_data(robot: RobotModel) -> None:
    assert np.degrees(robot.velocity_max) == pytest.approx([123, 115, 112, 179, 172, 219])


def test_plc_bits_exclude_each_other() -> None:
    bits = {bit.name: bit for bit in load_power_data().plc_inputs}
    for name, bit in bits.items():
        assert set(bit.excludes) == set(bits) - {name}


def test_arrays_are_read_only(robot: RobotModel) -> None:
    for field in fields(robot):
        value = getattr(robot, field.name)
        if isinstance(value, np.ndarray):
            assert value.dtype == np.float64
            assert not value.flags.writeable


def test_an_unknown_robot_lists_the_known() -> None:
    with pytest.raises(
        UnknownNameError, match=r"robot 'kr3' is unknown; known are kr210_r2700_extra"
    ):
        load_robot("kr3")


def test_values_that_no_robot_has_are_refused(robot: RobotModel) -> None:
    flat = np.array(robot.link_inertia)
    flat[3] = np.diag([1.0, 1.0, 3.0])
    with pytest.raises(InvalidValueError, match="triangle inequality"):
        replace(robot, link_inertia=flat)
    with pytest.raises(InvalidValueError, match=r"position_min has shape \(5,\), must be \(6,\)"):
        replace(robot, position_min=robot.position_min[:5])
    with pytest.raises(InvalidValueError, match="velocity_max has entries that are not finite"):
        replace(robot, velocity_max=np.full(6, np.nan))


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (
            "rated_payload_kg: {value: 210,",
            "rated_payload_kg: {value: -1,",
            r"is -1 kg, must be in \(0, 10000\] kg",
        ),
        ("confidence: H}", "confidence: X}", "is 'X', must be one of H, M, L"),
        (", source: machine, confidence: H}", ", confidence: H}", "rated_payload_kg has no source"),
        ("  gear_ratio:", "  gear_rato:", "unknown key 'gear_rato'; known are gear_ratio"),
    ],
)
def test_a_figure_without_source_or_sense_is_refused(old: str, new: str, sentence: str) -> None:
    assert old in ROBOT_TEXT
    with pytest.raises(RobotFileError, match=r"robot.yaml:\d+: .*" + sentence) as caught:
        robot_from_yaml(ROBOT_TEXT.replace(old, new, 1), "robot.yaml")
    line = next(
        i for i, text in enumerate(ROBOT_TEXT.replace(old, new, 1).split("\n"), 1) if new in text
    )
    assert caught.value.line == line


def with_coupling(rows: str) -> RobotModel:
    line = f"drives:\n  wrist_coupling: {{value: {rows}, source: sheet, confidence: H}}\n"
    return robot_from_yaml(ROBOT_TEXT.replace("drives:\n", line, 1))


def test_a_wrist_coupling_is_read_and_none_is_the_default(robot: RobotModel) -> None:
    turns = np.eye(6)
    turns[5, 4] = 1.0
    turns[4, 3] = -0.5
    coupled = with_coupling("[[6, 5, 1.0], [5, 4, -0.5]]")
    assert np.array_equal(coupled.motor_turns, turns)
    assert coupled.coupled
    assert not robot.coupled


@pytest.mark.parametrize(
    ("rows", "sentence"),
    [
        ("[[6, 6, 1.0]]", "couples motor 6 with axis 6"),
        ("[[7, 5, 1.0]]", "couples motor 7 with axis 5"),
        ("[[6, 5, 1.0], [5, 6, 1.0]]", "so that motors do not determine them"),
    ],
)
def test_a_coupling_that_is_none_is_refused(rows: str, sentence: str) -> None:
    with pytest.raises(RobotFileError, match=sentence):
        with_coupling(rows)
