"""MoveIt's services and actions in front of the planner: the node `ir_moveit`.

It plans nothing itself. What MoveIt's messages ask becomes a request to `ir_planner`; its answers
become theirs, with the planner's report, joules and sentence on topics of their own. It needs
moveit_msgs, which this project does not ship (docs/ros_interfaces.md).
"""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from rclpy.action import CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Header, UInt64

from ir_description import Cell, cell_from_yaml, cell_to_yaml
from ir_kernels.chain import Chain
from ir_kernels.inverse_kinematics import inverse_kinematics
from ir_msgs.msg import Status as StatusMsg
from ir_msgs.msg import TrajectoryReport
from ir_msgs.srv import CheckState, GetCell, SetCell
from ir_msgs_py import names
from ir_msgs_py.names import own
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.conversions import (
    configuration_from_msg,
    configuration_given,
    configuration_to_msg,
    point_from_msg,
    recovery_from_msg,
    status_from_msg,
    status_to_msg,
)
from ir_msgs_py.ros.node_process import run_node
from ir_msgs_py.ros.parameters import Parameters
from ir_msgs_py.ros.serving import ANY, BoundedService, RecordedActionServer, unexpected
from ir_msgs_py.ros.spinning import Cancellation
from ir_msgs_py.ros.topics import ACTION_SERVICES, BURST, LATCHED, LatestMessage
from ir_msgs_py.status import Status, StatusCode
from ir_planner.errors import PlannerError, RequestError
from ir_planner.node.goal_queue import GoalQueue
from ir_planner.node.inputs import LastState, has_joints, measured_velocity, of_joints
from ir_planner.node.moveit_actions import (
    EXECUTE,
    MOVE,
    AcceptedGoals,
    MoveAction,
    TrajectoryExecution,
    other_controller,
)
from ir_planner.node.moveit_monitor import SceneMonitor
from ir_planner.node.moveit_requests import (
    PIPELINE,
    MoveItSettings,
    check_free,
    check_group,
    check_near,
    ik_pose,
    ik_request,
    largest_jump,
    movement,
    path_request,
    robot_state,
)
from ir_planner.node.moveit_scene import applied, refusal
from ir_planner.node.requests import known_status
from ir_planner.search import not_installed, registered
from ir_values.arrays import FloatArray
from ir_values.errors import (
    CallTimedOutError,
    InvalidValueError,
    IrError,
    ServiceUnavailableError,
)

_THREADS = 8  # long and quick requests, scenes, topics, two goals, cancelling, a spare
_CLIENT_PERIOD = 0.2  # s between two looks whether the clients of goals are there
_GOALS_WAITING = 100  # of an action; beyond, a client is in a loop
_PATIENCE = 10.0  # s for an answer beside the planning time
_PAIRS = 20  # of a state that are looked at
_ROBOT_LINK, _WORLD_OBJECT, _ATTACHED = range(3)  # of moveit_msgs/ContactInformation


