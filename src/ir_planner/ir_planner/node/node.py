"""The planner's node: services, the plan action, the cell as markers. It parses, calls the core and
replies.

Quick questions, planning and the action have callback groups of their own: a long plan holds up
neither other services nor its own cancel.
"""

import random
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg
from visualization_msgs.msg import MarkerArray

from ir_description import DescriptionError
from ir_description.library import read_cell_apart
from ir_kernels import compiled
from ir_msgs.action import Plan
from ir_msgs.msg import ProgramSavings as ProgramSavingsMsg
from ir_msgs.srv import (
    CheckState,
    CheckStates,
    ComputeIk,
    EvaluateTrajectory,
    ExportProgram,
    GetCell,
    GetProgram,
    GetTrajectory,
    OptimizeTrajectory,
    PlanCartesianMovement,
    PlanEscape,
    PlanProgram,
    PlanRegionalMovement,
    PlanRobots,
    PlanServiceMovement,
    PlanStandby,
    PlanSteadyCycle,
    PlanTrajectory,
    SetCell,
    SetEquipment,
)
from ir_msgs_py import names
from ir_msgs_py.names import own
from ir_msgs_py.ros.conversions import configuration_from_msg, trajectory_to_msg
from ir_msgs_py.ros.diagnostics import OK, WARN, Condition, Diagnostics
from ir_msgs_py.ros.node_process import run_node
from ir_msgs_py.ros.parameters import Parameters
from ir_msgs_py.ros.plan_conversions import program_savings_to_msg
from ir_msgs_py.ros.serving import BoundedService, RecordedActionServer
from ir_msgs_py.ros.topics import ACTION_SERVICES, LATCHED, LatestMessage
from ir_msgs_py.savings import ProgramSavings
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import cell_shapes, movement_shapes
from ir_planner.errors import PlannerError
from ir_planner.node.answers import fill_status
from ir_planner.node.goal_queue import GoalQueue
from ir_planner.node.inputs import LastState, has_joints, measured_velocity, of_joints
from ir_planner.node.requests import Requests
from ir_planner.node.topics import PlannerAnnouncements, ShownMarkers
from ir_planner.planner import Planner
from ir_planner.service import ServicePlan, service_shapes
from ir_planner.settings import PlannerSettings
from ir_values.errors import InvalidValueError, IrError

_PUBLISHERS = 16  # of joint_states beside the robot's, without pushing its message out
_CLIENT_TIMEOUT = 1.0  # s for which a plan goes on when its client has gone
_GOALS_WAITING = 100  # beyond, a client is in a loop: each takes seconds
# quick and long requests, texts and points, changes, standby, the goal, cancelling, a spare
_THREADS = 8


