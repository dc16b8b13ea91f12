"""Requests of MoveIt as requests of the planner: start, goals and options from its messages.

What is not understood is refused with a sentence: other groups, links and frames, constraints
along the way, attached objects. Messages are read by their fields: none of MoveIt is needed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

from ir_description import Cell
from ir_description.poses import composed, inverse, rotation_from_quaternion
from ir_description.robot import fixed_frames
from ir_kernels import portable
from ir_msgs.msg import CartesianSegment, PlanOptions
from ir_msgs.srv import ComputeIk, PlanCartesianMovement, PlanRegionalMovement
from ir_msgs_py import names
from ir_msgs_py.options import DEFAULT_SAFETY_DISTANCE
from ir_msgs_py.ros.conversions import pose_to_msg, stamped_pose_to_msg
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError
from ir_planner.node.inputs import of_joints
from ir_planner.node.moveit_scene import frame_pose, pose_in, refusal
from ir_planner.node.moveit_view import TIP
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError, shown
from ir_values.settings import check_settings, setting

PIPELINE = "ir_planner"
WAYPOINTS_MAX = 1000
START_TOLERANCE = 0.01
"""rad, per joint: `trajectory_execution.allowed_start_tolerance` of MoveIt, as it comes."""
_WHOLE_TURN = 3.14  # rad: a tolerance of pi, as people round it
# parameterization of moveit_msgs/OrientationConstraint; 0: angles about x, y, z
_ROTATION_VECTOR = 1
_GOALS_MAX = 16  # alternatives of a request
_CODE = StatusCode.INVALID_GOAL_CONSTRAINTS
_TURN = StatusCode.FRAME_TRANSFORM_FAILURE


@dataclass(frozen=True)
class MoveItSettings:
    """What MoveIt calls the robot, and what its requests do not say."""

    group: str = setting("manipulator", "Name of the planning group of the robot.", read_only=True)
    controller: str = setting(
        names.FOLLOW_JOINT_TRAJECTORY,
        "Action that drives trajectories, of the type control_msgs/action/FollowJointTrajectory.",
        read_only=True,
    )
    safety_distance: float = setting(
        DEFAULT_SAFETY_DISTANCE,
        "Distance that everything keeps.",
        unit="m",
        minimum=0.0,
        maximum=1.0,
    )
    tool_speed: float = setting(
        0.25,
        "Speed along Cartesian paths whose request bounds none.",
        unit="m/s",
        minimum=0.001,
        maximum=3.0,
    )
    state_max_age: float = setting(
        1.0,
        "Oldest joint_states that say where the robot is.",
        unit="s",
        minimum=0.01,
        maximum=60.0,
    )
    client_timeout: float = setting(
        2.0,
        "How long a goal of an action goes on when the client that sent it has left the graph; 0: "
        "to its end.",
        unit="s",
        minimum=0.0,
        maximum=3600.0,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)


def check_group(name: str, group: str) -> None:
    """Refuse another group than the robot's."""
    if name not in ("", group):
        raise refusal(
            f"group {shown(name)}", f"the robot is the group {group}", StatusCode.INVALID_GROUP_NAME
        )


def check_free(constraints: Any, what: str) -> None:
    """Refuse constraints where none can be heeded."""
    if constraints.name or any(len(getattr(constraints, kind)) for kind in _KINDS):
        raise refusal(what, "constraints along the way are not kept, so none may be given")


_KINDS = (
    "joint_constraints",
    "position_constraints",
    "orientation_constraints",
    "visibility_constraints",
)


def robot_state(state: Any, cell: Cell, what: str, code: StatusCode) -> Any:
    """The joints of a moveit_msgs/RobotState as a JointState; an empty one means where the robot
    is. Joints of grippers and axes beside the robot are left out, as MoveIt takes them.
    """
    for name in ("attached_collision_objects", "multi_dof_joint_state"):
        value = getattr(state, name)
        if len(value.joint_names if name.startswith("multi") else value):
            raise refusal(f"{name} of {what}", "it must be empty", code)
    joints = state.joint_state
    if not joints.name and not joints.position:
        return JointState()
    try:
        return of_joints(joints, cell.robot.joint_names)
    except InvalidValueError as error:
        remedy = "give all, or none for where the robot is"
        raise RequestError(code, f"{what}: {error}; {remedy}") from error