class PlannerAnswers:
    """MoveIt's requests answered by the planner; messages are read and written by their fields.

    ask: calls a service of the planner: name, request, timeout [s], and what may cancel it;
    CallGivenUpError ends it then. state: the joints (n,) where the robot is, for these names.
    report: takes the planner's report of a movement, its start state and its trajectory. contact:
    makes a ContactInformation.
    """

    def __init__(
        self,
        ask: Callable[..., Any],
        state: Callable[[tuple[str, ...]], FloatArray],
        report: Callable[[TrajectoryReport, Any, Any], None],
        contact: Callable[[], Any],
        settings: Callable[[], MoveItSettings],
    ) -> None:
        self._ask = ask
        self._state = state
        self._report = report
        self._contact = contact
        self._settings = settings
        self._objects: frozenset[str] = frozenset()
        self._read: tuple[str, Cell] | None = None

    def cell(self) -> Cell:
        """The planner's cell as it stands; read anew only where it has changed."""
        answer = self._ask(names.GET_CELL, GetCell.Request(), _PATIENCE)
        _check(answer)
        if self._read is None or self._read[0] != answer.cell_yaml:
            self._read = answer.cell_yaml, cell_from_yaml(answer.cell_yaml)
        return self._read[1]

    def check_start(self, state: Any) -> None:
        """Refuse to execute from a moveit_msgs/RobotState that is given and is not the robot's."""
        cell = self.cell()
        code = StatusCode.START_STATE_INVALID
        given = robot_state(state, cell, "start_state", code)
        if configuration_given(given):
            joints = cell.robot.joint_names
            q = self._joints(given, cell, code)
            check_near(q, self._state(joints), joints, "start_state", code)

    def check_begin(self, trajectory: Any) -> None:
        """Refuse to execute a trajectory with points that does not begin where the robot is."""
        joints = self.cell().robot.joint_names
        first = JointState(name=trajectory.joint_names, position=trajectory.points[0].positions)
        try:
            q = configuration_from_msg(first, joints)
        except InvalidValueError:
            return  # the controller says what is wrong with its joints
        code = StatusCode.INVALID_MOTION_PLAN
        check_near(q, self._state(joints), joints, "the first point", code)

    def plan(self, request: Any, response: Any, canceled: Cancellation | None = None) -> Status:
        """GetMotionPlan."""
        given = request.motion_plan_request
        answer = response.motion_plan_response
        settings = self._settings()
        cell = self.cell()
        asked = movement(given, cell, settings.group, settings.safety_distance)
        status = Status(StatusCode.FAILURE)
        for one in asked:
            patience = one.options.planning_time + _PATIENCE
            planned = self._ask(names.PLAN_REGIONAL_MOVEMENT, one, patience, canceled)
            status = status_from_msg(planned.status)
            if status.ok:
                break
        if not status.ok:
            return status
        answer.group_name = given.group_name or settings.group
        answer.trajectory.joint_trajectory = planned.trajectory
        answer.trajectory_start.joint_state = _first(planned.trajectory)
        answer.planning_time = planned.info.planning_time
        self._report(planned.report, answer.trajectory_start, answer.trajectory)
        attempts = given.num_planning_attempts
        note = f"; {attempts} attempts were asked for, one answer is the best" * (attempts > 1)
        return Status.success(f"{said(planned.report)}{note}")

    def position_ik(self, request: Any, response: Any) -> Status:
        """GetPositionIK."""
        given = request.ik_request
        settings = self._settings()
        cell = self.cell()
        if not given.avoid_collisions:
            q = self._nearest(ik_pose(given, cell, settings.group), given, cell)
            response.solution.joint_state = configuration_to_msg(cell.robot.joint_names, q)
            return Status.success("collisions were not looked at, as asked for")
        asked = ik_request(given, cell, settings.group, settings.safety_distance)
        found = self._ask(names.COMPUTE_IK, asked, _PATIENCE)
        status = status_from_msg(found.status)
        if status.ok:
            response.solution.joint_state = found.solutions[0].state
        return status

    def _nearest(self, pose: FloatArray, given: Any, cell: Cell) -> FloatArray:
        """Of all configurations at a pose the one nearest to the state of the request."""
        robot = cell.robot
        chain = Chain(robot, cell.base_pose, cell.tcp)
        solver = inverse_kinematics(chain, robot.position_min, robot.position_max)
        found = solver.solve(pose[None]).q
        if not len(found):
            x, y, z = pose[:3, 3]
            raise RequestError(
                StatusCode.NO_IK_SOLUTION,
                f"the tcp can't be brought to ({x:.3f}, {y:.3f}, {z:.3f}) m in this orientation "
                "within the joint limits",
            )
        code = StatusCode.INVALID_ROBOT_STATE
        seed = robot_state(given.robot_state, cell, "robot_state", code)
        near = self._joints(seed, cell, code)
        best: FloatArray = found[int(np.argmin(np.abs(found - near).max(axis=1)))]
        return best

    def _joints(self, state: Any, cell: Cell, code: StatusCode) -> FloatArray:
        """Joint values (n,) of a JointState; an empty one: where the robot is."""
        if not configuration_given(state):
            return self._state(cell.robot.joint_names)
        try:
            return configuration_from_msg(state, cell.robot.joint_names)
        except InvalidValueError as error:
            raise RequestError(code, str(error)) from error

    def state_validity(self, request: Any, response: Any) -> Status:
        """GetStateValidity: valid is what keeps the safety distance; pairs that don't as
        contacts.
        """
        response.valid = False
        settings = self._settings()
        check_group(request.group_name, settings.group)
        check_free(request.constraints, "constraints")
        cell = self.cell()
        state = robot_state(
            request.robot_state, cell, "robot_state", StatusCode.INVALID_ROBOT_STATE
        )
        asked = CheckState.Request(
            state=state, safety_distance=settings.safety_distance, max_pairs=_PAIRS
        )
        found = self._ask(names.CHECK_STATE, asked, _PATIENCE)
        response.valid = bool(found.valid)
        held = {capsule.name for load in cell.loads() for capsule in load.capsules}
        robot = {capsule.name for capsule in cell.robot.capsules}
        for pair in found.pairs:
            if pair.distance <= settings.safety_distance and not pair.allowed_contact:
                response.contacts.append(self._contact_of(pair, robot, held))
        return status_from_msg(found.status)

    def _contact_of(self, pair: Any, robot: set[str], held: set[str]) -> Any:
        msg = self._contact()
        a = point_from_msg(pair.point_a)
        b = point_from_msg(pair.point_b)
        msg.header.frame_id = names.WORLD_FRAME
        middle = 0.5 * (a + b)
        msg.position.x, msg.position.y, msg.position.z = middle.tolist()
        away = (b - a) * np.sign(pair.distance)
        length = float(np.linalg.norm(away))
        if length > 0.0:
            msg.normal.x, msg.normal.y, msg.normal.z = (away / length).tolist()
        msg.depth = -float(pair.distance)  # below 0: still so far apart
        msg.contact_body_1 = pair.body_a
        msg.contact_body_2 = pair.body_b
        msg.body_type_1 = _body_type(pair.body_a, robot, held)
        msg.body_type_2 = _body_type(pair.body_b, robot, held)
        return msg

    def cartesian_path(self, request: Any, response: Any) -> Status:
        """GetCartesianPath: the whole of it, fraction 1, or nothing, fraction 0."""
        response.fraction = 0.0
        settings = self._settings()
        cell = self.cell()
        code = StatusCode.START_STATE_INVALID
        q = self._joints(robot_state(request.start_state, cell, "start_state", code), cell, code)
        start = configuration_to_msg(cell.robot.joint_names, q)
        asked = path_request(
            request,
            cell,
            settings.group,
            start=start,
            tcp=Chain(cell.robot, cell.base_pose, cell.tcp).tcp_poses(q[None])[0],
            tool_speed=settings.tool_speed,
            safety_distance=settings.safety_distance,
        )
        planned = self._ask(
            names.PLAN_CARTESIAN_MOVEMENT, asked, asked.options.planning_time + _PATIENCE
        )
        status = status_from_msg(planned.status)
        if not status.ok:
            return status
        jump = largest_jump(planned.trajectory.points)
        if 0.0 < request.revolute_jump_threshold < jump:
            raise refusal(
                f"a joint turns by {jump:.3g} rad between two points",
                f"revolute_jump_threshold is {request.revolute_jump_threshold:g} rad",
                StatusCode.PLANNING_FAILED,
            )
        response.start_state.joint_state = start
        response.solution.joint_trajectory = planned.trajectory
        response.fraction = 1.0
        self._report(planned.report, response.start_state, response.solution)
        note = "; it is free of collisions although avoid_collisions is false"
        return Status.success(f"{said(planned.report)}{note * (not request.avoid_collisions)}")

    def apply_scene(self, request: Any, response: Any) -> Status:
        """ApplyPlanningScene: all of it, or nothing."""
        response.success = False
        now = applied(request.scene, self.cell(), self._objects)
        answer = self._ask(
            names.SET_CELL, SetCell.Request(cell_yaml=cell_to_yaml(now.cell)), 3.0 * _PATIENCE
        )
        _check(answer)
        self._objects = now.objects
        response.success = True
        colours = "its colours are not shown" if len(request.scene.object_colors) else ""
        objects = f"objects: {', '.join(sorted(now.objects)) or 'none'}"
        return Status.success("; ".join(filter(None, (objects, colours, *now.notes))))


