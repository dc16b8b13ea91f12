"""`Client`: a script's door to the cell, without a node to write.

    with Client() as cell:
        cell.set_cell("demo")
        program = cell.plan_program()
        cell.run_program(program.program_id, progress=lambda at: ...)

It has a context of its own and spins in the background; goals are sent from the spinning thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import rclpy
from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient, get_action_names_and_types
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.task import Future

from ir_msgs.action import ExecuteTrajectory, Plan, RunProgram
from ir_msgs.srv import (
    GetTrajectory,
    OptimizeTrajectory,
    PlanEscape,
    PlanRegionalMovement,
    SetCell,
)
from ir_msgs_py import names
from ir_msgs_py.options import AS_THE_CELL_SAYS, PlanOptions
from ir_msgs_py.report import PlannedMovement, PlanningInfo, TrajectoryReport
from ir_msgs_py.ros.conversions import (
    status_from_msg,
    trajectory_from_msg,
    trajectory_given,
    trajectory_to_msg,
)
from ir_msgs_py.ros.goal_clients import cancel_unanswered, new_goal_id
from ir_msgs_py.ros.messages import owner_of, type_name
from ir_msgs_py.ros.network import apply_network
from ir_msgs_py.ros.plan_conversions import (
    plan_options_to_msg,
    planned_movement_from_msg,
    planned_movement_to_msg,
    planning_info_from_msg,
    program_point_from_msg,
    program_savings_from_msg,
    report_from_msg,
)
from ir_msgs_py.ros.search_conversions import searches_from_msg
from ir_msgs_py.ros.spinning import BackgroundExecutor, Cancellation
from ir_msgs_py.ros.topics import ACTION_SERVICES, LATCHED, SERVICE
from ir_msgs_py.savings import ProgramPoint, ProgramSavings
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_values.arrays import FloatArray
from ir_values.errors import (
    CallGivenUpError,
    CallTimedOutError,
    RequestRefusedError,
    ServiceUnavailableError,
)

_DEPTH = 100
_OWN = "ir_msgs/"


class Graph:
    """The graph as one node sees it; it fills up within moments after the node has started."""

    def __init__(self, node: Node) -> None:
        self._node = node

    def services(self) -> dict[str, str]:
        """Service names with their type, without those of actions."""
        return {
            name: _chosen(types)
            for name, types in self._node.get_service_names_and_types()
            if "/_action/" not in name
        }

    def actions(self) -> dict[str, str]:
        """Action names with their type."""
        return {name: _chosen(types) for name, types in get_action_names_and_types(self._node)}

    def topics(self) -> dict[str, str]:
        """Topic names with their type, without those of actions."""
        return {
            name: _chosen(types)
            for name, types in self._node.get_topic_names_and_types()
            if "/_action/" not in name
        }

    def nodes(self) -> list[str]:
        """Full names of the nodes."""
        found = self._node.get_node_names_and_namespaces()
        return [f"{namespace.rstrip('/')}/{name}" for name, namespace in found]

    def other_type(self, name: str, kind: Any) -> str:
        """What to add to a sentence when nobody offers the service or topic `name` as the class
        `kind`: the type that somebody has it with, "" when nobody does.
        """
        full = self._node.resolve_service_name(name)
        own = type_name(kind)
        known = (*self._node.get_service_names_and_types(), *self._node.get_topic_names_and_types())
        found = [
            each for offered, types in known if offered == full for each in types if each != own
        ]
        return f"; somebody in the graph has it as {found[0]}" if found else ""

    def publishers(self, topic: str) -> list[Any]:
        """End points that publish the topic."""
        infos: list[Any] = self._node.get_publishers_info_by_topic(topic)
        return infos

    def qos_of_publishers(self, topic: str) -> QoSProfile:
        """Quality of service with which all present publishers are heard, as `ros2 topic echo`
        chooses it.
        """
        offered = [info.qos_profile for info in self.publishers(topic)]
        reliable = all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offered)
        kept = bool(offered) and all(
            qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered
        )
        return QoSProfile(
            depth=_DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
        )


def _chosen(types: Sequence[str]) -> str:
    """The type that counts where somebody offers a name with another one too: this project's."""
    return next((each for each in types if each.startswith(_OWN)), types[0])


