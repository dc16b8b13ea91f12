"""Requests of MoveIt as requests of the planner, on plain objects, without moveit_msgs."""

from __future__ import annotations

import sys
from types import SimpleNamespace as Of
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState, MultiDOFJointState
from shape_msgs.msg import Mesh, MeshTriangle, SolidPrimitive
from std_msgs.msg import Header

from ir_description import cell_from_yaml, cell_to_yaml, load_cell
from ir_kernels.chain import Chain
from ir_msgs_py.ros.conversions import pose_from_msg, pose_to_msg, stamped_pose_from_msg
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError
from ir_planner.node.moveit_requests import ik_pose, movement, path_request, robot_state, tcp_at
from ir_planner.node.moveit_scene import applied
from ir_values.errors import IrError

CELL = load_cell("demo")
NAMES = CELL.robot.joint_names
HOME = (0.0, -1.5, 1.5, 0.0, 0.3, 0.0)
MARGIN = 0.02
CHAIN = Chain(CELL.robot, CELL.base_pose, CELL.tcp)
ADD, REMOVE, APPEND, MOVE = range(4)


def constraints(**kinds: Any) -> Any:
    empty = dict.fromkeys(
        ("joint_constraints", "position_constraints", "orientation_constraints"), ()
    )
    return Of(**{"name": "", "visibility_constraints": (), **empty, **kinds})


def state(**fields: Any) -> Any:
    own = {
        "joint_state": JointState(),
        "multi_dof_joint_state": MultiDOFJointState(),
        "attached_collision_objects": (),
    }
    return Of(**{**own, **fields})


def joints(values: Any = HOME, names: Any = NAMES) -> Any:
    return constraints(
        joint_constraints=[
            Of(joint_name=name, position=value, tolerance_above=1e-3, tolerance_below=1e-3)
            for name, value in zip(names, values, strict=True)
        ]
    )


def pose_goal(pose: Any, link: str = "tcp", frame: str = "cell", offset: Any = (0, 0, 0)) -> Any:
    """The goal that MoveIt makes of a pose of a link: a sphere and an orientation."""
    msg = pose_to_msg(pose)
    region = Of(
        primitives=[SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[1e-3])],
        primitive_poses=[Pose(position=msg.position)],
        meshes=[],
    )
    place = Of(
        header=Header(frame_id=frame),
        link_name=link,
        target_point_offset=Vector3(**dict(zip("xyz", map(float, offset), strict=True))),
        constraint_region=region,
    )
    turn = Of(
        header=Header(frame_id=frame),
        link_name=link,
        orientation=msg.orientation,
        absolute_x_axis_tolerance=0.01,
        absolute_y_axis_tolerance=0.01,
        absolute_z_axis_tolerance=0.01,
    )
    return constraints(position_constraints=[place], orientation_constraints=[turn])


def plan_request(*goals: Any, **fields: Any) -> Any:
    own = {
        "group_name": "manipulator",
        "pipeline_id": "",
        "planner_id": "",
        "path_constraints": constraints(),
        "trajectory_constraints": Of(constraints=()),
        "reference_trajectories": (),
        "num_planning_attempts": 10,
        "max_cartesian_speed": 0.0,
        "max_velocity_scaling_factor": 0.0,
        "max_acceleration_scaling_factor": 0.3,
        "allowed_planning_time": 0.0,
        "start_state": state(),
        "goal_constraints": goals or (joints(),),
    }
    return Of(**{**own, **fields})


def asked(request: Any) -> Any:
    (one,) = movement(request, CELL, "manipulator", MARGIN)
    return one


def upright(tolerances: Any, rotation: Any = None, **fields: Any) -> Any:
    """A constraint along the way on the orientation of a link."""
    pose = np.eye(4)
    pose[:3, :3] = np.eye(3) if rotation is None else rotation
    names = (f"absolute_{axis}_axis_tolerance" for axis in "xyz")
    own = {
        "header": Header(frame_id="cell"),
        "link_name": "tcp",
        "orientation": pose_to_msg(pose).orientation,
        "parameterization": 0,
        **dict(zip(names, tolerances, strict=True)),
    }
    return constraints(orientation_constraints=[Of(**{**own, **fields})], name="upright")


angles = st.lists(st.floats(-1.5, 1.5), min_size=6, max_size=6).map(np.array)


@pytest.mark.parametrize(
    "field",
    ["allowed_planning_time", "max_velocity_scaling_factor", "max_acceleration_scaling_factor"],
)
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_options_that_are_no_numbers_are_refused_by_name(field: str, value: float) -> None:
    with pytest.raises(RequestError, match=f"{field}: it is {value:g}, it must be finite"):
        asked(plan_request(**{field: value}))