def said(report: TrajectoryReport) -> str:
    """A report in a line."""
    clearance = 1e3 * report.min_clearance
    return f"{report.duration:.2f} s, {report.energy:.0f} J, clearance of {clearance:.0f} mm"


def _first(trajectory: Any) -> Any:
    return JointState(name=trajectory.joint_names, position=trajectory.points[0].positions)


def _body_type(name: str, robot: set[str], held: set[str]) -> int:
    """What moveit_msgs/ContactInformation calls a body."""
    if name in robot:
        return _ROBOT_LINK
    return _ATTACHED if name in held else _WORLD_OBJECT


def _check(answer: Any) -> None:
    status = status_from_msg(answer.status)
    if not status.ok:
        raise RequestError(StatusCode(status.code), status.message)


def put_error_code(response: Any, status: Status) -> None:
    """A status as MoveIt's responses carry it; two of them have no place for it."""
    holder = getattr(response, "motion_plan_response", response)
    code = getattr(holder, "error_code", None)
    if code is not None:
        code.val = int(status.code)
        if hasattr(code, "message"):  # not in those before Iron
            code.message = status.message
            code.source = status.source


def status_of(error: BaseException) -> Status:
    """The status of a request that an error ended."""
    if isinstance(error, ServiceUnavailableError):
        return Status(StatusCode.COMMUNICATION_FAILURE, str(error))
    if isinstance(error, CallTimedOutError):
        return Status(StatusCode.TIMED_OUT, str(error))
    known = known_status(error) if isinstance(error, Exception) else None
    return known or unexpected(error)