GONE = 10.0
"""s without anybody who offers an action before its goal is given up. The middleware forgets a
process that died, or was stopped, after 5 s. Time in which this process was suspended is none of
it: the first look afterwards finds nobody, and those who have forgotten it come back in moments.
"""
FORGOTTEN = 4.0
"""s between two looks at an action's node, after which one may have forgotten the other."""
_RARELY = 30.0  # s at most after which a goal's node is asked for the result again
_ENDED = (GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED)


def _known_result(action: str, response: Any) -> Any:
    """The result of a response; RequestRefusedError where the node does not know the goal."""
    if response.status == GoalStatus.STATUS_UNKNOWN:
        raise RequestRefusedError(
            f"{action} does not know the goal any more: how it ended is not known",
            int(StatusCode.FAILURE),
        )
    return response.result


class GoalSender:
    """Sends goals of one node and waits for their results."""

    def __init__(self, node: Node, executor: BackgroundExecutor) -> None:
        self._node = node
        self._executor = executor
        self._clients: dict[tuple[str, Any], ActionClient] = {}

    def send(
        self,
        action: str,
        goal: Any,
        feedback: Callable[[Any], object] | None,
        response_timeout: float,
        result_timeout: float,
        cancel_grace: float,
        give_up: Cancellation | None = None,
    ) -> Any:
        """Send the goal and return its result; cancel it on timeout [s], on an exception while
        waiting, and when it is given up: then the result is that of the canceled goal.
        """
        action_type = owner_of(goal, "Goal", "action")
        client = self._executor.run(lambda: self._client(action, action_type))
        if not self._executor.wait_until(client.server_is_ready, response_timeout):
            raise ServiceUnavailableError(
                f"no node offers the action {action} (waited {response_timeout:g} s)"
            )
        on_feedback = None if feedback is None else lambda message: feedback(message.feedback)
        goal_id = new_goal_id()
        sent: Future = self._executor.run(
            lambda: client.send_goal_async(goal, feedback_callback=on_feedback, goal_uuid=goal_id)
        )
        if not self._executor.wait(sent, response_timeout):
            self._executor.run(lambda: cancel_unanswered(client, goal_id, sent))
            raise CallTimedOutError(f"{action} did not take the goal within {response_timeout:g} s")
        handle = sent.result()
        if not handle.accepted:
            raise RequestRefusedError(f"{action} rejected the goal", int(StatusCode.FAILURE))
        result = Future()
        self._ask_for_result(handle, result)
        try:
            if self._has_ended(action, client, handle, result, result_timeout, give_up):
                # feedback that came with the result is called back after it
                self._executor.run(_nothing)
                return _known_result(action, result.result())
        except ServiceUnavailableError:  # nobody is there to cancel it
            raise
        except BaseException:  # Ctrl-C in a script must not leave the robot moving
            self._cancel(handle, result, cancel_grace)
            raise
        ended = self._cancel(handle, result, cancel_grace)
        since = (
            "the goal was canceled"
            if ended
            else f"canceled, it has not ended within {cancel_grace:g} s"
        )
        raise CallTimedOutError(f"{action} had no result within {result_timeout:g} s: {since}")

    def destroy(self) -> None:
        """Let go of the action clients; call it on the spinning thread."""
        for client in self._clients.values():
            client.destroy()
        self._clients.clear()

    def _has_ended(
        self,
        action: str,
        client: ActionClient,
        handle: Any,
        result: Future,
        timeout: float,
        give_up: Cancellation | None,
    ) -> bool:
        """Whether the goal's result has come within `timeout` [s]; raises where its node has gone.
        The goal is canceled when it is given up.
        """
        now = time.monotonic()
        deadline = now + timeout
        seen = now
        looked = now
        missing = 0.0
        patience = FORGOTTEN
        asked = now
        while not self._executor.wait(result, min(0.1 * GONE, deadline - now), give_up):
            if give_up is not None and give_up.canceled:
                self._executor.run(handle.cancel_goal_async)
                give_up = None
            now = time.monotonic()
            if client.server_is_ready():
                forgotten = now - seen >= FORGOTTEN
                if forgotten or handle.status in _ENDED or now - asked >= patience:
                    self._ask_for_result(handle, result)
                    asked = now
                    patience = min(2.0 * patience, _RARELY)
                seen = now
                missing = 0.0
            else:
                missing += min(now - looked, 0.2 * GONE)  # two looks; more is a suspension
                if missing >= GONE:
                    raise ServiceUnavailableError(
                        f"the node that ran {action} has gone: no result will come"
                    )
            looked = now
            if now >= deadline:
                return False
        return True

    def _ask_for_result(self, handle: Any, result: Future) -> None:
        """Ask for a goal's result, again where the answer may be lost: the middleware forgets this
        process while it is suspended, and a node that was killed is followed by one that does not
        know the goal. The first answer counts.
        """

        def take(answer: Future) -> None:
            if not result.done():
                result.set_result(answer.result())

        self._executor.run(lambda: handle.get_result_async().add_done_callback(take))

    def _cancel(self, handle: Any, result: Future, grace: float) -> bool:
        """Whether the goal has ended within `grace` [s]."""
        self._executor.run(handle.cancel_goal_async)
        return self._executor.wait(result, grace)

    def _client(self, action: str, action_type: Any) -> ActionClient:
        key = (action, action_type)
        if key not in self._clients:
            self._clients[key] = ActionClient(self._node, action_type, action, **ACTION_SERVICES)
        return self._clients[key]


