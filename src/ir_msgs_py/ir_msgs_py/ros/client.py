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
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy
from rclpy.task import Future

from ir_msgs.action import ExecuteTrajectory, Plan, RunProgram
from ir_msgs.srv import GetTrajectory, OptimizeTrajectory, PlanRegionalMovement, SetCell
from ir_msgs_py import names
from ir_msgs_py.errors import CallTimedOutError, RequestRefusedError, ServiceUnavailableError
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.ros.answers import (
    Execution,
    MovementPlan,
    OptimizedTrajectory,
    ProgramPlan,
    ProgramRun,
)
from ir_msgs_py.ros.background import BackgroundExecutor
from ir_msgs_py.ros.conversions import (
    plan_options_to_msg,
    status_from_msg,
    trajectory_from_msg,
    trajectory_to_msg,
)
from ir_msgs_py.ros.goals import GoalSender
from ir_msgs_py.ros.graph import Graph
from ir_msgs_py.ros.network import apply_network
from ir_msgs_py.ros.quality import SERVICE
from ir_msgs_py.ros.types import owner_of
from ir_msgs_py.trajectory import JointTrajectory

_KEPT_WITHIN = (
    0.1  # s between two messages that a publisher has kept; they are sent without a pause
)
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
        """Let go of everything; a goal under way goes on."""
        self._executor.run(self._goals.destroy)
        self._executor.close()
        if self._own_context:
            self._context.try_shutdown()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def call(self, service: str, request: Any, timeout: float | None = None) -> Any:
        """Send a request (a `SetCell.Request(...)`) and return the response.

        Raises ServiceUnavailableError or CallTimedOutError; the response's status is the caller's
        to read.
        """
        limit = self.timeout if timeout is None else timeout
        service_type = owner_of(request, "Request", "srv")
        client = self._executor.run(lambda: self._client(service, service_type))
        deadline = time.monotonic() + limit
        if not self._executor.wait_until(client.service_is_ready, limit):
            other = self.graph.other_type(service, service_type)
            raise ServiceUnavailableError(
                f"no node offers the service {service} (waited {limit:g} s){other}"
            )
        future: Future = self._executor.run(lambda: client.call_async(request))
        if not self._executor.wait(future, max(0.0, deadline - time.monotonic())):
            self._executor.run(lambda: client.remove_pending_request(future))
            raise CallTimedOutError(f"{service} did not answer within {limit:g} s")
        return future.result()

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
    ) -> Any:
        """Send a goal (a `RunProgram.Goal(...)`) and return its result; Ctrl-C cancels the goal.

        timeout: for the result [s]; the goal is canceled when it is over and CallTimedOutError
        raised.
        """
        return self._goals.send(action, goal, feedback, self.timeout, timeout, _CANCEL_GRACE)

    def subscribe(self, topic: str, message_type: Any, callback: Callable[[Any], object]) -> None:
        """Call back on the spinning thread for each message; the quality of service fits the
        publishers.
        """
        qos = self.graph.qos_of_publishers(topic)
        self._executor.run(
            lambda: self.node.create_subscription(message_type, topic, callback, qos)
        )

    def next_message(self, topic: str, message_type: Any, timeout: float | None = None) -> Any:
        """Return the next message of a topic, or the newest one where its publishers keep some."""
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

    def plan_to(self, goal: str, options: PlanOptions | None = None) -> MovementPlan:
        """Plan a movement from where the robot is to a goal as it is typed: "lathe", "A1 0 A2 -90
        ...".
        """
        chosen = options or PlanOptions()
        request = PlanRegionalMovement.Request(goal=goal, options=plan_options_to_msg(chosen))
        response = self.ask(
            names.PLAN_REGIONAL_MOVEMENT, request, self.timeout + chosen.planning_time
        )
        return MovementPlan.from_msg(response)

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
    ) -> ProgramPlan:
        """Plan a program over stations (none: the cell's own); progress gets the action's feedback.
        savings: hold it against the common program; front_points: programs from the shortest cycle
        time to twice the free one.
        """
        goal = Plan.Goal(
            stations=list(stations),
            cycle_time=cycle_time,
            options=plan_options_to_msg(options or PlanOptions()),
            savings=savings,
            front_points=front_points,
        )
        result = self.send_goal(names.PLAN, goal, progress, timeout)
        _check(names.PLAN, result)
        return ProgramPlan.from_msg(result)

    def get_trajectory(self, trajectory_id: str) -> JointTrajectory:
        """Fetch the points of a planned trajectory."""
        response = self.ask(
            names.GET_TRAJECTORY, GetTrajectory.Request(trajectory_id=trajectory_id)
        )
        return trajectory_from_msg(response.trajectory)

    def run_program(
        self,
        program_id: str,
        progress: Callable[[RunProgram.Feedback], object] | None = None,
        timeout: float = float("inf"),
    ) -> ProgramRun:
        """Run a planned program; progress gets the action's feedback."""
        result = self.send_goal(
            names.RUN_PROGRAM, RunProgram.Goal(program_id=program_id), progress, timeout
        )
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