SERVICES = {
    "GetMotionPlan": "plan_kinematic_path",
    "GetCartesianPath": "compute_cartesian_path",
    "GetPositionIK": "compute_ik",
    "GetStateValidity": "check_state_validity",
    "ApplyPlanningScene": "apply_planning_scene",
    "GetPlanningScene": "get_planning_scene",
    "QueryPlannerInterfaces": "query_planner_interface",
    "GetPlannerParams": "get_planner_params",
    "SetPlannerParams": "set_planner_params",
}
"""Name of each type of moveit_msgs, as MoveIt's move_group serves it."""
ACTIONS = {"MoveGroup": MOVE, "ExecuteTrajectory": EXECUTE}


def planners(request: Any, response: Any, description: Callable[[], Any]) -> Status:
    """QueryPlannerInterfaces: the searches that can be used."""
    one = description()
    one.name = "certified movements of ir_planner"
    one.pipeline_id = PIPELINE
    one.planner_ids = sorted(
        name for name, search in registered().items() if not not_installed(search)
    )
    response.planner_interfaces = [one]
    return Status.success(f"{len(one.planner_ids)} searches")


def planner_params(request: Any, response: Any) -> Status:
    """GetPlannerParams: none that MoveIt sets."""
    return Status.success("searches have no parameters here: ir_planner has settings")


def set_planner_params(request: Any, response: Any) -> Status:
    """SetPlannerParams: refused, unless it sets nothing."""
    if len(request.params.keys):
        raise refusal(
            f"parameter {', '.join(request.params.keys[:3])}",
            "searches are set by the parameters of ir_planner, under Advanced in its reference",
        )
    return Status.success("nothing was set")


