"""Values of requests: states, goals, options, trajectories and paths from messages."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import Any

import numpy as np
from sensor_msgs.msg import JointState

from ir_description import Cell
from ir_description.cell import CellPath
from ir_description.robot import RAIL_LINK
from ir_kernels import portable
from ir_msgs_py.cartesian import POSES_MAX, CartesianPath, CartesianSegment
from ir_msgs_py.names import BASE_FRAME
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.ros.conversions import (
    configuration_from_msg,
    configuration_given,
    pose_from_msg,
    stamped_pose_from_msg,
    stamped_pose_given,
    trajectory_from_msg,
    trajectory_given,
    velocity_from_msg,
)
from ir_msgs_py.ros.plan_conversions import plan_options_from_msg
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory, MotionSamples
from ir_planner.errors import RequestError
from ir_planner.planner import Planner
from ir_planner.request import POSITION_MAX, Goal, motion_on, one_goal
from ir_planner.state_queries import STATES_MAX
from ir_planner.trajectories import POINTS_MAX, Reference
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError, JointNamesError, PoseError

# What requests say, as values: states, goals, poses, options, trajectories. Nothing here is
# planned.

# A measured state that is slower stands [rad/s]; ends of planned movements are at rest.
AT_REST = 0.01
# Looks for a state, each so long [s]: 4 s for a driver that publishes 500 times a second.
LOOK = 0.02
LOOKS = 200
_SHOWN = 6  # names of foreign joints in a sentence
MEASURED = 9  # decimals of rad: finer than any encoder, and less than what counts as movement


@dataclass
class LastState:
    """The last joint_states (n,), and when it came [s on the node's clock]; written and read by
    different threads. look: takes what has come since the last look. offered: whether somebody
    publishes them.
    """

    look: Callable[[], None] = lambda: None
    offered: Callable[[], bool] = lambda: False
    q: FloatArray | None = None
    velocity: FloatArray | None = None
    came: float = 0.0
    problem: str = ""
    _lock: Lock = field(default_factory=Lock)

    def take(self, q: FloatArray, now: float, velocity: FloatArray | None = None) -> None:
        """Keep a state q (n,) [rad] that came at `now` [s]; velocity (n,) [rad/s], None: not known.

        It is kept to MEASURED decimals: a robot that stands is one start, not a new one with every
        measurement, so the same request gives the same trajectory.
        """
        with self._lock:
            # + 0.0: no negative zeros
            self.q = np.round(q, MEASURED) + 0.0
            self.problem = ""
            self.came = now
            self.velocity = velocity

    def known(
        self, now: float, max_age: float, joints_at_rest: tuple[str, ...] = ()
    ) -> FloatArray | None:
        """The last state (n,) however old, None while there is none.

        Raises RequestError where the joints of these names must stand and one that isn't older than
        max_age [s] moves.
        """
        self.look()
        with self._lock:
            q = self.q
            velocity = self.velocity
            age = now - self.came
        if joints_at_rest and velocity is not None and age <= max_age:
            check_at_rest(
                velocity, joints_at_rest, "the robot is moving", StatusCode.START_STATE_INVALID
            )
        return q

    def soon(
        self,
        now: Callable[[], float],
        max_age: float,
        joints_at_rest: tuple[str, ...] = (),
        sleep: Callable[[float], None] = time.sleep,
    ) -> FloatArray:
        """The same as `fresh`, after a wait for a state where somebody publishes them: on a busy
        machine a driver that has just started, or was held up, is heard a moment later.
        """
        for _ in range(LOOKS):
            self.look()
            if (self.q is not None and now() - self.came <= max_age) or not self.offered():
                break
            sleep(LOOK)
        return self.fresh(now(), max_age, joints_at_rest)

    def fresh(self, now: float, max_age: float, joints_at_rest: tuple[str, ...] = ()) -> FloatArray:
        """Positions (n,) of a state that is at most max_age [s] old. Raises RequestError when there
        is none, or an older one.
        """
        q = self.known(now, max_age, joints_at_rest)
        if q is None:
            raise RequestError(
                StatusCode.ROBOT_STATE_STALE,
                f"no joint_states of this robot have come yet: "
                f"{self.problem or 'nobody publishes them'}; give the state in the request",
            )
        age = now - self.came
        if age > max_age:
            raise RequestError(
                StatusCode.ROBOT_STATE_STALE,
                f"the last joint_states came {age:.1f} s ago: it must be at most {max_age:g} s; "
                "give the state in the request",
            )
        return q


def has_joints(msg: Any, joint_names: tuple[str, ...]) -> bool:
    """Whether a joint_states message says where all joints of the robot are."""
    return not msg.name or set(joint_names) <= set(msg.name)


def of_joints(msg: Any, joint_names: tuple[str, ...]) -> Any:
    """A joint_states message without joints of grippers, axes and robots beside this one.

    Raises JointNamesError where joints of this one are missing.
    """
    names = list(msg.name)
    if not names or set(names) == set(joint_names):
        return msg
    missing = [name for name in joint_names if name not in names]
    if missing:
        raise JointNamesError(
            f"{', '.join(missing)} missing in joint_states, which has "
            f"{', '.join(name[:40] for name in names[:_SHOWN])}{' ...' * (len(names) > _SHOWN)}"
        )
    places = [k for k, name in enumerate(names) if name in joint_names]
    own = JointState(header=msg.header, name=[names[k] for k in places])
    for field_name in ("position", "velocity"):
        values = getattr(msg, field_name)
        whole = len(values) == len(names)
        setattr(own, field_name, [values[k] for k in places] if whole else values)
    return own


def measured_velocity(msg: Any, joint_names: tuple[str, ...]) -> FloatArray | None:
    """Velocities (n,) rad/s of joint_states, None where they are missing: drivers that measure none
    leave them out or say NaN.
    """
    try:
        return velocity_from_msg(msg, joint_names)
    except InvalidValueError:
        return None


def check_at_rest(
    velocity: FloatArray, joint_names: tuple[str, ...], what: str, code: StatusCode
) -> None:
    """Raise RequestError where a joint is faster than AT_REST: velocity (n,) rad/s."""
    j = int(np.argmax(np.abs(velocity)))
    if abs(velocity[j]) > AT_REST:
        raise RequestError(
            code,
            f"{what}: {joint_names[j]} has a velocity of {velocity[j]:.4g} rad/s, it must be 0 "
            f"rad/s within {AT_REST:g}; movements start and end at rest",
        )


def state_of(msg: Any, cell: Cell, code: StatusCode, at_rest: str = "") -> FloatArray | None:
    """Joint values (n,) rad of a JointState, None where it is empty. Velocities must be finite
    where there are any, and those of a state that `at_rest` names ("start") about 0; efforts are
    not looked at. Raises RequestError for joints that are not the robot's.
    """
    if not configuration_given(msg) and not msg.velocity:
        return None
    names = cell.robot.joint_names
    try:
        q = configuration_from_msg(msg, names)
        velocity = velocity_from_msg(msg, names)
    except InvalidValueError as error:
        raise RequestError(code, str(error)) from error
    j = int(np.argmax(np.abs(q)))
    if abs(q[j]) > POSITION_MAX:
        raise RequestError(
            code,
            f"{names[j]} is {q[j]:g} rad: no joint turns that far, it must be within "
            f"{POSITION_MAX:g} rad",
        )
    if at_rest and velocity is not None:
        check_at_rest(velocity, names, at_rest, code)
    return q


def states_of(messages: Sequence[Any], cell: Cell) -> FloatArray:
    """Joint values (N, n) rad of at most STATES_MAX states; RequestError names the first bad
    one.
    """
    code = StatusCode.INVALID_ROBOT_STATE
    if len(messages) > STATES_MAX:
        raise RequestError(code, f"states has {len(messages)} states: it must be 1 to {STATES_MAX}")
    states = np.empty((len(messages), cell.robot.n))
    for k, message in enumerate(messages):
        try:
            q = state_of(message, cell, code)
        except RequestError as error:
            raise RequestError(code, f"states[{k}]: {error}") from error
        if q is None:
            raise RequestError(code, f"states[{k}] is empty: give the joint values")
        states[k] = q
    return states


def foot_frame(cell: Cell) -> str:
    """The frame of the robot's foot that stands: base_link, on a rail that of the rail."""
    return BASE_FRAME if cell.robot.rail is None else RAIL_LINK


def pose_of(msg: Any, cell: Cell) -> FloatArray | None:
    """Pose (4, 4) in the cell of a PoseStamped in the frame "cell" or that of the robot's foot,
    None where it is not given.
    """
    if not stamped_pose_given(msg):
        return None
    return stamped_pose_from_msg(msg, {foot_frame(cell): cell.base_pose})


def goal_of(request: Any, cell: Cell) -> Goal:
    """Goal of a request in exactly one of its forms: not every request has a goal_state."""
    forms = tuple(name for name in ("goal", "goal_state", "goal_pose") if hasattr(request, name))
    configuration = None
    if "goal_state" in forms:
        at_rest = "" if hasattr(request, "goal_acceleration") else "goal_state"
        configuration = state_of(request.goal_state, cell, StatusCode.GOAL_STATE_INVALID, at_rest)
    return one_goal(request.goal, configuration, pose_of(request.goal_pose, cell), cell, forms)


EndMotion = tuple[FloatArray | None, FloatArray | None]
"""Velocities and accelerations (n,) at an end of a movement; None, None: it rests there."""


def start_motion_of(request: Any, cell: Cell) -> EndMotion:
    """The motion with which a regional movement starts. A state as it was measured, at most AT_REST
    and without accelerations, stands. Raises RequestError.
    """
    return _end_motion(request.start, request.start_acceleration, "start", cell)


def goal_motion_of(request: Any, cell: Cell) -> EndMotion:
    """The motion with which it ends, in the same way."""
    return _end_motion(request.goal_state, request.goal_acceleration, "goal", cell)


def _end_motion(msg: Any, acceleration: Sequence[float], what: str, cell: Cell) -> EndMotion:
    """Velocity [rad/s] and acceleration [rad/s^2] (n,) at an end of a movement in the robot's
    order, None each where it rests. RequestError where they don't fit.
    """
    start = what == "start"
    code = StatusCode.START_STATE_INVALID if start else StatusCode.GOAL_STATE_INVALID
    field_name = "start" if start else "goal_state"
    names = cell.robot.joint_names
    if not configuration_given(msg):
        if len(acceleration):
            raise RequestError(
                code, f"{what}_acceleration is given without {field_name}: give its joint values"
            )
        return None, None
    try:
        configuration_from_msg(msg, names)  # its names are looked at first
        velocity = velocity_from_msg(msg, names)
    except InvalidValueError as error:
        raise RequestError(code, str(error)) from error
    if not len(acceleration):
        moves = velocity is not None and bool(np.abs(velocity).max() > AT_REST)
        return (velocity, None) if moves else (None, None)
    given = tuple(msg.name) or names
    if len(acceleration) != len(given):
        raise RequestError(
            code, f"{what}_acceleration has {len(acceleration)} values: it must have {len(given)}"
        )
    in_order = np.array([acceleration[given.index(name)] for name in names], dtype=np.float64)
    return velocity, in_order


def joined_motion(request: Any, planner: Planner) -> MotionSamples | None:
    """Where and in which motion (1, n) a regional movement leaves the trajectory that is driven;
    None where it joins none. Raises RequestError.
    """
    if not request.joins:
        if request.at != 0.0:
            raise RequestError(
                StatusCode.START_STATE_INVALID,
                f"at is {request.at:g} s without joins: give the trajectory that it is a time of",
            )
        return None
    if configuration_given(request.start) or len(request.start_acceleration):
        raise RequestError(
            StatusCode.START_STATE_INVALID,
            "start and joins are given: give one of them, the trajectory has its own motion",
        )
    return motion_on(planner.trajectories.get(request.joins), request.at, planner.cell)


def options_of(msg: Any, draw_seed: Any) -> PlanOptions:
    """Options of a request; a random seed is drawn here, once, and echoed in the answer."""
    options = plan_options_from_msg(msg)
    if options.random_seed:
        values = {name: getattr(options, name) for name in options.__dataclass_fields__}
        return PlanOptions(**{**values, "seed": int(draw_seed()), "random_seed": False})
    return options


def trajectory_of(request: Any, planner: Planner) -> JointTrajectory:
    """Trajectory of a request: by id or by its points. Raises RequestError for both, neither, or
    points that make no sense.
    """
    given = trajectory_given(request.trajectory)
    if bool(request.trajectory_id) == given:
        which = "both are" if given else "neither is"
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"exactly one of trajectory_id and trajectory must be given, {which}",
        )
    if not given:
        return planner.trajectories.get(request.trajectory_id)
    try:
        return trajectory_from_msg(request.trajectory, planner.cell.robot.joint_names)
    except InvalidValueError as error:
        raise RequestError(StatusCode.INVALID_MOTION_PLAN, str(error)) from error