@dataclass(frozen=True, eq=False)
class MovementAnswer:
    """A planned movement; trajectory is None unless the options asked for points."""

    trajectory_id: str
    trajectory: JointTrajectory | None
    report: TrajectoryReport
    info: PlanningInfo

    @classmethod
    def from_msg(cls, response: Any) -> MovementAnswer:
        """From the response of plan_regional_movement, plan_trajectory or plan_escape."""
        points = response.trajectory
        return cls(
            response.trajectory_id,
            trajectory_from_msg(points) if trajectory_given(points) else None,
            report_from_msg(response.report),
            planning_info_from_msg(response.info),
        )


@dataclass(frozen=True, eq=False)
class OptimizedTrajectory:
    """A trajectory made cheaper; trajectory is None unless the options asked for points. durations
    [s] and energies [J], each (P,), and ids: the trade of time for energy, the fastest first.
    """

    trajectory_id: str
    trajectory: JointTrajectory | None
    before: TrajectoryReport
    after: TrajectoryReport
    durations: FloatArray
    energies: FloatArray
    info: PlanningInfo
    ids: tuple[str, ...]

    @classmethod
    def from_msg(cls, response: Any) -> OptimizedTrajectory:
        """From the response of optimize_trajectory."""
        points = response.trajectory
        return cls(
            response.trajectory_id,
            trajectory_from_msg(points) if trajectory_given(points) else None,
            report_from_msg(response.before),
            report_from_msg(response.after),
            np.array(response.pareto_durations),
            np.array(response.pareto_energies),
            planning_info_from_msg(response.info),
            tuple(response.pareto_ids),
        )


@dataclass(frozen=True, eq=False)
class ProgramAnswer:
    """A planned program: its steps, the report of the whole, and what it saves; gap [%]: how far
    above the best chain of configurations it can be. front: programs by cycle time, where they were
    asked for.
    """

    program_id: str
    movements: tuple[PlannedMovement, ...]
    report: TrajectoryReport
    info: PlanningInfo
    gap: float
    savings: ProgramSavings
    front: tuple[ProgramPoint, ...]

    @classmethod
    def from_msg(cls, result: Any) -> ProgramAnswer:
        """From the result of the plan action or the response of plan_program."""
        return cls(
            result.program_id,
            tuple(planned_movement_from_msg(movement) for movement in result.movements),
            report_from_msg(result.report),
            replace(
                planning_info_from_msg(result.info), searches=searches_from_msg(result.searches)
            ),
            result.gap,
            program_savings_from_msg(result.savings),
            tuple(program_point_from_msg(point) for point in result.front),
        )


@dataclass(frozen=True)
class ProgramRun:
    """A program that was run: steps that ended well, duration [s], energy at the mains [J]."""

    executed: int
    duration: float
    energy: float


@dataclass(frozen=True)
class Execution:
    """A trajectory that was driven: largest deviation of the tool [m], energy at the mains [J]."""

    max_tool_deviation: float
    energy: float