def test_joint_goals_options_and_an_empty_start_are_taken() -> None:
    one = asked(plan_request(joints(HOME[::-1], NAMES[::-1])))
    assert list(one.goal_state.name) == list(NAMES)
    assert tuple(one.goal_state.position) == HOME
    assert not one.start.position
    assert one.options.velocity_scaling == 1.0
    assert one.options.acceleration_scaling == pytest.approx(0.3)
    assert one.options.planning_time == 5.0
    assert one.options.include_points


def test_alternative_goals_are_asked_for_one_by_one() -> None:
    both = movement(plan_request(joints(), pose_goal(np.eye(4))), CELL, "manipulator", MARGIN)
    assert both[0].goal_state.name
    assert both[1].goal_pose.header.frame_id == "cell"


@pytest.mark.parametrize("link", ["tcp", "tool0", "flange", "link_6"])
@given(q=angles, offset=st.tuples(*[st.floats(-0.3, 0.3)] * 3))
@settings(max_examples=20, deadline=None)
def test_a_pose_of_any_link_of_the_hand_is_the_pose_of_the_tcp_there(
    link: str, q: Any, offset: Any
) -> None:
    tcp = CHAIN.tcp_poses(q[None])[0]
    flange = CHAIN.link_poses(q[None])[0][-1]
    at = {"tcp": tcp, "flange": flange, "link_6": flange}
    at["tool0"] = flange @ turned_tool0()
    pose = at[link].copy()
    pose[:3, 3] += pose[:3, :3] @ np.array(offset)  # the point of the link that is to be there
    one = asked(plan_request(pose_goal(pose, link, offset=offset)))
    found = stamped_pose_from_msg(one.goal_pose, {})
    assert np.abs(found - tcp).max() < 1e-6


def turned_tool0() -> Any:
    """z out of the flange, whose x is out: by the frames that the driver publishes."""
    from ir_description.robot import fixed_frames

    frames = fixed_frames(CELL.robot, (), CELL.tcp, CELL.base_pose)
    return next(each.pose for each in frames if each.name == "tool0")


def test_poses_in_the_frame_of_the_base_are_of_the_base() -> None:
    pose = np.eye(4)
    pose[:3, 3] = 1.2, 0.1, 0.9
    there = asked(plan_request(pose_goal(pose, frame="base_link")))
    found = stamped_pose_from_msg(there.goal_pose, {})
    assert np.abs(found - CELL.base_pose @ pose).max() < 1e-9


NO_GOAL = StatusCode.INVALID_GOAL_CONSTRAINTS


@pytest.mark.parametrize(
    ("fields", "code", "sentence"),
    [
        ({"group_name": "arm_2"}, StatusCode.INVALID_GROUP_NAME, "group 'arm_2'"),
        ({"pipeline_id": "ompl"}, NO_GOAL, "pipeline 'ompl'"),
        ({"path_constraints": joints()}, NO_GOAL, "path_constraints"),
        ({"path_constraints": constraints(name="upright")}, NO_GOAL, "path_constraints"),
        ({"trajectory_constraints": Of(constraints=[1])}, NO_GOAL, "trajectory_constraints"),
        ({"reference_trajectories": [1]}, NO_GOAL, "reference_trajectories"),
        ({"num_planning_attempts": -1}, NO_GOAL, "num_planning_attempts -1"),
        ({"max_cartesian_speed": 0.1}, NO_GOAL, r"max_cartesian_speed 0\.1 m/s"),
        ({"goal_constraints": ()}, NO_GOAL, "0 goal_constraints"),
        ({"goal_constraints": [constraints()]}, NO_GOAL, "0 joint, 0 position"),
        ({"goal_constraints": [joints(HOME[:5], NAMES[:5])]}, NO_GOAL, "joint_a6 missing"),
        (
            {"goal_constraints": [joints((*HOME, 0.0), (*NAMES, "finger"))]},
            NO_GOAL,
            "'finger' unknown",
        ),
        (
            {"goal_constraints": [pose_goal(np.eye(4), "link_3")]},
            StatusCode.INVALID_LINK_NAME,
            "link 'link_3'",
        ),
        (
            {"goal_constraints": [pose_goal(np.eye(4), frame="map")]},
            StatusCode.FRAME_TRANSFORM_FAILURE,
            "frame 'map'",
        ),
        (
            {"start_state": state(attached_collision_objects=[1])},
            StatusCode.START_STATE_INVALID,
            "attached_collision_objects of start_state",
        ),
        (
            {"start_state": state(joint_state=JointState(name=["joint_a1"], position=[0.0]))},
            StatusCode.START_STATE_INVALID,
            "joint_a2, joint_a3, joint_a4, joint_a5, joint_a6 missing",
        ),
    ],
)
def test_what_is_not_understood_is_refused_by_name(
    fields: Any, code: StatusCode, sentence: str
) -> None:
    with pytest.raises(RequestError, match=sentence) as refused:
        asked(plan_request(**fields))
    assert refused.value.code == code