def reference_of(msg: Any, cell: Cell) -> Reference:
    """Points to pass; where all times are zero they are missing. Raises RequestError for points
    that make no sense.
    """
    if len(msg.points) > POINTS_MAX:
        raise RequestError(
            StatusCode.INVALID_MOTION_PLAN,
            f"the reference has {len(msg.points)} points: at most {POINTS_MAX} are taken",
        )
    timed = any(p.time_from_start.sec or p.time_from_start.nanosec for p in msg.points)
    if not timed:
        for k, point in enumerate(msg.points):
            point.time_from_start.sec = k
    try:
        trajectory = trajectory_from_msg(msg, cell.robot.joint_names)
    except InvalidValueError as error:
        raise RequestError(StatusCode.INVALID_MOTION_PLAN, str(error)) from error
    return Reference(trajectory.positions, trajectory.times if timed else None)


# The path of a request as a value: its poses in the frame that it names.

_CODE = StatusCode.INVALID_GOAL_CONSTRAINTS
_FIELDS = (
    "tool_speed",
    "rotation_speed",
    "speed_tolerance",
    "blending_radius",
    "orientation",
    "free_angle",
    "approach",
    "retract",
)


def path_of(request: Any, cell: Cell) -> CartesianPath | CellPath:
    """The path of a request, by name or by its poses: settings of a named one are those of the cell
    file, but for those that the request changes from their defaults. Raises RequestError,
    PoseError.
    """
    given = stamped_pose_given(request.start_pose) or bool(request.segments)
    if bool(request.path) == given:
        which = "both are" if given else "neither is"
        raise RequestError(
            _CODE, f"exactly one of path and start_pose with segments must be given, {which}"
        )
    if request.path:
        own = cell.own_path(request.path)
        changed = {name: getattr(request, name) for name in _FIELDS if _has_changed(request, name)}
        return replace(own, path=replace(own.path, **changed))
    foot = foot_frame(cell)
    start = stamped_pose_from_msg(request.start_pose, {foot: cell.base_pose})
    frame = cell.base_pose if request.start_pose.header.frame_id == foot else np.eye(4)
    total = sum(len(segment.poses) for segment in request.segments)
    if total > POSES_MAX:
        raise RequestError(_CODE, f"segments have {total} poses: at most {POSES_MAX} are taken")
    segments = tuple(_segment(one, frame, k) for k, one in enumerate(request.segments))
    return CartesianPath(start, segments, **{name: getattr(request, name) for name in _FIELDS})


def _has_changed(request: Any, name: str) -> bool:
    return bool(getattr(request, name) != CartesianPath.__dataclass_fields__[name].default)


def _segment(msg: Any, frame: FloatArray, k: int) -> CartesianSegment:
    poses = []
    for i, pose in enumerate(msg.poses):
        try:
            poses.append(portable.matmul(frame, pose_from_msg(pose)))
        except PoseError as error:
            raise PoseError(f"segments[{k}].poses[{i}]: {error}", error.code) from error
    try:
        return CartesianSegment(msg.kind, tuple(poses), msg.tool_speed, msg.rotation_speed)
    except InvalidValueError as error:
        raise RequestError(_CODE, f"segments[{k}]: {error}") from error