def check_near(
    q: FloatArray, where: FloatArray, joints: Sequence[str], what: str, code: StatusCode
) -> None:
    """Refuse joint values (n,) of what is to be driven that are not those where the robot is."""
    j = int(np.abs(q - where).argmax())
    if abs(q[j] - where[j]) > START_TOLERANCE:
        raise refusal(
            f"{what} has {joints[j]} at {q[j]:.4f} rad and the robot is at {where[j]:.4f} rad",
            f"what is executed begins within {START_TOLERANCE:g} rad of where the robot is",
            code,
        )


def tcp_at(link: str, pose: FloatArray, cell: Cell) -> FloatArray:
    """Pose (4, 4) of the tcp where a link of the hand is at `pose` (4, 4), both in the cell."""
    flange = cell.robot.link_names[-1]
    hand = {
        frame.name: frame.pose for frame in fixed_frames(cell.robot, (), cell.tcp, cell.base_pose)
    }
    at = {flange: np.eye(4), **{name: hand[name] for name in ("flange", "tool0", TIP)}}
    if link not in ("", *at):
        raise refusal(
            f"link {shown(link)}",
            f"poses of {', '.join(at)} can be asked for",
            StatusCode.INVALID_LINK_NAME,
        )
    if link in ("", TIP):
        return pose
    return composed(composed(pose, inverse(at[link])), at[TIP])


def goals_of(given: Sequence[Any], cell: Cell) -> list[Any]:
    """Goals of a request, alternatives in their order: each a JointState or a PoseStamped of the
    tcp. A goal is hit exactly, which is within any tolerance.
    """
    if not 1 <= len(given) <= _GOALS_MAX:
        raise refusal(f"{len(given)} goal_constraints", f"1 to {_GOALS_MAX} alternatives are taken")
    return [_goal(each, cell, f"goal_constraints[{k}]") for k, each in enumerate(given)]


def _goal(given: Any, cell: Cell, what: str) -> Any:
    """A goal of MoveIt as a message of the planner: joint values, or a pose of the tcp.
    RequestError for constraints that make no goal.
    """
    joints = len(given.joint_constraints)
    places = len(given.position_constraints)
    turns = len(given.orientation_constraints)
    if given.visibility_constraints:
        raise refusal(what, "visibility constraints can't be heeded")
    if joints and not places and not turns:
        return _joint_goal(given.joint_constraints, cell, what)
    if joints or places != 1 or turns != 1:
        raise refusal(
            what,
            f"it has {joints} joint, {places} position and {turns} orientation constraints: all "
            f"{cell.robot.n} joints, or one position and one orientation, make a goal",
        )
    place = given.position_constraints[0]
    turn = given.orientation_constraints[0]
    if place.link_name != turn.link_name:
        links = f"{shown(place.link_name)} and {shown(turn.link_name)}"
        raise refusal(what, f"its position and orientation are of two links, {links}")
    at = _region_centre(place, cell, what)
    frame = frame_pose(turn.header.frame_id, cell, what)
    q = turn.orientation
    quaternion = np.array((q.x, q.y, q.z, q.w))
    for axis in "xyz":
        _tolerance(getattr(turn, f"absolute_{axis}_axis_tolerance"), what)
    try:
        rotation = portable.matmul(frame[:3, :3], rotation_from_quaternion(quaternion))
    except InvalidValueError as error:
        raise RequestError(_TURN, f"{what}: {error}") from error
    offset = place.target_point_offset
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = at - portable.matmul(rotation, np.array((offset.x, offset.y, offset.z)))
    return stamped_pose_to_msg(tcp_at(place.link_name, pose, cell))


def _joint_goal(given: Sequence[Any], cell: Cell, what: str) -> Any:
    values = {constraint.joint_name: constraint for constraint in given}
    joints = cell.robot.joint_names
    if len(values) != len(given):
        raise refusal(what, "it names a joint twice")
    missing = [name for name in joints if name not in values]
    unknown = [name for name in values if name not in joints]
    if missing or unknown:
        which = f"{', '.join(missing)} missing" if missing else f"{shown(unknown[0])} unknown"
        raise refusal(what, f"{which}: all joints {', '.join(joints)} make a goal")
    for constraint in given:
        _tolerance(constraint.tolerance_above, f"{what}, {constraint.joint_name}")
        _tolerance(constraint.tolerance_below, f"{what}, {constraint.joint_name}")
    return JointState(name=list(joints), position=[float(values[name].position) for name in joints])


