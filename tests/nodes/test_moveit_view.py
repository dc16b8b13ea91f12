"""The planning scene that is published, on plain objects, without moveit_msgs: what a client sends
back of it is no change.
"""

from __future__ import annotations

from types import SimpleNamespace as Of
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose
from hypothesis import given, settings
from hypothesis import strategies as st
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import Header

from ir_description import cell_to_yaml, load_cell, robot_urdf
from ir_planner.errors import RequestError
from ir_planner.node.moveit_scene import applied
from ir_planner.node.moveit_view import planning_scene, semantic_description

CELLS = {name: load_cell(name) for name in ("demo", "open", "cnc_door", "deep_box")}
NAMES = 8  # bit of moveit_msgs/PlanningSceneComponents


def made(**defaults: Any) -> Any:
    """A class of messages by its fields: each instance has lists and messages of its own."""

    def new(**fields: Any) -> Any:
        return Of(**{name: make() for name, make in defaults.items()} | fields)

    return new


def messages() -> Any:
    matrix = made(
        entry_names=list, entry_values=list, default_entry_names=list, default_entry_values=list
    )
    state = made(
        joint_state=JointState,
        multi_dof_joint_state=MultiDOFJointState,
        attached_collision_objects=list,
        is_diff=bool,
    )
    thing = made(
        header=Header, pose=Pose, id=str, primitives=list, primitive_poses=list, meshes=list,
        mesh_poses=list, planes=list, subframe_names=list, operation=int,
    )  # fmt: skip
    thing.ADD = 0
    components = Of(
        ROBOT_STATE=2, ROBOT_STATE_ATTACHED_OBJECTS=4, WORLD_OBJECT_NAMES=NAMES,
        WORLD_OBJECT_GEOMETRY=16, ALLOWED_COLLISION_MATRIX=128,
    )  # fmt: skip
    scene = made(
        name=str, robot_state=state, robot_model_name=str, fixed_frame_transforms=list,
        allowed_collision_matrix=matrix, link_padding=list, link_scale=list, object_colors=list,
        world=lambda: Of(collision_objects=[], octomap=Of(octomap=Of(data=()))), is_diff=bool,
    )  # fmt: skip
    return Of(
        RobotState=state,
        CollisionObject=thing,
        PlanningSceneComponents=components,
        PlanningScene=scene,
        AllowedCollisionEntry=made(enabled=list),
        AllowedCollisionMatrix=matrix,
    )


def published(name: str, wanted: int = 0) -> Any:
    cell = CELLS[name]
    return planning_scene(messages(), cell, np.array(cell.park), Time(), wanted)


@pytest.mark.parametrize("name", CELLS)
def test_the_published_scene_sent_back_changes_nothing(name: str) -> None:
    scene = published(name)
    assert scene.world.collision_objects
    now = applied(scene, CELLS[name], ())
    assert cell_to_yaml(now.cell) == cell_to_yaml(CELLS[name])
    assert not now.objects
    assert "the robot is where its joint_states say" in now.notes


@given(name=st.sampled_from(sorted(CELLS)), which=st.integers(0, 1000), axis=st.sampled_from("xyz"))
@settings(deadline=None)
def test_a_published_object_that_was_moved_or_resized_is_refused(
    name: str, which: int, axis: str
) -> None:
    """Machines are set_equipment's: what is changed of them is never left out without a word."""
    scene = published(name)
    things = scene.world.collision_objects
    moved = things[which % len(things)]
    setattr(moved.pose.position, axis, 0.01)
    with pytest.raises(RequestError, match=f"'{moved.id}': a machine or part of the cell has this"):
        applied(scene, CELLS[name], ())


def test_the_matrix_of_links_sent_back_with_another_pair_is_refused() -> None:
    scene = published("demo")
    rows = scene.allowed_collision_matrix.entry_values
    k, j = next(
        (k, j) for k in range(len(rows)) for j in range(len(rows)) if not rows[k].enabled[j]
    )
    rows[k].enabled[j] = True
    rows[j].enabled[k] = True
    with pytest.raises(RequestError, match="allowed_collision_matrix of the scene"):
        applied(scene, CELLS["demo"], ())


def test_names_alone_have_no_shapes_and_a_state_that_is_unknown_is_left_out() -> None:
    scene = published("demo", NAMES)
    assert {each.id for each in scene.world.collision_objects} == {
        each.id for each in published("demo").world.collision_objects
    }
    assert not any(each.primitives or each.meshes for each in scene.world.collision_objects)
    assert not scene.allowed_collision_matrix.entry_names
    unknown = planning_scene(messages(), CELLS["demo"], None, Time(), 0)
    assert not unknown.robot_state.joint_state.name


@pytest.mark.parametrize("name", CELLS)
def test_the_semantic_description_names_links_and_joints_of_the_urdf(name: str) -> None:
    cell = CELLS[name]
    urdf = Xml.fromstring(robot_urdf(cell.robot, cell.tool, cell.tcp, cell.base_pose))
    srdf = Xml.fromstring(semantic_description(cell, "manipulator"))
    links = {link.get("name") for link in urdf.iter("link")}
    joints = {joint.get("name") for joint in urdf.iter("joint") if joint.get("type") == "revolute"}
    pairs = {
        frozenset((each.get("link1"), each.get("link2")))
        for each in srdf.iter("disable_collisions")
    }
    assert srdf.get("name") == urdf.get("name")
    assert links.issuperset(link for pair in pairs for link in pair)
    chain = [urdf.find(f"joint/parent[@link='link_{k}']") for k in range(1, 6)]
    assert all(each is not None for each in chain)
    assert {frozenset((f"link_{k}", f"link_{k + 1}")) for k in range(1, 6)} <= pairs
    for state in srdf.findall("group_state"):
        assert {joint.get("name") for joint in state} == joints