class PlannerNode(Node):
    """Answers requests about one cell; `make_planner`: another core than the usual one, for
    tests.
    """

    def __init__(
        self,
        make_planner: Callable[[PlannerSettings], Planner] | None = None,
        context: Context | None = None,
        **options: Any,
    ) -> None:
        super().__init__(names.PLANNER, context=context, **options)
        parameters = Parameters(self, PlannerSettings, on_change=self._change_settings)
        make = make_planner or (
            lambda settings: Planner(
                clock=time.monotonic, settings=settings, read_cell=read_cell_apart
            )
        )
        self.planner = make(parameters.value)
        self._last_state = LastState(
            self._look, lambda: self.count_publishers(names.JOINT_STATES) > 0
        )
        self._requests = Requests(
            planner=self.planner,
            last_state=self._last_state,
            now=time.monotonic,
            on_cell_changed=self._show_cell,
            on_planned=self._show_movement,
            draw_seed=lambda: random.SystemRandom().getrandbits(64),
            log=self.get_logger().error,
            on_service_planned=self._show_service,
            on_program_saves=self._show_savings,
        )
        self._trajectories = self.create_publisher(
            JointTrajectoryMsg, own(names.PLANNED_TRAJECTORY), LATCHED
        )
        self._savings = self.create_publisher(
            ProgramSavingsMsg, own(names.PROGRAM_SAVINGS), LATCHED
        )
        self._markers = self.create_publisher(MarkerArray, own(names.PLANNER_MARKERS), LATCHED)
        self._diagnostics = Diagnostics(self)
        self._shown = ShownMarkers()
        self._quick = MutuallyExclusiveCallbackGroup()
        self._long = MutuallyExclusiveCallbackGroup()
        self._announcements = PlannerAnnouncements(self, self.planner, self._quick)
        self._goals = GoalQueue(self._execute_plan, self._refuse_plan, _GOALS_WAITING)
        self._offer()
        self._states = LatestMessage(self, JointState, names.JOINT_STATES, _PUBLISHERS)
        self.create_timer(1.0, self._diagnose, callback_group=self._quick)
        self._load_first_cell(parameters.value.cell)

    def _offer(self) -> None:
        """Advertise what works."""
        ask = self._requests
        quick = self._quick
        long = self._long
        changes = MutuallyExclusiveCallbackGroup()  # a large cell holds up nobody but other changes
        texts = MutuallyExclusiveCallbackGroup()  # as long as what was loaded or planned
        # plans movements to postures where it is asked to
        waiting = MutuallyExclusiveCallbackGroup()
        for kind, name, handler, group in (
            (SetCell, names.SET_CELL, ask.set_cell, changes),
            (GetCell, names.GET_CELL, ask.get_cell, texts),
            (SetEquipment, names.SET_EQUIPMENT, ask.set_equipment, changes),
            (CheckState, names.CHECK_STATE, ask.check_state, quick),
            (CheckStates, names.CHECK_STATES, ask.check_states, quick),
            (ComputeIk, names.COMPUTE_IK, ask.compute_ik, quick),
            (GetTrajectory, names.GET_TRAJECTORY, ask.get_trajectory, texts),
            (GetProgram, names.GET_PROGRAM, ask.get_program, texts),
            (ExportProgram, names.EXPORT_PROGRAM, ask.export_program, long),
            (PlanStandby, names.PLAN_STANDBY, ask.plan_standby, waiting),
            (EvaluateTrajectory, names.EVALUATE_TRAJECTORY, ask.evaluate_trajectory, long),
        ):
            BoundedService(self, kind, own(name), ask.guarded(handler), group)
        for kind, name, handler in (
            (PlanServiceMovement, names.PLAN_SERVICE_MOVEMENT, ask.plan_service),
            (PlanRegionalMovement, names.PLAN_REGIONAL_MOVEMENT, ask.plan_regional),
            (PlanEscape, names.PLAN_ESCAPE, ask.plan_escape),
            (PlanTrajectory, names.PLAN_TRAJECTORY, ask.plan_trajectory),
            (PlanCartesianMovement, names.PLAN_CARTESIAN_MOVEMENT, ask.plan_cartesian),
            (OptimizeTrajectory, names.OPTIMIZE_TRAJECTORY, ask.optimize_trajectory),
            (PlanProgram, names.PLAN_PROGRAM, ask.plan_program),
            (PlanSteadyCycle, names.PLAN_STEADY_CYCLE, ask.plan_steady_cycle),
            (PlanRobots, names.PLAN_ROBOTS, ask.plan_robots),
        ):
            BoundedService(self, kind, own(name), ask.guarded(handler), long, watching=True)
        self._action = RecordedActionServer(
            self,
            Plan,
            own(names.PLAN),
            self._goals.execute,
            handle_accepted_callback=self._goals.accepted,
            cancel_callback=self._goals.cancel,
            callback_group=ReentrantCallbackGroup(),
            **ACTION_SERVICES,
        )

    def _execute_plan(self, goal: ServerGoalHandle) -> Plan.Result:
        """plan_program with feedback; a cancel ends it at the next step, and so does the end of its
        client.
        """

        def progress(phase: str, done: int, total: int, best_cost: float) -> None:
            cost = float(best_cost) if np.isfinite(best_cost) else 0.0
            goal.publish_feedback(
                Plan.Feedback(phase=phase, done=done, total=total, best_cost=cost)
            )

        gone = self._action.watch(bytes(goal.goal_id.uuid), _CLIENT_TIMEOUT)

        def cancelled() -> bool:
            return bool(goal.is_cancel_requested) or gone()

        ask = self._requests
        plan = ask.guarded(
            lambda request, result: ask.plan_program(request, result, cancelled, progress)
        )
        result = plan(goal.request, Plan.Result())
        if result.status.code == StatusCode.SUCCESS:
            goal.succeed()
        elif goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
        return result

    def _refuse_plan(self, goal: ServerGoalHandle) -> Plan.Result:
        goal.abort()
        sentence = f"{_GOALS_WAITING} goals of plan wait already: at most so many may"
        return fill_status(Plan.Result(), Status(StatusCode.FAILURE, sentence), names.PLANNER)

    def _look(self) -> None:
        """Remember where the robot is; a message about other joints alone is none."""
        if not self.planner.has_cell:
            return
        joints = self.planner.cell.robot.joint_names
        received = self._states.take(lambda message: has_joints(message, joints))
        if received is None:
            return
        try:
            message = of_joints(received.message, joints)
            q = configuration_from_msg(message, joints)
        except InvalidValueError as error:
            self._last_state.problem = str(error)
            return
        self._last_state.take(
            q, time.monotonic() - received.age, measured_velocity(message, joints)
        )

    def _change_settings(self, settings: PlannerSettings) -> None:
        self.planner.settings = settings

    def _load_first_cell(self, cell: str) -> None:
        if not cell:
            return
        try:
            self.planner.set_cell(cell)
        except DescriptionError as error:
            self.get_logger().error(f"parameter cell: {error}")
            return
        self._show_cell()

    def _show_cell(self) -> None:
        self._announcements.announce()
        self._markers.publish(self._shown.with_cell(cell_shapes(self.planner.cell)))

    def _show_movement(self, trajectory: JointTrajectory) -> None:
        self._trajectories.publish(trajectory_to_msg(trajectory))
        self._markers.publish(
            self._shown.beside_cell(movement_shapes(trajectory, self.planner.scene()))
        )

    def _show_savings(self, savings: ProgramSavings) -> None:
        self._savings.publish(program_savings_to_msg(savings))

    def _show_service(self, station: str, plan: ServicePlan) -> None:
        for candidate in plan.candidates:
            if candidate.trajectory is not None:
                self._trajectories.publish(trajectory_to_msg(candidate.trajectory))
        shapes = service_shapes(plan.candidates, station, self.planner.scene())
        self._markers.publish(self._shown.beside_cell(shapes))

    def _diagnose(self) -> None:
        self._look()
        self._announcements.forget_the_gone()
        cell = self.planner.cell.name if self.planner.has_cell else ""
        slow = compiled.NAME == "reference"
        sentence = "ready" if cell else "no cell is loaded: call set_cell"
        if cell and slow:
            sentence = "ready, but without the compiled core: planning is slow"
        values = {
            "cell": cell,
            "kernels": compiled.NAME,
            "trajectories": str(len(self.planner.trajectories)),
            "programs": str(len(self.planner.programs)),
            "joint_states": self._last_state.problem
            or ("none" if self._last_state.q is None else "received"),
        }
        level = OK if cell and not slow else WARN
        self._diagnostics.publish([Condition(names.PLANNER, level, sentence, values, cell)])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(
        names.PLANNER,
        PlannerNode,
        arguments,
        executor=lambda: MultiThreadedExecutor(num_threads=_THREADS),
        refusals=(PlannerError, IrError),
        about="Plans certified movements and programs of a robot cell, with their joules.",
    )


if __name__ == "__main__":
    sys.exit(main())
