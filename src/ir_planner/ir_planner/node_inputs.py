"""What requests say, as values: states, goals, poses, options, trajectories. Nothing here is planned."""

from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Lock
from typing import Any

import numpy as np
from ir_msgs_py.errors import InvalidValueError
from ir_msgs_py.names import BASE_FRAME
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.ros.conversions import (
    configuration_from_msg,
    configuration_given,
    plan_options_from_msg,
    stamped_pose_from_msg,
    stamped_pose_given,
    trajectory_from_msg,
    trajectory_given,
)
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from numpy.typing import NDArray

from ir_description import Cell
from ir_planner.errors import RequestError
from ir_planner.following import POINTS_MAX, Reference
from ir_planner.goals import Goal, one_goal
from ir_planner.planner import Planner

FloatArray = NDArray[np.float64]
MEASURED = 9  # decimals of rad: finer than any encoder, and less than what counts as movement


@dataclass
class LastState:
    """The last joint_states, and when it came [s on the node's clock]; written and read by different
    threads. look: takes what has come since the last look.
    """

    look: Callable[[], None] = lambda: None
    q: FloatArray | None = None
    came: float = 0.0
    problem: str = ""
    _lock: Lock = field(default_factory=Lock)

    def take(self, q: FloatArray, now: float) -> None:
        """A state came. It is kept to MEASURED decimals: a robot that stands is one start, not a new one with
        every measurement, so the same request gives the same trajectory.
        """
        with self._lock:
            self.q, self.came = np.round(q, MEASURED) + 0.0, now  # + 0.0: no negative zeros

    def fresh(self, now: float, max_age: float) -> FloatArray:
        """The state (n,). Raises RequestError when there is none, or an old one."""
        self.look()
        with self._lock:
            q, age = self.q, max(0.0, now - self.came)
        if q is None:
            raise RequestError(
                StatusCode.ROBOT_STATE_STALE, "no joint_states have come yet: give the state in the request"
            )
        if age > max_age:
            raise RequestError(
                StatusCode.ROBOT_STATE_STALE,
                f"the last joint_states came {age:.1f} s ago: it must be at most {max_age:g} s; "
                "give the state in "
                "the request",
            )
        return q


def state_of(msg: Any, cell: Cell, code: StatusCode) -> FloatArray | None:
    """Joint values (n,) rad of a JointState, None where it is empty."""
    if not configuration_given(msg):
        return None
    try:
        return configuration_from_msg(msg, cell.robot.joint_names)
    except InvalidValueError as error:
        raise RequestError(code, str(error)) from error


def pose_of(msg: Any, cell: Cell) -> FloatArray | None:
    """Pose (4, 4) in the cell of a PoseStamped in the frame "cell" or "base_link", None where it is not
    given.
    """
    if not stamped_pose_given(msg):
        return None
    return stamped_pose_from_msg(msg, {BASE_FRAME: cell.base_pose})


def goal_of(request: Any, cell: Cell) -> Goal:
    """Goal of a request in exactly one of its forms: not every request has a goal_state."""
    forms = tuple(name for name in ("goal", "goal_state", "goal_pose") if hasattr(request, name))
    configuration = None
    if "goal_state" in forms:
        configuration = state_of(request.goal_state, cell, StatusCode.GOAL_STATE_INVALID)
    return one_goal(request.goal, configuration, pose_of(request.goal_pose, cell), cell, forms)


def options_of(msg: Any, draw_seed: Any) -> PlanOptions:
    """Options of a request; a random seed is drawn here, once, and echoed in the answer."""
    options = plan_options_from_msg(msg)
    if options.random_seed:
        values = {name: getattr(options, name) for name in options.__dataclass_fields__}
        return PlanOptions(**{**values, "seed": int(draw_seed()), "random_seed": False})
    return options


def trajectory_of(request: Any, planner: Planner) -> JointTrajectory:
    """Trajectory of a request: by id or by its points."""
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
    """Points to pass; where all times are zero they are missing."""
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