def _tolerance(value: float, what: str) -> None:
    if not value >= 0.0:
        raise refusal(what, f"a tolerance is {value:g}, it must be 0 or more")


def _region_centre(given: Any, cell: Cell, what: str) -> FloatArray:
    region = given.constraint_region
    shapes = len(region.primitives)
    places = len(region.primitive_poses)
    if region.meshes or (shapes, places) != (1, 1):
        raise refusal(
            what,
            f"its region has {shapes} primitives, {places} poses and {len(region.meshes)} meshes: "
            "one primitive with its pose is taken, whose centre is the goal",
        )
    frame = frame_pose(given.header.frame_id, cell, what)
    centre: FloatArray = composed(frame, pose_in(region.primitive_poses[0], what))[:3, 3]
    return centre


def options_of_request(given: Any, safety_distance: float) -> PlanOptions:
    """Options of a MotionPlanRequest, or of a Cartesian one; 0 is the default, as in MoveIt."""
    options = PlanOptions(safety_distance=safety_distance, include_points=True)
    for field, name in (
        ("max_velocity_scaling_factor", "velocity_scaling"),
        ("max_acceleration_scaling_factor", "acceleration_scaling"),
        ("allowed_planning_time", "planning_time"),
    ):
        value = float(getattr(given, field, 0.0))
        if not math.isfinite(value):
            raise refusal(field, f"it is {value:g}, it must be finite")
        if value != 0.0:
            setattr(options, name, value)
    return options


def movement(given: Any, cell: Cell, group: str, safety_distance: float) -> list[Any]:
    """Requests to the planner, one for each alternative goal of a MotionPlanRequest."""
    check_group(given.group_name, group)
    if given.pipeline_id not in ("", PIPELINE):
        raise refusal(f"pipeline {shown(given.pipeline_id)}", f"{PIPELINE} plans here")
    if given.trajectory_constraints.constraints:
        raise refusal("trajectory_constraints", "they are not kept, so none may be given")
    if given.reference_trajectories:
        raise refusal("reference_trajectories", "none may be given; plan_trajectory takes points")
    if given.num_planning_attempts < 0:
        raise refusal(f"num_planning_attempts {given.num_planning_attempts}", "must be 0 or more")
    if given.max_cartesian_speed > 0.0:
        raise refusal(
            f"max_cartesian_speed {given.max_cartesian_speed:g} m/s",
            "the speed of a link is bounded on Cartesian paths only",
        )
    start = robot_state(given.start_state, cell, "start_state", StatusCode.START_STATE_INVALID)
    options = options_of_request(given, safety_distance)
    options.planner_id = given.planner_id
    keep_upright(given.path_constraints, options, cell)
    asked = []
    for goal in goals_of(given.goal_constraints, cell):
        request = PlanRegionalMovement.Request(start=start, options=options)
        if isinstance(goal, PoseStamped):
            request.goal_pose = goal
        else:
            request.goal_state = goal
        asked.append(request)
    return asked


def keep_upright(constraints: Any, options: PlanOptions, cell: Cell) -> None:
    """Let options bound the tool's tilt by one orientation constraint along the way, which leaves
    the rotation about one axis free. Raises RequestError for others.
    """
    kinds = {kind: len(getattr(constraints, kind)) for kind in _KINDS}
    if not any(kinds.values()) and not constraints.name:
        return
    what = "path_constraints"
    if kinds != {**dict.fromkeys(_KINDS, 0), "orientation_constraints": 1}:
        raise refusal(what, "one orientation constraint is kept along the way, and nothing else")
    orientation = constraints.orientation_constraints[0]
    tolerance = [float(getattr(orientation, f"absolute_{axis}_axis_tolerance")) for axis in "xyz"]
    for value in tolerance:
        _tolerance(value, what)
    free = [k for k in range(3) if tolerance[k] >= _WHOLE_TURN]
    by_vector = getattr(orientation, "parameterization", 0) == _ROTATION_VECTOR
    if len(free) != 1 or (free == [1] and not by_vector):
        raise refusal(
            what,
            f"its tolerances are {', '.join(f'{value:g}' for value in tolerance)} rad: those kept "
            "leave the rotation about one axis free, with a tolerance of at least pi (about y as a "
            "rotation vector only), and bound the others",
        )
    least = min(tolerance[k] for k in range(3) if k != free[0])
    frame = frame_pose(orientation.header.frame_id, cell, what)
    q = orientation.orientation
    try:
        rotation = rotation_from_quaternion(np.array((q.x, q.y, q.z, q.w)))
    except InvalidValueError as error:
        raise RequestError(_TURN, f"{what}: {error}") from error
    hand = tcp_at(orientation.link_name, np.eye(4), cell)[:3, :3]
    # a rotation vector is up to pi / 2 times as long across the axis as the axis leans
    options.tilt_max = 2.0 * float(portable.arcsin(least / np.pi)) if by_vector else least
    options.tilt_axis = hand[free[0]].tolist()
    options.tilt_direction = portable.matmul(frame[:3, :3], rotation)[:, free[0]].tolist()