# s between two messages that a publisher has kept; they are sent without a pause
_KEPT_WITHIN = 0.1
_CANCEL_GRACE = 5.0  # s that a canceled goal may take to stop along the path


class Client:
    """Calls services, sends goals and listens to topics of a cell.

    namespace: of the cell's nodes. domain_id: None = ROS_DOMAIN_ID. context: somebody else's, as
    that of a test, instead of its own. timeout: longest wait for a service to appear and to answer
    [s]; long work has a timeout of its own.
    """

    def __init__(
        self,
        namespace: str = "",
        *,
        domain_id: int | None = None,
        context: Context | None = None,
        timeout: float = 10.0,
        node_name: str = "ir_client",
    ) -> None:
        self.timeout = timeout
        self._own_context = context is None
        self._context = Context() if context is None else context
        if self._own_context:
            apply_network()
            # a script's own words are none for ROS, which takes every "a:=b" for a remapping
            rclpy.init(args=[], context=self._context, domain_id=domain_id)
        self.node = Node(
            node_name,
            namespace=namespace or None,
            context=self._context,
            start_parameter_services=False,
        )
        self._executor = BackgroundExecutor(self._context)
        self._executor.add_node(self.node)
        self._clients: dict[tuple[str, Any], Any] = {}
        self._goals = GoalSender(self.node, self._executor)
        self.graph = Graph(self.node)

    def close(self) -> None:
        """Let go of everything; the nodes end a goal that is under way, as its client has gone."""
        self._executor.run(self._goals.destroy)
        self._executor.close()
        if self._own_context:
            self._context.try_shutdown()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def call(
        self,
        service: str,
        request: Any,
        timeout: float | None = None,
        give_up: Cancellation | None = None,
    ) -> Any:
        """Send a request (a `SetCell.Request(...)`) and return the response.

        give_up: when it is canceled, CallGivenUpError is raised, and a planner ends what it plans
        for the call.

        Raises ServiceUnavailableError or CallTimedOutError; the response's status is the caller's
        to read.
        """
        limit = self.timeout if timeout is None else timeout
        service_type = owner_of(request, "Request", "srv")
        if give_up is None:
            client = self._executor.run(lambda: self._client(service, service_type))
            return self._called(client, service, request, limit)
        own = self._executor.run(  # that it goes ends this call, and no other
            lambda: self.node.create_client(service_type, service, qos_profile=SERVICE)
        )
        try:
            return self._called(own, service, request, limit, give_up)
        finally:
            self._executor.soon(lambda: self.node.destroy_client(own))

    def _called(
        self,
        client: Any,
        service: str,
        request: Any,
        limit: float,
        give_up: Cancellation | None = None,
    ) -> Any:
        """The response to a request of this client, within `limit` [s] in all."""

        def given_up() -> bool:
            return give_up is not None and give_up.canceled

        deadline = time.monotonic() + limit
        self._executor.wait_until(lambda: client.service_is_ready() or given_up(), limit)
        if given_up():
            raise CallGivenUpError(f"the call of {service} was given up")
        if not client.service_is_ready():
            other = self.graph.other_type(service, client.srv_type)
            raise ServiceUnavailableError(
                f"no node offers the service {service} (waited {limit:g} s){other}"
            )
        future: Future = self._executor.run(lambda: client.call_async(request))
        if self._executor.wait(future, max(0.0, deadline - time.monotonic()), give_up):
            return future.result()
        if given_up():
            raise CallGivenUpError(f"the call of {service} was given up")
        self._executor.run(lambda: client.remove_pending_request(future))
        raise CallTimedOutError(f"{service} did not answer within {limit:g} s")

    def ask(self, service: str, request: Any, timeout: float | None = None) -> Any:
        """Like `call`, and raise RequestRefusedError with the sentence of a status that is not
        SUCCESS.
        """
        response = self.call(service, request, timeout)
        _check(service, response)
        return response

    def send_goal(
        self,
        action: str,
        goal: Any,
        feedback: Callable[[Any], object] | None = None,
        timeout: float = float("inf"),
        give_up: Cancellation | None = None,
    ) -> Any:
        """Send a goal (a `RunProgram.Goal(...)`) and return its result; Ctrl-C cancels the goal.

        timeout: for the result [s]; the goal is canceled when it is over and CallTimedOutError
        raised. give_up: when it is canceled, so is the goal, and its result returned.
        """
        return self._goals.send(
            action, goal, feedback, self.timeout, timeout, _CANCEL_GRACE, give_up
        )

    def subscribe(self, topic: str, message_type: Any, callback: Callable[[Any], object]) -> None:
        """Call back on the spinning thread for each message; the quality of service fits the
        publishers.
        """
        qos = self.graph.qos_of_publishers(topic)
        self._executor.run(
            lambda: self.node.create_subscription(message_type, topic, callback, qos)
        )

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message that subscribers get who come later, as long as the client lives."""
        self._executor.run(
            lambda: self.node.create_publisher(type(message), topic, LATCHED).publish(message)
        )

    def next_message(self, topic: str, message_type: Any, timeout: float | None = None) -> Any:
        """Return the next message of a topic, or the newest one where its publishers keep some.
        Raises CallTimedOutError where none comes.
        """
        limit = self.timeout if timeout is None else timeout
        received: list[Any] = []
        self._executor.wait_until(lambda: bool(self.graph.publishers(topic)), limit)
        qos = self.graph.qos_of_publishers(topic)
        subscription = self._executor.run(
            lambda: self.node.create_subscription(message_type, topic, received.append, qos)
        )
        try:
            if not self._executor.wait_until(lambda: bool(received), limit):
                other = self.graph.other_type(topic, message_type)
                raise CallTimedOutError(f"no message on {topic} within {limit:g} s{other}")
            if (
                qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
            ):  # the kept ones come one after another
                deadline = time.monotonic() + limit
                while time.monotonic() < deadline:
                    grown = _grown(received)
                    if self._executor.wait_until(grown, _KEPT_WITHIN):
                        continue
                    for _ in range(
                        2
                    ):  # a whole turn: that thread may have got no processor meanwhile
                        self._executor.run(_nothing)
                    if not grown():
                        break
        finally:
            self._executor.run(lambda: self.node.destroy_subscription(subscription))
        return received[-1]

    def set_cell(self, cell: str) -> tuple[str, ...]:
        """Load a cell: the name of a bundled one, a path, or the text of a cell file; its stations'
        names.
        """
        request = (
            SetCell.Request(cell_yaml=cell) if "\n" in cell else SetCell.Request(cell_file=cell)
        )
        response = self.ask(names.SET_CELL, request, timeout=max(self.timeout, 30.0))
        return tuple(station.name for station in response.stations)

    def plan_to(self, goal: str, options: PlanOptions | None = None) -> MovementAnswer:
        """Plan a movement from where the robot is to a goal as it is typed: "lathe", "A1 0 A2 -90
        ...".
        """
        chosen = options or PlanOptions()
        request = PlanRegionalMovement.Request(goal=goal, options=plan_options_to_msg(chosen))
        response = self.ask(
            names.PLAN_REGIONAL_MOVEMENT, request, self.timeout + chosen.planning_time
        )
        return MovementAnswer.from_msg(response)

    def plan_escape(
        self, *, station: str = "", options: PlanOptions | None = None
    ) -> MovementAnswer:
        """Plan a slow way from where the robot stands too near to something, in it or beyond a
        limit; no trajectory_id where it stands free. station: its allowed contacts hold.
        """
        chosen = options or PlanOptions()
        request = PlanEscape.Request(station=station, options=plan_options_to_msg(chosen))
        response = self.ask(names.PLAN_ESCAPE, request, self.timeout + chosen.planning_time)
        return MovementAnswer.from_msg(response)

    def optimize(
        self, trajectory: JointTrajectory | str, options: PlanOptions | None = None
    ) -> OptimizedTrajectory:
        """Make a trajectory, or the one behind an id, cheaper between its end points."""
        chosen = options or PlanOptions()
        request = OptimizeTrajectory.Request(options=plan_options_to_msg(chosen))
        if isinstance(trajectory, str):
            request.trajectory_id = trajectory
        else:
            request.trajectory = trajectory_to_msg(trajectory)
        response = self.ask(names.OPTIMIZE_TRAJECTORY, request, self.timeout + chosen.planning_time)
        return OptimizedTrajectory.from_msg(response)

    def plan_program(
        self,
        stations: Sequence[str] = (),
        cycle_time: float = 0.0,
        options: PlanOptions | None = None,
        progress: Callable[[Plan.Feedback], object] | None = None,
        timeout: float = 600.0,
        savings: bool = True,
        front_points: int = 0,
        blend: float = AS_THE_CELL_SAYS,
    ) -> ProgramAnswer:
        """Plan a program over stations (none: the cell's own); progress gets the action's feedback.
        savings: hold it against the common program; front_points: programs from the shortest cycle
        time to twice the free one; blend [m]: how near stops and ends of lines are passed where
        nothing happens, -1: as the cell says.
        """
        goal = Plan.Goal(
            stations=list(stations),
            cycle_time=cycle_time,
            options=plan_options_to_msg(options or PlanOptions()),
            savings=savings,
            front_points=front_points,
            blend=blend,
        )
        result = self.send_goal(names.PLAN, goal, progress, timeout)
        _check(names.PLAN, result)
        return ProgramAnswer.from_msg(result)

    def get_trajectory(self, trajectory_id: str) -> JointTrajectory:
        """Fetch the points of a planned trajectory."""
        response = self.ask(
            names.GET_TRAJECTORY, GetTrajectory.Request(trajectory_id=trajectory_id)
        )
        return trajectory_from_msg(response.trajectory)

    def run_program(
        self,
        program: str | Sequence[PlannedMovement],
        progress: Callable[[RunProgram.Feedback], object] | None = None,
        timeout: float = float("inf"),
        give_up: Cancellation | None = None,
    ) -> ProgramRun:
        """Run a planned program, by its id or its steps; progress gets the action's feedback.
        give_up: when it is canceled, so is the program, which is a refusal.
        """
        if isinstance(program, str):
            goal = RunProgram.Goal(program_id=program)
        else:
            goal = RunProgram.Goal(movements=[planned_movement_to_msg(step) for step in program])
        result = self.send_goal(names.RUN_PROGRAM, goal, progress, timeout, give_up)
        _check(names.RUN_PROGRAM, result)
        return ProgramRun(int(result.executed), float(result.duration), float(result.energy))

    def execute(
        self,
        trajectory: JointTrajectory,
        feedback: Callable[[ExecuteTrajectory.Feedback], object] | None = None,
        timeout: float = float("inf"),
        report: TrajectoryReport | None = None,
        *,
        station: str = "",
        states: Sequence[str] = (),
        allow_collision: bool = False,
    ) -> Execution:
        """Drive a trajectory; RequestRefusedError with the driver's code and sentence when it was
        aborted.

        report: of its plan; the driver refuses what was planned in another cell or with another
        load.
        station: whose contacts are allowed; states: of machines that it relies on; allow_collision:
        start it although it is known to collide.
        """
        goal = ExecuteTrajectory.Goal(
            trajectory=trajectory_to_msg(trajectory),
            trajectory_id=trajectory.trajectory_id,
            station=station,
            states=list(states),
            allow_collision=allow_collision,
        )
        if report is not None:
            goal.cell_hash = report.cell_hash
            goal.load = report.load
        result = self.send_goal(names.EXECUTE_TRAJECTORY, goal, feedback, timeout)
        if result.error_code != ExecuteTrajectory.Result.SUCCESSFUL:
            raise RequestRefusedError(
                f"{names.EXECUTE_TRAJECTORY}: {result.error_string}", int(result.error_code)
            )
        return Execution(float(result.max_tool_deviation), float(result.energy))

    def _client(self, service: str, service_type: Any) -> Any:
        key = (service, service_type)
        if key not in self._clients:
            self._clients[key] = self.node.create_client(service_type, service, qos_profile=SERVICE)
        return self._clients[key]


def _nothing() -> None:
    """A turn of the spinning thread."""


def _grown(received: list[Any]) -> Callable[[], bool]:
    before = len(received)
    return lambda: len(received) > before


def _check(name: str, answer: Any) -> None:
    status = status_from_msg(answer.status)
    if not status.ok:
        raise RequestRefusedError(f"{name}: {status}", int(status.code))
