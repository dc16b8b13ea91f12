"""Goals from messages, and values of the driver into messages that the node has made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ir_description import RobotModel
from ir_msgs_py.names import STOPS_STATE
from ir_msgs_py.ros.conversions import (
    duration_to_msg,
    float_array,
    time_from_msg,
    time_to_msg,
    trajectory_from_msg,
)
from ir_msgs_py.ros.diagnostics import Condition
from ir_sim_driver.controller import PartStatus
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.load_check import LoadFinding
from ir_sim_driver.motion import ErrorCode, Following, JointTolerance, TrajectoryGoal
from ir_values.arrays import FloatArray
from ir_values.errors import JointNamesError, TrajectoryError

_NS = 1e-9
_DIGITS = 20
_LABEL_MAX = 64  # four times a trajectory id; a longer one would be published 50 times a second


def goal_from_trajectory(msg: Any, max_points: int) -> TrajectoryGoal:
    """Goal of a trajectory_msgs/JointTrajectory. Raises TrajectoryRefusedError."""
    try:
        trajectory = trajectory_from_msg(msg, max_points=max_points)
    except JointNamesError as error:
        raise TrajectoryRefusedError(ErrorCode.INVALID_JOINTS, str(error)) from error
    except TrajectoryError as error:
        raise TrajectoryRefusedError(ErrorCode.INVALID_GOAL, str(error)) from error
    return TrajectoryGoal(trajectory, time_from_msg(msg.header.stamp))


def goal_from_action(goal: Any, max_points: int) -> TrajectoryGoal:
    """Goal of ExecuteTrajectory or FollowJointTrajectory. Raises TrajectoryRefusedError."""
    multi_dof = goal.multi_dof_trajectory
    if multi_dof.points or multi_dof.joint_names:
        raise TrajectoryRefusedError(
            ErrorCode.INVALID_GOAL,
            f"multi_dof_trajectory has {len(multi_dof.points)} points: it must be empty, the robot "
            "has joints only",
        )
    for name in ("component_path_tolerance", "component_goal_tolerance"):
        if getattr(goal, name, ()):
            raise TrajectoryRefusedError(
                ErrorCode.INVALID_GOAL,
                f"{name} has {len(getattr(goal, name))} entries: it must be empty, they are of "
                "multi_dof_trajectory and the robot has joints only",
            )
    plain = goal_from_trajectory(goal.trajectory, max_points)
    wait = goal.goal_time_tolerance
    states, after_stop = _states(goal)
    return TrajectoryGoal(
        plain.trajectory,
        plain.stamp_ns,
        _tolerances(goal.path_tolerance),
        _tolerances(goal.goal_tolerance),
        wait.sec + wait.nanosec * _NS,
        label=_label(str(getattr(goal, "trajectory_id", ""))),
        cell_hash=str(getattr(goal, "cell_hash", "")),
        load=str(getattr(goal, "load", "")),
        station=str(getattr(goal, "station", "")),
        states=states,
        after_stop=after_stop,
        allow_collision=bool(getattr(goal, "allow_collision", False)),
    )


def _states(goal: Any) -> tuple[tuple[str, ...], int | None]:
    """States of machines that a goal relies on, and the last stop that its sender knows."""
    machines = []
    after_stop = None
    for state in map(str, getattr(goal, "states", ())):
        name, _, value = state.partition("=")
        if name != STOPS_STATE:
            machines.append(state)
            continue
        if not (value.isascii() and value.isdigit() and len(value) < _DIGITS):
            raise TrajectoryRefusedError(
                ErrorCode.INVALID_GOAL,
                f"{STOPS_STATE} is {value[:24]!a}: it must be below 1e{_DIGITS - 1}",
            )
        if after_stop not in (None, int(value)):
            raise TrajectoryRefusedError(
                ErrorCode.INVALID_GOAL,
                f"{STOPS_STATE} is {after_stop} and {int(value)}: a goal knows one last stop",
            )
        after_stop = int(value)
    return tuple(machines), after_stop


def _label(text: str) -> str:
    """A name as states and diagnostics carry it: printable, at most _LABEL_MAX characters."""
    return "".join(c if c.isprintable() else "?" for c in text[:_LABEL_MAX])


def hardware_id(robot: RobotModel) -> str:
    """The robot as /diagnostics names it."""
    return f"{robot.title or robot.name}, simulated"


def condition_of(entry: PartStatus, hardware: str) -> Condition:
    """A part of the driver for /diagnostics; hardware: see `hardware_id`."""
    return Condition(entry.name, entry.level, entry.sentence, entry.values, hardware)


def fill_joint_state(
    msg: Any, stamp_ns: int, q: FloatArray, qd: FloatArray, torque: FloatArray
) -> None:
    """Write a state, each (n,), into a message that is used again and again."""
    msg.header.stamp.sec, msg.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
    msg.position = float_array(q)
    msg.velocity = float_array(qd)
    msg.effort = float_array(torque)


def fill_controller_state(
    msg: Any, names: Sequence[str], stamp_ns: int, following: Following
) -> None:
    """Command, robot and their difference, into a ControllerState."""
    msg.header.stamp = time_to_msg(stamp_ns)
    msg.joint_names = list(names)
    fill_points(msg.reference, msg.feedback, msg.error, following)
    msg.trajectory_id = following.label
    msg.path_time = following.path_time
    msg.speed_scaling = following.path_speed
    msg.tool_deviation = following.deviation


def fill_load_check(msg: Any, stamp_ns: int, finding: LoadFinding) -> None:
    """What a movement's torques say of the load, into a LoadCheck."""
    msg.header.stamp = time_to_msg(stamp_ns)
    msg.trajectory_id = finding.trajectory_id
    msg.load = finding.load
    msg.noticed = finding.noticed
    msg.joint = finding.joint
    msg.expected = finding.expected
    msg.found = finding.found
    msg.deviation = finding.deviation
    msg.mass = finding.mass
    msg.sentence = finding.sentence


def fill_points(desired: Any, actual: Any, error: Any, following: Following) -> None:
    """Command, robot and their difference, into three JointTrajectoryPoints."""
    command = following.command
    at = duration_to_msg(max(0, round(following.path_time / _NS)))
    desired.time_from_start = at
    actual.time_from_start = at
    error.time_from_start = at
    desired.positions = float_array(command.q)
    desired.velocities = float_array(command.qd)
    desired.accelerations = float_array(command.qdd)
    actual.positions = float_array(following.q)
    actual.velocities = float_array(following.qd)
    error.positions = float_array(command.q - following.q)
    error.velocities = float_array(command.qd - following.qd)


def _tolerances(given: Sequence[Any]) -> tuple[JointTolerance, ...]:
    return tuple(JointTolerance(str(t.name), t.position, t.velocity, t.acceleration) for t in given)