def ik_pose(given: Any, cell: Cell, group: str) -> FloatArray:
    """Pose (4, 4) of the tcp that a PositionIKRequest asks for."""
    check_group(given.group_name, group)
    check_free(given.constraints, "constraints")
    links = list(given.ik_link_names)
    poses = list(given.pose_stamped_vector)
    if len(links) > 1 or len(poses) > 1 or len(links) != len(poses):
        raise refusal(f"{len(links)} ik_link_names and {len(poses)} poses", "the robot has one tip")
    link, pose = (links[0], poses[0]) if links else (given.ik_link_name, given.pose_stamped)
    frame = frame_pose(pose.header.frame_id, cell, "pose_stamped")
    return tcp_at(link, composed(frame, pose_in(pose.pose, "pose_stamped")), cell)


def ik_request(given: Any, cell: Cell, group: str, safety_distance: float) -> Any:
    """A PositionIKRequest with avoid_collisions as a request to the planner."""
    near = robot_state(given.robot_state, cell, "robot_state", StatusCode.INVALID_ROBOT_STATE)
    return ComputeIk.Request(
        goal_pose=stamped_pose_to_msg(ik_pose(given, cell, group)),
        near=near,
        safety_distance=safety_distance,
    )


def path_request(
    given: Any,
    cell: Cell,
    group: str,
    *,
    start: Any,
    tcp: FloatArray,
    tool_speed: float,
    safety_distance: float,
) -> Any:
    """A GetCartesianPath request as one to the planner: lines from the tcp (4, 4) [m] in the start
    configuration through the waypoints. tool_speed: where the request bounds none [m/s].
    """
    check_group(given.group_name, group)
    check_free(given.path_constraints, "path_constraints")
    if not given.max_step > 0.0:
        raise refusal(f"max_step {given.max_step:g} m", "it must be above 0, as in MoveIt")
    if given.prismatic_jump_threshold > 0.0:
        raise refusal("prismatic_jump_threshold", "the robot has no prismatic joint")
    if given.max_cartesian_speed > 0.0:
        tcp_at(given.cartesian_speed_limited_link, np.eye(4), cell)
        if given.cartesian_speed_limited_link not in ("", given.link_name or TIP):
            raise refusal(
                f"cartesian_speed_limited_link {shown(given.cartesian_speed_limited_link)}",
                "the speed is bounded at the link of the path",
            )
    if not 1 <= len(given.waypoints) <= WAYPOINTS_MAX:
        raise refusal(f"{len(given.waypoints)} waypoints", f"must be 1 to {WAYPOINTS_MAX}")
    frame = frame_pose(given.header.frame_id, cell, "the waypoints")
    poses = [
        tcp_at(given.link_name, composed(frame, pose_in(pose, f"waypoints[{k}]")), cell)
        for k, pose in enumerate(given.waypoints)
    ]
    options = options_of_request(given, safety_distance)
    speed = given.max_cartesian_speed if given.max_cartesian_speed > 0.0 else tool_speed
    return PlanCartesianMovement.Request(
        start_pose=stamped_pose_to_msg(tcp),
        segments=[CartesianSegment(poses=[pose_to_msg(pose)]) for pose in poses],
        start=start,
        tool_speed=float(speed),
        speed_tolerance=1.0,  # as slow as the axes need
        options=options,
    )


def largest_jump(points: Sequence[Any]) -> float:
    """Largest change of a joint between two points of a trajectory [rad]."""
    if len(points) < 2:
        return 0.0
    q = np.array([point.positions for point in points])
    return float(np.abs(np.diff(q, axis=0)).max())