class MoveItNode(Node):
    """Serves MoveIt's services and actions. Raises IrError where moveit_msgs is missing."""

    def __init__(self, **options: Any) -> None:
        types = moveit_types()
        super().__init__(names.MOVEIT, **options)
        parameters = Parameters(self, MoveItSettings)
        self._settings = parameters
        self._client = Client(
            self.get_namespace(),
            context=self.context,
            node_name=names.hidden_node(self.get_name(), "client"),
            timeout=_PATIENCE,
        )
        self._statuses = self.create_publisher(StatusMsg, own(names.MOVEIT_STATUS), LATCHED)
        self._reports = self.create_publisher(TrajectoryReport, own(names.MOVEIT_REPORT), LATCHED)
        self._energies = self.create_publisher(Float64, own(names.MOVEIT_ENERGY), LATCHED)
        self._states = LatestMessage(self, JointState, names.JOINT_STATES, 16)
        self._last = LastState(offered=lambda: self.count_publishers(names.JOINT_STATES) > 0)
        msgs = import_module("moveit_msgs.msg")
        answers = PlannerAnswers(
            self._client.call,
            self._where,
            self._publish_report,
            msgs.ContactInformation,
            lambda: parameters.value,
        )
        plans = MutuallyExclusiveCallbackGroup()
        questions = MutuallyExclusiveCallbackGroup()
        self._executor = TrajectoryExecution(self._drive, answers.check_begin)
        self._actions: list[RecordedActionServer] = []
        self._hear_stops(parameters.value.controller.rpartition("/")[0])
        apply = self._guarded(SERVICES["ApplyPlanningScene"], answers.apply_scene)
        self._monitor = SceneMonitor(
            self,
            msgs,
            parameters.value.group,
            self._where_known,
            apply,
            self._executor.stop,
            MutuallyExclusiveCallbackGroup(),
        )

        def scene(request: Any, response: Any) -> Status:
            wanted = int(request.components.components)
            response.scene = self._monitor.scene(answers.cell(), wanted)
            return Status.success(f"{len(response.scene.world.collision_objects)} objects")

        def offered(request: Any, response: Any) -> Status:
            return planners(request, response, msgs.PlannerInterfaceDescription)

        for kind, handler, group in (
            ("GetMotionPlan", answers.plan, plans),
            ("GetCartesianPath", answers.cartesian_path, plans),
            ("GetPositionIK", answers.position_ik, questions),
            ("GetStateValidity", answers.state_validity, questions),
            ("ApplyPlanningScene", answers.apply_scene, questions),
            ("GetPlanningScene", scene, questions),
            ("QueryPlannerInterfaces", offered, questions),
            ("GetPlannerParams", planner_params, questions),
            ("SetPlannerParams", set_planner_params, questions),
        ):
            name = SERVICES[kind]
            guarded = self._guarded(name, handler)
            BoundedService(self, types[kind], name, guarded, group, put=put_error_code)
        plan_type = types["GetMotionPlan"]
        move = MoveAction(
            answers.plan,
            lambda: (plan_type.Request(), plan_type.Response()),
            answers.check_start,
            self._executor,
        )
        self._actions += [
            self._offer_action("MoveGroup", move.run),
            self._offer_action("ExecuteTrajectory", self._execute),
        ]

    def _hear_stops(self, driver: str) -> None:
        """Of the driver whose controller drives; controllers of others tell of none."""
        group = MutuallyExclusiveCallbackGroup()
        for kind, name in ((UInt64, names.STOP_NUMBER), (Bool, names.STOP_LATCHED)):
            topic = f"{driver}/{name.rpartition('/')[2]}"

            def hear(message: Any, topic: str = topic) -> None:
                for action in self._actions:
                    action.take_waiting(BURST)  # what waits now was sent before the stop
                self._executor.hear(topic, int(message.data))

            self.create_subscription(kind, topic, hear, LATCHED, callback_group=group)

        def hear_recovery(message: Header) -> None:
            self._executor.hear_recovery(recovery_from_msg(message)[1])

        topic = f"{driver}/{names.LAST_RECOVERY.rpartition('/')[2]}"
        self.create_subscription(Header, topic, hear_recovery, LATCHED, callback_group=group)

    def destroy_node(self) -> None:
        """Let go of the planner, then of the rest."""
        self._client.close()
        for action in self._actions:
            action.destroy()
        super().destroy_node()

    def _offer_action(self, kind: str, run: Callable[..., Status]) -> RecordedActionServer:
        """Serve an action of moveit_msgs: its goals are carried out one after the other."""
        action_type = getattr(import_module("moveit_msgs.action"), kind)
        accepted = AcceptedGoals(self._executor)

        def execute(goal: ServerGoalHandle) -> Any:
            stopped = accepted.stopped(goal)

            def feedback(state: str) -> None:
                goal.publish_feedback(action_type.Feedback(state=state))

            def work(request: Any, result: Any) -> Status:
                return run(request, result, stopped, feedback)

            result = self._guarded(ACTIONS[kind], work)(goal.request, action_type.Result())
            feedback("IDLE")
            accepted.end(goal, result.error_code.val)
            return result

        def refuse(goal: ServerGoalHandle) -> Any:
            result = action_type.Result()
            sentence = f"{_GOALS_WAITING} goals of {ACTIONS[kind]} wait already"
            put_error_code(result, Status(StatusCode.FAILURE, sentence, self.get_name()))
            accepted.end(goal, result.error_code.val)
            return result

        goals = GoalQueue(execute, refuse, _GOALS_WAITING)

        timeout = self._settings.value.client_timeout

        def accept(goal: ServerGoalHandle) -> None:
            accepted.add(goal, server.watch(bytes(goal.goal_id.uuid), timeout))
            goals.accepted(goal)

        def look_for_clients() -> None:
            count = accepted.stop_abandoned()
            if count:
                self.get_logger().warning(
                    f"{count} goals of {ACTIONS[kind]} have had no client for {timeout:g} s: "
                    "stopped"
                )

        def cancel(goal: ServerGoalHandle) -> CancelResponse:
            accepted.cancel(goal)
            return goals.cancel(goal)

        server = RecordedActionServer(
            self,
            action_type,
            ACTIONS[kind],
            goals.execute,
            handle_accepted_callback=accept,
            came=accepted.came,
            cancel_callback=cancel,
            callback_group=ReentrantCallbackGroup(),
            **ACTION_SERVICES,
        )
        self.create_timer(
            _CLIENT_PERIOD,
            look_for_clients,
            MutuallyExclusiveCallbackGroup(),
            clock=Clock(clock_type=ClockType.STEADY_TIME),
        )
        return server

    def _execute(
        self, goal: Any, result: Any, stopped: Cancellation, feedback: Callable[[str], None]
    ) -> Status:
        """ExecuteTrajectory."""
        other = other_controller(goal.controller_names, self._settings.value.controller)
        if other is not None:
            return other
        feedback("MONITOR")
        return self._executor.drive(goal.trajectory, stopped)

    def _drive(self, goal: Any, stopped: Cancellation) -> Any:
        return self._client.send_goal(self._settings.value.controller, goal, give_up=stopped)

    def _guarded(self, name: str, handler: Callable[[Any, Any], Status]) -> Callable[..., Any]:
        """A service callback: the status goes into the response, to the topic and to the log."""

        def callback(request: Any, response: Any) -> Any:
            try:
                status = handler(request, response)
            except ANY as error:
                status = status_of(error)
                if status.code == StatusCode.FAILURE and not isinstance(
                    error, (PlannerError, IrError)
                ):
                    self.get_logger().error(traceback.format_exc())
            status = Status(status.code, status.message, self.get_name())
            put_error_code(response, status)
            self._statuses.publish(status_to_msg(status))
            if not status.ok:
                self.get_logger().warning(f"{name}: {status}")
            return response

        return callback

    def _publish_report(self, report: TrajectoryReport, state: Any, trajectory: Any) -> None:
        self._reports.publish(report)
        self._energies.publish(Float64(data=report.energy))
        self._monitor.show_path(state, trajectory)

    def _where_known(self, joints: tuple[str, ...]) -> FloatArray | None:
        """The last joint values (n,) that have come; None where there are none."""
        self._look_for(joints)
        return self._last.q

    def _where(self, joints: tuple[str, ...]) -> FloatArray:
        """Joint values (n,) where the robot is, of the last joint_states."""
        self._look_for(joints)
        return self._last.soon(time.monotonic, self._settings.value.state_max_age)

    def _look_for(self, joints: tuple[str, ...]) -> None:
        """Let joint_states be read for these joints, and read what has come."""

        def look() -> None:
            received = self._states.take(lambda message: has_joints(message, joints))
            if received is None:
                return
            try:
                message = of_joints(received.message, joints)
                q = configuration_from_msg(message, joints)
            except InvalidValueError as error:
                self._last.problem = str(error)
                return
            came = time.monotonic() - received.age
            self._last.take(q, came, measured_velocity(message, joints))

        self._last.look = look
        look()


def moveit_types() -> dict[str, Any]:
    """Types of the services by name. Raises IrError where moveit_msgs is missing."""
    try:
        services = import_module("moveit_msgs.srv")
    except ImportError as error:
        raise IrError(
            "moveit_msgs is not installed: docs/ros_interfaces.md says how it is built"
        ) from error
    return {kind: getattr(services, kind) for kind in SERVICES}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(
        names.MOVEIT,
        MoveItNode,
        arguments,
        executor=lambda: MultiThreadedExecutor(num_threads=_THREADS),
        refusals=(IrError, PlannerError),
        about="Answers MoveIt's services and actions with ir_planner.",
    )


if __name__ == "__main__":
    sys.exit(main())