def test_joints_of_a_gripper_are_left_out_of_a_state() -> None:
    given_state = JointState(name=["finger", *NAMES], position=[0.1, *HOME])
    taken = robot_state(state(joint_state=given_state), CELL, "state", NO_GOAL)
    assert list(taken.name) == list(NAMES)
    assert tuple(taken.position) == HOME


def ik(**fields: Any) -> Any:
    own = {
        "group_name": "",
        "constraints": constraints(),
        "robot_state": state(),
        "ik_link_name": "",
        "pose_stamped": PoseStamped(),
        "ik_link_names": (),
        "pose_stamped_vector": (),
    }
    return Of(**{**own, **fields})


def test_the_pose_of_inverse_kinematics_is_of_one_tip() -> None:
    pose = CHAIN.tcp_poses(np.array([HOME]))[0]
    stamped = PoseStamped(header=Header(frame_id="cell"), pose=pose_to_msg(pose))
    alone = ik_pose(ik(pose_stamped=stamped), CELL, "manipulator")
    listed = ik_pose(ik(ik_link_names=["tcp"], pose_stamped_vector=[stamped]), CELL, "manipulator")
    assert np.abs(alone - pose).max() < 1e-9
    assert np.array_equal(alone, listed)
    with pytest.raises(RequestError, match="one tip"):
        ik_pose(
            ik(ik_link_names=["a", "b"], pose_stamped_vector=[stamped] * 2), CELL, "manipulator"
        )


def path(**fields: Any) -> Any:
    own = {
        "group_name": "",
        "path_constraints": constraints(),
        "max_step": 0.01,
        "prismatic_jump_threshold": 0.0,
        "max_cartesian_speed": 0.0,
        "cartesian_speed_limited_link": "",
        "link_name": "flange",
        "header": Header(),
        "waypoints": [Pose(position=Point(x=1.5, z=1.0), orientation=Quaternion(y=0.6, w=0.8))],
    }
    return Of(**{**own, **fields})


def cartesian(request: Any) -> Any:
    return path_request(
        request, CELL, "manipulator", start=JointState(), tcp=np.eye(4), tool_speed=0.25,
        safety_distance=MARGIN,
    )  # fmt: skip


def test_a_path_runs_through_its_waypoints_at_the_speed_that_bounds_it() -> None:
    one = cartesian(path())
    (segment,) = one.segments
    expected = tcp_at("flange", pose_from_msg(path().waypoints[0]), CELL)
    assert np.abs(pose_from_msg(segment.poses[0]) - expected).max() < 1e-9
    assert one.tool_speed == 0.25
    assert cartesian(path(max_cartesian_speed=0.1)).tool_speed == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"max_step": 0.0}, "max_step 0 m"),
        ({"waypoints": []}, "0 waypoints"),
        ({"prismatic_jump_threshold": 0.1}, "no prismatic joint"),
        ({"path_constraints": joints()}, "path_constraints"),
        (
            {"max_cartesian_speed": 0.1, "cartesian_speed_limited_link": "tool0"},
            "cartesian_speed_limited_link 'tool0'",
        ),
    ],
)
def test_paths_that_can_t_be_kept_are_refused(fields: Any, sentence: str) -> None:
    with pytest.raises(RequestError, match=sentence):
        cartesian(path(**fields))


def solid(kind: int, *sizes: float) -> Any:
    return SolidPrimitive(type=kind, dimensions=list(sizes))


BOX = solid(SolidPrimitive.BOX, 0.2, 0.3, 0.4)


def tetrahedron() -> Any:
    corners = [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.2)]
    rows = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    return Mesh(
        vertices=[Point(x=x, y=y, z=z) for x, y, z in corners],
        triangles=[MeshTriangle(vertex_indices=list(row)) for row in rows],
    )


