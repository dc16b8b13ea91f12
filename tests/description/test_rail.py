"""A robot on a linear unit: the rail of a cell file, the robot with one joint more, its URDF."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import (
    Cell,
    cell_from_yaml,
    cell_to_yaml,
    check_cell,
    load_cell,
    load_robot,
    robot_urdf,
)
from ir_description.robot import Rail, on_rail
from ir_kernels import Chain
from ir_values.errors import CellFileError, InvalidValueError

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "rail_cell.yaml"


@pytest.fixture(scope="module")
def text() -> str:
    return EXAMPLE.read_text()


@pytest.fixture(scope="module")
def cell(text: str) -> Cell:
    return cell_from_yaml(text)


def test_a_rail_is_the_first_joint_and_carries_the_whole_arm(cell: Cell) -> None:
    robot = cell.robot
    arm = load_robot("kr210_r2700_extra")
    assert robot.joint_names == ("E1", *arm.joint_names)
    assert robot.link_names == ("rail", *arm.link_names)
    assert robot.first_slides
    assert not arm.first_slides
    assert (robot.position_min[0], robot.position_max[0]) == (0.0, 5.0)
    assert robot.link_mass[1] == arm.link_mass[0] + 750.0
    for name in ("velocity_max", "friction_coulomb", "envelope_torque", "machine_home"):
        assert np.array_equal(getattr(robot, name)[1:], getattr(arm, name))
    assert robot.counterbalance is not None
    assert robot.counterbalance.joint == 2
    assert {c.link for c in robot.capsules if c.name in ("base", "carriage")} == {1}
    assert ("carriage", "l4") in robot.self_pairs


def test_what_no_data_sheet_says_lets_the_rail_reach_its_acceleration(cell: Cell) -> None:
    robot = cell.robot
    moved = robot.link_mass[1:].sum() + robot.rated_payload + robot.reflected_inertia[0]
    friction = robot.friction_coulomb[0] + robot.friction_viscous[0] * robot.velocity_max[0]
    assert moved * robot.acceleration_max[0] + friction < robot.envelope_torque[0, -2]


@settings(max_examples=40, deadline=None)
@given(
    st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1),
    st.floats(-20.0, 5.0),
    st.floats(0.1, 30.0),
    st.floats(0.1, 3.0),
    st.floats(0.0, 2e4),
    st.floats(0.0, 2e4),
)
def test_a_written_rail_is_read_back_bit_for_bit(
    direction: tuple[float, float, float],
    low: float,
    travel: float,
    velocity: float,
    force: float,
    power: float,
) -> None:
    axis = np.array(direction) / np.linalg.norm(direction)
    rail = Rail(
        axis=axis,
        low=low,
        high=low + travel,
        home=low + travel / 2.0,
        velocity=velocity,
        acceleration=1.3,
        carriage_mass=333.0,
        force=force,
        power=power,
    )
    robot = on_rail(load_robot("kr210_r2700_extra"), rail)
    cell = replace(
        cell_from_yaml(EXAMPLE.read_text()),
        robot=robot,
        park=robot.machine_home,
        machine_home=robot.machine_home,
        base_contacts=(),
        program=(),
    )
    again = cell_from_yaml(cell_to_yaml(cell))
    assert cell_to_yaml(again) == cell_to_yaml(cell)
    for name in ("joint_axis", "envelope_torque", "position_max", "friction_coulomb", "link_mass"):
        assert np.array_equal(getattr(again.robot, name), getattr(robot, name)), name
    assert np.array_equal(again.machine_home, cell.machine_home)


def test_the_urdf_is_that_chain_with_a_prismatic_joint(cell: Cell) -> None:
    model = pinocchio.buildModelFromXML(robot_urdf(cell.robot, cell.tool, cell.tcp, cell.base_pose))
    data = model.createData()
    assert model.joints[1].shortname().startswith("JointModelP")
    chain = Chain(cell.robot, cell.base_pose, cell.tcp)
    rng = np.random.default_rng(1)
    for q in rng.uniform(cell.robot.position_min, cell.robot.position_max, (20, 7)):
        pinocchio.framesForwardKinematics(model, data, q)
        theirs = data.oMf[model.getFrameId("tcp")].homogeneous
        np.testing.assert_allclose(chain.tcp_poses(q[None])[0], theirs, rtol=0.0, atol=1e-9)


def test_the_review_looks_from_where_the_rail_brings_the_arm_nearest(text: str) -> None:
    assert check_cell(cell_from_yaml(text)) == ()
    away = text.replace("pose: {xyz: [2.2, 5, 0]}", "pose: {xyz: [2.2, 9, 0]}")
    (finding,) = check_cell(cell_from_yaml(away))
    assert finding.subject == "press_place"


REFUSED = {
    "axis: [0, 1, 0]": ("axis: [0, 2, 0]", "axis"),
    "axis: [0, 1, 0]  ": ("axis: [0, 0.5, 0]", "length 0.5, must be 1"),
    "travel: [0, 5]": ("travel: [5, 0]", "first end must be below"),
    "velocity: 1.89": ("velocity: 0", "velocity"),
    "carriage_mass: 750": ("", "carriage_mass"),
    "title: KUKA KL 4000": ("name: J7", "known are E1"),
    "home_deg: [0, 0, -90, 90, 0, 0, 0]": ("home_deg: [0, -90, 90, 0, 0, 0]", "7"),
    "park_deg: [0, 0, -125": ("park_deg: [5.5, 0, -125", "E1 is 5.5 m, must be in [0, 5] m"),
    "travel: [0, 5]  ": ("travel: [1, 5]", "rail home is 0 m"),
}


@pytest.mark.parametrize("place", REFUSED)
def test_what_is_no_rail_is_refused_at_its_line(text: str, place: str) -> None:
    wrong, sentence = REFUSED[place]
    with pytest.raises(CellFileError, match=re.escape(sentence)):
        cell_from_yaml(text.replace(place.strip(), wrong))


def test_a_robot_is_on_one_rail_at_most(cell: Cell) -> None:
    assert cell.robot.rail is not None
    with pytest.raises(InvalidValueError, match="on the rail E1 already"):
        on_rail(cell.robot, cell.robot.rail)


def test_several_robots_have_no_rail_yet() -> None:
    several = Path(load_cell.__globals__["__file__"]).parent / "data/robot_cells/two_robots.yaml"
    rail = "rail: {axis: [1, 0, 0], travel: [0, 1], velocity: 1, acceleration: 1, carriage_mass: 9}"
    text = several.read_text().replace(
        "robot: kr210_r2700_extra", f"robot: kr210_r2700_extra\n    {rail}", 1
    )
    with pytest.raises(CellFileError, match="several robots"):
        cell_from_yaml(text)
