"""A URDF of an arm on a sliding joint: the arm is read, and the rail that a cell file says.

Judge: Pinocchio's forward kinematics of the URDF itself.
"""

from __future__ import annotations

import re

import numpy as np
import pinocchio
import pytest

from ir_description.files.making import UrdfArm, urdf_arm
from ir_kernels import Chain
from ir_values.errors import RobotFileError

AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
PLACES = ("0 0 0.4", "0.2 0 0", "0 0 0.6", "0.3 0 0.1", "0.3 0 0", "0.1 0 0")
SPHERE = '<collision><geometry><sphere radius="0.06"/></geometry></collision>'
UNIT = (
    '<joint name="slide" type="prismatic"><parent link="bed"/><child link="carriage"/>'
    '<origin xyz="0.1 -0.4 0.3" rpy="0 0 1.5707963267948966"/><axis xyz="0 1 0"/>'
    '<limit lower="-1" upper="4.5" effort="9000" velocity="1.5"/></joint>'
)


def text(unit: str = UNIT, *, last: str = "revolute") -> str:
    """An arm on a carriage that slides over a bed in a room; `last`: kind of the sixth axis."""
    links = ["world", "bed", "carriage", "base_link", *(f"l{k}" for k in range(1, 7))]
    lines = ['<robot name="railed">', '<link name="world"/>']
    lines += [f'<link name="{name}">{SPHERE}</link>' for name in links[1:]]
    lines += [
        f'<link name="table">{SPHERE}</link>',
        '<joint name="jb" type="fixed"><parent link="world"/><child link="bed"/></joint>',
        '<joint name="jd" type="fixed"><parent link="world"/><child link="table"/></joint>',
        unit,
        '<joint name="jm" type="fixed"><parent link="carriage"/><child link="base_link"/>'
        '<origin xyz="0 0 0.2"/></joint>',
    ]
    for k in range(6):
        kind = last if k == 5 else "revolute"
        lines.append(
            f'<joint name="j{k + 1}" type="{kind}"><parent link="{links[k + 3]}"/>'
            f'<child link="{links[k + 4]}"/><origin xyz="{PLACES[k]}"/><axis xyz="{AXES[k]}"/>'
            '<limit lower="-2.5" upper="2.5" effort="900" velocity="3"/></joint>'
        )
    lines.append('<link name="tool0"/><joint name="jt" type="fixed"><parent link="l6"/>')
    lines.append('<child link="tool0"/><origin xyz="0.08 0 0"/></joint></robot>')
    return "\n".join(lines)


def rail_of(arm: UrdfArm) -> tuple[np.ndarray, tuple[float, float], str]:
    """Axis (3,), ends of the travel [m] and the whole sentence that an arm's notes say."""
    (note,) = (one for one in arm.notes if "slides under the arm" in one)
    found = re.search(r"rail: \{axis: \[(.*?)\], travel: \[(.*?)\], velocity: 1.5\}", note)
    assert found is not None
    low, high = map(float, found[2].split(","))
    return np.array([float(each) for each in found[1].split(",")]), (low, high), note


def test_the_arm_on_the_rail_that_is_said_is_the_chain_of_the_urdf() -> None:
    arm = urdf_arm(text(), "railed.urdf")
    assert [joint.name for joint in arm.joints] == [f"j{k}" for k in range(1, 7)]
    axis, travel, note = rail_of(arm)
    assert travel == (-1.0, 4.5)
    assert "with acceleration and carriage_mass" in note
    model = pinocchio.buildModelFromXML(text())
    data = model.createData()
    chain = Chain(arm)
    carriage = model.getFrameId("carriage")
    pinocchio.framesForwardKinematics(model, data, np.zeros(7))
    foot = data.oMf[carriage].homogeneous.copy()  # `base` of the cell file, as another note says
    assert any("slide places carriage at (0.1, -0.4, 0.3) m in bed" in one for one in arm.notes)
    draw = np.random.default_rng(4)
    for _ in range(20):
        slid = draw.uniform(*travel)
        q = draw.uniform(-2.5, 2.5, 6)
        pinocchio.framesForwardKinematics(model, data, np.append(slid, q))
        theirs = data.oMf[model.getFrameId("tool0")].translation
        ours = chain.link_poses(q[None])[0, -1, :3, 3]
        np.testing.assert_allclose(
            (foot @ [*(ours + slid * axis), 1.0])[:3], theirs, rtol=0.0, atol=1e-9
        )


def test_what_rides_is_the_arms_and_what_stands_still_is_named() -> None:
    arm = urdf_arm(text(), "railed.urdf")
    assert [each.shape.link for each in arm.links[0].shapes] == ["carriage", "base_link"]
    assert "bodies of bed, table don't ride on it and are no part of the robot" in rail_of(arm)[2]


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><mimic joint="j1"/>', "a rail moves by itself"),
        ('lower="-1" upper="4.5"', 'lower="2" upper="2"', "slide"),
        ("4.5", "inf", "slide"),
    ],
)
def test_a_sliding_joint_that_is_no_rail_is_refused_by_its_name(
    old: str, new: str, sentence: str
) -> None:
    assert old in UNIT
    with pytest.raises(RobotFileError, match=sentence) as refused:
        urdf_arm(text(UNIT.replace(old, new)), "railed.urdf")
    assert "slide" in str(refused.value)


def test_two_sliding_joints_are_no_rail() -> None:
    cross = UNIT.replace('"slide"', '"cross"').replace('child link="carriage"', 'child link="mid"')
    along = UNIT.replace('parent link="bed"', 'parent link="mid"')
    with pytest.raises(RobotFileError, match="joint cross is prismatic: only turning axes"):
        urdf_arm(text(f'<link name="mid"/>{cross}{along}'), "railed.urdf")


def test_a_sliding_joint_behind_an_axis_is_refused_by_its_name() -> None:
    with pytest.raises(RobotFileError, match="joint j6 is prismatic: only turning axes"):
        urdf_arm(text(last="prismatic"), "railed.urdf", tip="tool0")
