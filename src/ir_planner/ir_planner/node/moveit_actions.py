"""MoveIt's actions: MoveGroup plans and executes, ExecuteTrajectory executes; what drives is a
trajectory controller.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import import_module
from threading import Lock
from time import monotonic, sleep
from typing import Any
from weakref import WeakKeyDictionary

from ir_msgs_py.ros.goal_clients import Gone
from ir_msgs_py.ros.serving import TakenGoals
from ir_msgs_py.ros.spinning import Cancellation
from ir_msgs_py.status import Status, StatusCode
from ir_planner.node.moveit_scene import refusal
from ir_values.errors import CallGivenUpError, IrError, shown

MOVE = "move_action"
EXECUTE = "execute_trajectory"
STOP = "stop"
_MOMENT = 1e-3  # s between two looks
_PATIENCE = 5.0  # s that rclpy may take from a cancel's callback to the goal's state
_SUCCESSFUL = 0  # of control_msgs/FollowJointTrajectory
_REFUSED = (-1, -2, -3)  # there: the goal, its joints, its stamp
_CONTROL_FAILED = -4  # of moveit_msgs/MoveItErrorCodes
Feedback = Callable[[str], None]


def follow_goal() -> Any:
    """The class of a controller's goals. Raises IrError where control_msgs is missing."""
    try:
        return import_module("control_msgs.action").FollowJointTrajectory.Goal
    except ImportError as error:
        raise IrError(
            "control_msgs is not installed, so nothing can be executed: docs/ros_interfaces.md "
            "says how it is built"
        ) from error


class TrajectoryExecution:
    """Lets the controller drive a trajectory.

    send: sends a goal and waits for its result, and cancels it when the second argument is.
    check_begin: refuses a trajectory that does not begin where the robot is.

    A controller's goals can't name the driver's stop that their sender knows, so what is heard of
    stops cancels here all that was accepted before, whether it waits, is planned or is driven.
    """

    def __init__(
        self, send: Callable[[Any, Cancellation], Any], check_begin: Callable[[Any], None]
    ) -> None:
        self._send = send
        self._check_begin = check_begin
        self._lock = Lock()
        self._accepted: WeakKeyDictionary[Cancellation, int] = WeakKeyDictionary()
        self._heard: dict[str, int] = {}
        self._recovered = 0

    def stop(self) -> None:
        """Stop what is driven now, along its path, and drive nothing that was accepted before."""
        with self._lock:
            accepted = list(self._accepted)
        for each in accepted:
            each.cancel()

    def hear(self, topic: str, value: int) -> None:
        """A topic of the driver that tells a stop or a recovery by another value."""
        if self._heard.setdefault(topic, value) != value:
            self._heard[topic] = value
            self.stop()

    def hear_recovery(self, recovered: int) -> None:
        """The driver tells when its last stop was recovered [ns of the system's clock]; 0: there
        was none.
        """
        with self._lock:
            self._recovered = recovered
            late = [each for each, sent in self._accepted.items() if sent < recovered]
        for each in late:
            each.cancel()

    def accept(self, sent: int = 0) -> Cancellation:
        """What cancels a goal that is accepted now: its client, or a stop of all. One that was sent
        [ns of the system's clock; 0: not known] before the last recovery is canceled already.
        """
        accepted = Cancellation()
        with self._lock:
            late = 0 < sent < self._recovered
            self._accepted[accepted] = sent
        if late:
            accepted.cancel()
        return accepted

    def drive(self, trajectory: Any, stopped: Cancellation) -> Status:
        """Drive a moveit_msgs/RobotTrajectory to its end."""
        if trajectory.multi_dof_joint_trajectory.points:
            raise refusal(
                "multi_dof_joint_trajectory",
                "the robot has joints only",
                StatusCode.INVALID_MOTION_PLAN,
            )
        if not trajectory.joint_trajectory.points:
            return Status.success("a trajectory without points: nothing was driven")
        self._check_begin(trajectory.joint_trajectory)
        if stopped.canceled:
            return Status(StatusCode.PREEMPTED, "stopped before it was driven")
        result = self._send(follow_goal()(trajectory=trajectory.joint_trajectory), stopped)
        if stopped.canceled:
            said = f": {result.error_string}" if result.error_string else ""
            return Status(StatusCode.PREEMPTED, f"stopped along the path{said}")
        if result.error_code != _SUCCESSFUL:
            refused = int(result.error_code) in _REFUSED
            code = StatusCode.INVALID_MOTION_PLAN if refused else _CONTROL_FAILED
            return Status(code, f"the controller says: {result.error_string}")
        return Status.success("driven to the end")


@dataclass(eq=False)
class _Accepted:
    """What cancels a goal, and whether its client has, or has gone."""

    stopped: Cancellation
    gone: Gone
    by_client: bool = False