def thing(name: str = "crate", operation: int = ADD, **fields: Any) -> Any:
    own = {
        "id": name,
        "operation": bytes([operation]),
        "header": Header(frame_id="cell"),
        "pose": Pose(position=Point(x=3.0, y=3.0, z=1.0)),
        "primitives": [],
        "meshes": [],
        "planes": [],
        "subframe_names": [],
    }
    merged = {**own, **fields}
    poses = {"primitive_poses": "primitives", "mesh_poses": "meshes"}
    for key, shapes in poses.items():
        merged.setdefault(key, [Pose() for _ in merged[shapes]])
    return Of(**merged)


def scene(*things: Any, is_diff: bool = True, **fields: Any) -> Any:
    own = {
        "is_diff": is_diff,
        "robot_model_name": "",
        "fixed_frame_transforms": (),
        "allowed_collision_matrix": Of(entry_names=(), entry_values=(), default_entry_names=()),
        "robot_state": state(),
        "link_padding": (),
        "link_scale": (),
        "world": Of(collision_objects=things, octomap=Of(octomap=Of(data=()))),
    }
    return Of(**{**own, **fields})


def test_shapes_become_bodies_of_a_machine_and_are_read_back_by_the_cell() -> None:
    shapes = [BOX, solid(SolidPrimitive.SPHERE, 0.1), solid(SolidPrimitive.CYLINDER, 0.5, 0.2)]
    things = thing(primitives=shapes, meshes=[tetrahedron()])
    now = applied(scene(things), CELL, ())
    again = cell_from_yaml(cell_to_yaml(now.cell))
    bodies = {body.name: body for body in again.machine("crate").world_bodies()}
    kinds = {name: body.kind for name, body in bodies.items()}
    assert kinds == {
        "crate_0": "box", "crate_1": "sphere", "crate_2": "cylinder", "crate_3": "mesh",
    }  # fmt: skip
    assert bodies["crate_2"].size.tolist() == [0.2, 0.5, 0.0]
    assert bodies["crate_0"].pose[:3, 3].tolist() == [3.0, 3.0, 1.0]
    assert now.objects == {"crate"}
    assert {each.name for each in CELL.equipment} < {each.name for each in again.equipment}


@given(
    steps=st.lists(
        st.tuples(st.sampled_from("abc"), st.sampled_from([ADD, REMOVE, APPEND, MOVE])),
        max_size=6,
    ),
    x=st.floats(-5.0, 5.0),
)
@settings(max_examples=20, deadline=None)
def test_any_sequence_of_operations_leaves_what_a_plain_table_has(steps: Any, x: float) -> None:
    """The judge: a table of where each object is and how many shapes it has."""
    table: dict[str, tuple[float, int]] = {}
    cell = CELL
    ours: frozenset[str] = frozenset()
    for k, (name, operation) in enumerate(steps):
        at = Pose(position=Point(x=x + k, y=4.0))
        shapes = [] if operation in (MOVE, REMOVE) else [BOX]
        asked_for = scene(thing(name, operation, pose=at, primitives=shapes))
        if operation != ADD and name not in table:
            with pytest.raises(RequestError, match="no scene has added it"):
                applied(asked_for, cell, ours)
            continue
        done = applied(asked_for, cell, ours)
        cell = done.cell
        ours = done.objects
        there, count = table.get(name, (x + k, 0))
        if operation == REMOVE:
            del table[name]
        else:
            moved = operation in (ADD, MOVE)
            grown = {ADD: 1, APPEND: count + 1, MOVE: count}[operation]
            table[name] = (x + k if moved else there, grown)
    own = {each.name: each for each in cell.equipment if each.name in ours}
    found = {name: (each.pose[0, 3], len(each.bodies)) for name, each in own.items()}
    assert found == table
    assert len(cell.equipment) == len(CELL.equipment) + len(table)