class AcceptedGoals:
    """Goals of an action server of rclpy from when they are accepted until they end: canceled by
    their clients or because these have gone, or all by a stop. A goal's handle has no hash: its id
    tells it from others.
    """

    def __init__(self, executor: TrajectoryExecution) -> None:
        self._executor = executor
        self._taken = TakenGoals[Cancellation]()
        self._goals: dict[bytes, _Accepted] = {}

    def came(self, goal_id: bytes, sent: int) -> None:
        """A goal that was sent then [ns] is taken from the middleware: a stop that is heard from
        now on ends it.
        """
        self._taken.note(goal_id, self._executor.accept(sent))

    def add(self, goal: Any, gone: Gone = lambda: False) -> None:
        """A goal is accepted; gone: whether its client has gone."""
        key = bytes(goal.goal_id.uuid)
        stopped = self._taken.pop(key, None)
        self._goals[key] = _Accepted(self._executor.accept() if stopped is None else stopped, gone)

    def stop_abandoned(self) -> int:
        """Stop the goals whose clients have gone, those that wait too; how many there are now."""
        count = 0
        for each in tuple(self._goals.values()):
            if not each.stopped.canceled and each.gone():
                each.stopped.cancel()
                count += 1
        return count

    def stopped(self, goal: Any) -> Cancellation:
        """What cancels it."""
        return self._goals[bytes(goal.goal_id.uuid)].stopped

    def cancel(self, goal: Any) -> None:
        """Its client cancels it; where it has ended nothing is left to do."""
        one = self._goals.get(bytes(goal.goal_id.uuid))
        if one is not None:
            one.by_client = True
            one.stopped.cancel()

    def end(self, goal: Any, code: int) -> None:
        """End it as MoveIt does: succeeded, canceled where its client asked for it, aborted."""
        one = self._goals.pop(bytes(goal.goal_id.uuid))
        if code == StatusCode.SUCCESS:
            goal.succeed()
        elif one.by_client and _is_canceling(goal):
            goal.canceled()
        else:
            goal.abort()


def _is_canceling(goal: Any) -> bool:
    """Whether rclpy lets a goal end as canceled: it says so just after the cancel's callback, and
    never where that failed.
    """
    until = monotonic() + _PATIENCE
    while not goal.is_cancel_requested:
        if monotonic() >= until:
            return False
        sleep(_MOMENT)
    return True


@dataclass(frozen=True)
class MoveAction:
    """The action MoveGroup. plan: GetMotionPlan, from its request and response, and what cancels
    it, to a status; new: the two, empty. check_start: refuses a state that is given and is
    not the robot's.
    """

    plan: Callable[[Any, Any, Cancellation], Status]
    new: Callable[[], tuple[Any, Any]]
    check_start: Callable[[Any], None]
    executor: TrajectoryExecution

    def run(self, goal: Any, result: Any, stopped: Cancellation, feedback: Feedback) -> Status:
        """Plan, and where it is asked for, execute from where the robot is."""
        options = goal.planning_options
        _check_diff(options.planning_scene_diff)
        request, response = self.new()
        request.motion_plan_request = goal.request
        if not options.plan_only:  # as in MoveIt: what is driven begins where the robot is
            self.check_start(goal.request.start_state)
            request.motion_plan_request.start_state = type(goal.request.start_state)(is_diff=True)
        feedback("PLANNING")
        try:
            status = self.plan(request, response, stopped)
        except CallGivenUpError:
            return Status(StatusCode.PREEMPTED, "stopped while it was planned")
        planned = response.motion_plan_response
        result.trajectory_start = planned.trajectory_start
        result.planned_trajectory = planned.trajectory
        result.planning_time = planned.planning_time
        if options.plan_only or not status.ok:
            return status
        feedback("MONITOR")
        driven = self.executor.drive(planned.trajectory, stopped)
        if not driven.ok:
            return driven
        result.executed_trajectory = planned.trajectory
        notes = [
            f"{name} is not done, the plan is certified for the cell as it is"
            for name in ("replan", "look_around")
            if getattr(options, name)
        ]
        return Status.success("; ".join((status.message, driven.message, *notes)))


def _check_diff(scene: Any) -> None:
    """Refuse a scene that counts for one request only."""
    state = scene.robot_state
    given = {
        "name": scene.name,
        "robot_state": state.joint_state.name or state.attached_collision_objects,
        "allowed_collision_matrix": scene.allowed_collision_matrix.entry_names,
        "world": scene.world.collision_objects or scene.world.octomap.octomap.data,
        "link_padding": scene.link_padding,
        "link_scale": scene.link_scale,
    }
    for name, value in given.items():
        if len(value):
            raise refusal(
                f"{name} of planning_scene_diff", "apply_planning_scene takes scenes, for all plans"
            )


def other_controller(names: Iterable[str], controller: str) -> Status | None:
    """The refusal of a goal for other controllers than the one that drives, None for this one."""
    own = {"", controller, controller.rpartition("/")[0]}
    for name in names:
        if name.strip("/") not in own:
            sentence = f"controller {shown(name)}: {controller} drives here"
            return Status(_CONTROL_FAILED, sentence)
    return None