def test_without_moveit_msgs_the_node_says_where_to_get_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from ir_planner.node import moveit

    for name in ("moveit_msgs", "moveit_msgs.srv"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(IrError, match=r"docs/ros_interfaces\.md says how"):
        moveit.moveit_types()


def test_what_is_appended_stands_where_its_own_pose_says() -> None:
    first = applied(scene(thing(primitives=[BOX])), CELL, ())
    more = thing(operation=APPEND, primitives=[BOX], pose=Pose(position=Point(x=-2.0, z=0.5)))
    both = applied(scene(more), first.cell, first.objects).cell.machine("crate").world_bodies()
    assert [body.pose[:3, 3].tolist() for body in both] == [[3.0, 3.0, 1.0], [-2.0, 0.0, 0.5]]


def test_a_whole_scene_replaces_earlier_objects_and_leaves_the_cell() -> None:
    first = applied(scene(thing("a", primitives=[BOX])), CELL, ())
    whole = applied(scene(thing("b", primitives=[BOX]), is_diff=False), first.cell, first.objects)
    assert whole.objects == {"b"}
    assert len(whole.cell.equipment) == len(CELL.equipment) + 1
    none = applied(scene(thing("", REMOVE)), whole.cell, whole.objects)
    assert none.objects == frozenset()
    assert cell_to_yaml(none.cell) == cell_to_yaml(CELL)


@pytest.mark.parametrize(
    ("given_scene", "sentence"),
    [
        (scene(thing("lathe", primitives=[BOX])), "a machine or part of the cell has this name"),
        (scene(thing(primitives=[solid(SolidPrimitive.CONE, 1.0, 1.0)])), "a cone can't be taken"),
        (scene(thing(primitives=[solid(SolidPrimitive.BOX, 1.0)])), "a box has 3 dimensions"),
        (scene(thing(primitives=[solid(SolidPrimitive.SPHERE, -1.0)])), r"-1\.0"),
        (scene(thing(planes=[1])), "planes can't be taken"),
        (scene(thing()), "it has no shape"),
        (scene(thing(subframe_names=["x"], primitives=[BOX])), "subframes"),
        (scene(thing(operation=7, primitives=[BOX])), "operation 7 is unknown"),
        (scene(thing(header=Header(frame_id="map"), primitives=[BOX])), "frame 'map'"),
        (scene(thing(primitives=[BOX], primitive_poses=[])), "1 primitives and 0 primitive_poses"),
        (scene(robot_model_name="panda"), "robot model 'panda'"),
        (scene(link_padding=[Of(padding=0.1)]), "link_padding of the scene"),
        (
            scene(allowed_collision_matrix=Of(entry_names=["a"], default_entry_names=())),
            "allowed_collision_matrix",
        ),
        (
            scene(robot_state=state(attached_collision_objects=[1])),
            r"robot_state\.attached_collision_objects",
        ),
    ],
)
def test_a_scene_that_can_t_be_held_is_refused_as_a_whole(given_scene: Any, sentence: str) -> None:
    with pytest.raises(RequestError, match=sentence):
        applied(given_scene, CELL, ())


def within(error: Any, tolerances: Any, *, as_vector: bool) -> bool:
    """Whether MoveIt would take a rotation (3, 3) off the one asked for."""
    turn = Rotation.from_matrix(error)
    values = turn.as_rotvec() if as_vector else turn.as_euler("XYZ")
    return bool((np.abs(values) <= np.array(tolerances) + 1e-9).all())


@settings(max_examples=100, deadline=None)
@given(
    angles,
    st.sampled_from((0, 1, 2)),
    st.booleans(),
    st.floats(0.05, 1.0),
    st.floats(0.0, 1.0),
    st.floats(-3.0, 3.0),
    st.floats(-3.0, 3.0),
)
def test_what_leans_less_than_asked_of_the_planner_moveit_takes_too(
    q: Any, free: int, as_vector: bool, most: float, share: float, around: float, spin: float
) -> None:
    if free == 1 and not as_vector:
        return
    rotation = CHAIN.tcp_poses(q[None])[0, :3, :3]
    tolerances = [most, most, most]
    tolerances[free] = 3.2
    constraint = upright(tolerances, rotation, parameterization=int(as_vector))
    options = asked(plan_request(path_constraints=constraint)).options
    axis = np.array(options.tilt_axis)
    np.testing.assert_allclose(axis, np.eye(3)[free], atol=1e-9)
    np.testing.assert_allclose(options.tilt_direction, rotation @ axis, atol=1e-9)
    across = np.roll(axis, 1) * np.cos(around) + np.roll(axis, 2) * np.sin(around)
    lean = Rotation.from_rotvec(share * options.tilt_max * across)
    leaning = (lean * Rotation.from_rotvec(spin * axis)).as_matrix()
    assert within(leaning, tolerances, as_vector=as_vector)


@pytest.mark.parametrize(
    "tolerances", [(0.1, 0.1, 0.1), (3.2, 3.2, 0.1), (0.1, 3.2, 0.1), (-0.1, 0.1, 3.2)]
)
def test_other_tolerances_along_the_way_are_refused(tolerances: Any) -> None:
    with pytest.raises(RequestError, match="tolerance"):
        asked(plan_request(path_constraints=upright(tolerances)))
