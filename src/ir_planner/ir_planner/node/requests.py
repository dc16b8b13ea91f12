"""One method per service: the request's values go to the planner, its answer into the response.

A method has the name of the planner's method that it asks: `plan_regional` answers the service
`plan_regional_movement`, `plan_service` and `plan_cartesian` likewise.

Whatever makes no sense is answered by its status: the node lives on and its state is unchanged.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ir_description import RobotCells, UnknownNameError, cell_to_yaml, is_path, robot_urdf
from ir_description.library import read_robot_cells_apart
from ir_kernels import KernelError
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
from ir_msgs_py.names import PLANNER
from ir_msgs_py.ros.conversions import trajectory_to_msg
from ir_msgs_py.ros.goal_clients import Gone
from ir_msgs_py.ros.search_conversions import searches_to_msg
from ir_msgs_py.ros.serving import answered, unexpected
from ir_msgs_py.savings import ProgramSavings
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.current_cell import exactly_one
from ir_planner.errors import CancelledError, PlannerError, RequestError
from ir_planner.krl import export_krl, numbers_asked, one_movement
from ir_planner.node.answers import (
    fill_cartesian,
    fill_escape,
    fill_evaluation,
    fill_export,
    fill_ik,
    fill_movement,
    fill_optimization,
    fill_program,
    fill_robots,
    fill_service,
    fill_standby,
    fill_state_check,
    fill_states_check,
    fill_steady_cycle,
    fill_stored_program,
    stations_to_msg,
)
from ir_planner.node.inputs import (
    LastState,
    goal_motion_of,
    goal_of,
    joined_motion,
    options_of,
    path_of,
    pose_of,
    reference_of,
    start_motion_of,
    state_of,
    states_of,
    trajectory_of,
)
from ir_planner.planner import Planner
from ir_planner.program import ProgramPlan, lengths_of
from ir_planner.request import chosen
from ir_planner.robots import plan_robots
from ir_planner.service import ServicePlan
from ir_values.arrays import FloatArray
from ir_values.errors import IrError, PoseError, shown

_NEVER: Gone = lambda: False  # noqa: E731 - a default argument


def known_status(error: Exception) -> Status | None:  # noqa: PLR0911
    """The status of a request that an error ended, None for one that nobody thought of."""
    if isinstance(error, RequestError):
        return error.status
    if isinstance(error, CancelledError):
        return Status(StatusCode.PREEMPTED, str(error))
    if isinstance(error, PoseError):
        return Status(error.code, str(error))
    if isinstance(error, UnknownNameError):
        return Status(StatusCode.INVALID_OBJECT_NAME, str(error))
    if isinstance(error, IrError):
        return Status(StatusCode.INVALID_GOAL_CONSTRAINTS, str(error))
    if isinstance(error, (PlannerError, KernelError)):
        return Status(StatusCode.FAILURE, str(error))
    return None


def refused(error: Exception) -> Status:
    """The status of a request that an error ended."""
    return known_status(error) or unexpected(error)


class Requests:
    """Handlers of the planner's services; those that plan also take whether they are cancelled.

    now: the node's clock [s]. on_cell_changed and on_planned: called after the cell changed or a
    trajectory was planned; on_service_planned: the same for the candidates at a station,
    on_program_saves: for the savings of a program. draw_seed: for random_seed. log: takes what
    nobody expected.
    """

    def __init__(
        self,
        *,
        planner: Planner,
        last_state: LastState,
        now: Callable[[], float],
        draw_seed: Callable[[], int],
        log: Callable[[str], None],
        on_cell_changed: Callable[[], None] = lambda: None,
        on_planned: Callable[[JointTrajectory], None] = lambda trajectory: None,
        on_service_planned: Callable[[str, ServicePlan], None] = lambda station, plan: None,
        on_program_saves: Callable[[ProgramSavings], None] = lambda savings: None,
    ) -> None:
        self.planner = planner
        self.last_state = last_state
        self.now = now
        self.on_cell_changed = on_cell_changed
        self.on_planned = on_planned
        self.log = log
        self.draw_seed = draw_seed
        self.on_service_planned = on_service_planned
        self.on_program_saves = on_program_saves

    def guarded(self, handler: Callable[..., Status]) -> Callable[..., Any]:
        """The handler as a service callback: its status goes into the response, whatever
        happens.
        """

        def callback(request: Any, response: Any, *cancelled: Gone) -> Any:
            def work() -> Status:
                return handler(request, response, *cancelled)

            return answered(response, PLANNER, work, known_status, self.log)

        return callback

    def set_cell(self, request: SetCell.Request, response: SetCell.Response) -> Status:
        """Another cell."""
        cell = self.planner.set_cell(self._inside(request.cell_file), text=request.cell_yaml)
        response.cell_name = cell.name
        response.stations = stations_to_msg(cell)
        self.on_cell_changed()
        return Status.success()

    def get_cell(self, request: GetCell.Request, response: GetCell.Response) -> Status:
        """The cell as it stands."""
        cell = self.planner.cell
        response.cell_yaml = cell_to_yaml(cell)
        response.stations = stations_to_msg(cell)
        response.robot_description = robot_urdf(cell.robot, cell.tool, cell.tcp, cell.base_pose)
        return Status.success()

    def set_equipment(
        self, request: SetEquipment.Request, response: SetEquipment.Response
    ) -> Status:
        """A machine moved, switched or in another state."""
        pose = pose_of(request.pose, self.planner.cell)
        self.planner.set_equipment(
            request.name, pose=pose, enabled=request.enabled, state=request.state
        )
        self.on_cell_changed()
        return Status.success()

    def check_state(self, request: CheckState.Request, response: CheckState.Response) -> Status:
        """Is this state free."""
        q = self._state(request.state, StatusCode.INVALID_ROBOT_STATE)
        margin = request.safety_distance
        station = request.station
        check = self.planner.check_state(
            q,
            safety_distance=margin,
            max_pairs=request.max_pairs,
            load=request.load,
            station=station,
        )
        fill_state_check(response, check)
        return check.status

    def check_states(self, request: CheckStates.Request, response: CheckStates.Response) -> Status:
        """Are these states free."""
        q = states_of(request.states, self.planner.cell)
        check = self.planner.check_states(
            q, safety_distance=request.safety_distance, load=request.load, station=request.station
        )
        fill_states_check(response, check)
        blocked = int((~check.valid).sum())
        return Status.success(f"{blocked} of {len(q)} states are not free" if blocked else "")

    def compute_ik(self, request: ComputeIk.Request, response: ComputeIk.Response) -> Status:
        """Configurations that reach a pose."""
        cell = self.planner.cell
        near = state_of(request.near, cell, StatusCode.INVALID_ROBOT_STATE)
        if near is None:
            near = self._known_or_home()
        goal = goal_of(request, cell)
        answer = self.planner.compute_ik(
            goal,
            method=request.method,
            safety_distance=request.safety_distance,
            near=near,
            load=request.load,
            starts=request.starts,
            seed=request.seed,
        )
        fill_ik(response, answer)
        return answer.status

    def plan_regional(
        self,
        request: PlanRegionalMovement.Request,
        response: PlanRegionalMovement.Response,
        cancelled: Gone = _NEVER,
    ) -> Status:
        """From machine to machine."""
        cell = self.planner.cell
        options = options_of(request.options, self.draw_seed)
        goal = goal_of(request, cell)
        driven = joined_motion(request, self.planner)
        if driven is None:
            velocity, acceleration = start_motion_of(request, cell)
            stands = "start" if velocity is None and acceleration is None else ""
            start = self._state(request.start, StatusCode.START_STATE_INVALID, at_rest=stands)
        else:
            start = driven.q[0]
            velocity = driven.qd[0]
            acceleration = driven.qdd[0]
        goal_velocity, goal_acceleration = goal_motion_of(request, cell)
        plan = self.planner.plan_regional(
            start=start,
            start_velocity=velocity,
            start_acceleration=acceleration,
            goal=goal,
            goal_velocity=goal_velocity,
            goal_acceleration=goal_acceleration,
            via=tuple(request.via),
            via_tolerance=request.via_tolerance,
            via_distance=request.via_distance,
            options=options,
            cancelled=cancelled,
        )
        response.searches = searches_to_msg(plan.info.searches)
        return self._movement(plan, response, options.include_points)

    def plan_escape(
        self, request: PlanEscape.Request, response: PlanEscape.Response, cancelled: Gone = _NEVER
    ) -> Status:
        """Away from what is too near, and back within the limits."""
        options = options_of(request.options, self.draw_seed)
        start = self._state(request.start, StatusCode.START_STATE_INVALID, at_rest="start")
        plan = self.planner.plan_escape(
            start, station=request.station, options=options, cancelled=cancelled
        )
        fill_escape(response, plan, options.include_points)
        return self._publish_and_status(plan)

    def plan_service(
        self,
        request: PlanServiceMovement.Request,
        response: PlanServiceMovement.Response,
        cancelled: Gone = _NEVER,
    ) -> Status:
        """Out of a machine's work area, or into it."""
        options = options_of(request.options, self.draw_seed)
        cell = self.planner.cell
        configuration = state_of(request.configuration, cell, StatusCode.INVALID_ROBOT_STATE)
        here = self._known_or_home()
        most = request.max_candidates
        plan = self.planner.plan_service(
            request.station,
            direction=request.direction,
            configuration=configuration,
            near=here,
            max_candidates=most,
            options=options,
            cancelled=cancelled,
        )
        fill_service(response, plan, options.include_points)
        if plan.candidates:
            self.on_service_planned(request.station, plan)
        return plan.status

    def plan_trajectory(
        self,
        request: PlanTrajectory.Request,
        response: PlanTrajectory.Response,
        cancelled: Gone = _NEVER,
    ) -> Status:
        """Through given points."""
        options = options_of(request.options, self.draw_seed)
        reference = reference_of(request.reference, self.planner.cell)
        return self._movement(
            self.planner.plan_trajectory(reference, options=options, cancelled=cancelled),
            response,
            options.include_points,
        )

    def plan_cartesian(
        self,
        request: PlanCartesianMovement.Request,
        response: PlanCartesianMovement.Response,
        cancelled: Gone = _NEVER,
    ) -> Status:
        """The tool along a path."""
        options = options_of(request.options, self.draw_seed)
        cell = self.planner.cell
        start = state_of(request.start, cell, StatusCode.START_STATE_INVALID, "start")
        plan = self.planner.plan_cartesian(
            path_of(request, cell),
            options=options,
            start=start,
            t1=request.t1,
            cancelled=cancelled,
        )
        fill_cartesian(response, plan, options.include_points)
        return self._publish_and_status(plan)

    def optimize_trajectory(
        self,
        request: OptimizeTrajectory.Request,
        response: OptimizeTrajectory.Response,
        cancelled: Gone = _NEVER,
    ) -> Status:
        """A trajectory between the same end points that costs less."""
        options = options_of(request.options, self.draw_seed)
        plan = self.planner.optimize_trajectory(
            trajectory_of(request, self.planner), options=options, cancelled=cancelled
        )
        fill_optimization(response, plan, options.include_points)
        return self._publish_and_status(plan)

    def _movement(self, plan: Any, response: Any, include_points: bool) -> Status:
        fill_movement(response, plan, include_points)
        return self._publish_and_status(plan)

    def _publish_and_status(self, plan: Any) -> Status:
        """Publish a trajectory that was planned; the status of its request."""
        if plan.trajectory is not None:
            self.on_planned(plan.trajectory)
        status: Status = plan.status
        return status

    def plan_program(
        self,
        request: PlanProgram.Request,
        response: PlanProgram.Response,
        cancelled: Gone = _NEVER,
        progress: Callable[[str, int, int, float], None] = lambda phase, done, total, cost: None,
    ) -> Status:
        """A whole program; the action asks it with its goal and result, which have these fields."""
        options = options_of(request.options, self.draw_seed)
        start = self._known_or_home(at_rest=True)
        plan: ProgramPlan = self.planner.plan_program(
            stations=tuple(request.stations),
            cycle_time=request.cycle_time,
            options=options,
            start=start,
            progress=progress,
            cancelled=cancelled,
            savings=request.savings,
            front_points=request.front_points,
            blend=request.blend,
        )
        fill_program(response, plan, options.include_points)
        if plan.savings.available:
            self.on_program_saves(plan.savings)
        for movement in plan.movements:
            if movement.trajectory is not None:
                self.on_planned(movement.trajectory)
        return plan.status

    def plan_steady_cycle(
        self,
        request: PlanSteadyCycle.Request,
        response: PlanSteadyCycle.Response,
        cancelled: Gone = _NEVER,
    ) -> Status:
        """The cheapest cycle of the cell's route."""
        options = options_of(request.options, self.draw_seed)
        plan = self.planner.plan_steady_cycle(
            parts_per_hour=request.parts_per_hour,
            options=options,
            cancelled=cancelled,
            units=request.units,
            cycles=request.cycles,
            saving=request.savings,
            front_points=request.front_points,
        )
        fill_steady_cycle(response, plan, options.include_points)
        return plan.status

    def plan_robots(
        self,
        request: PlanRobots.Request,
        response: PlanRobots.Response,
        cancelled: Gone = _NEVER,
    ) -> Status:
        """The cheapest joint cycle of a cell with several robots; the planner's cell stays."""
        options = options_of(request.options, self.draw_seed)
        plan = plan_robots(
            self._robot_cells(request.cell_yaml, request.cell_file),
            cycle_time=request.cycle_time,
            peak_power=request.peak_power,
            options=options,
            settings=self.planner.settings,
            cancelled=cancelled,
            clock=self.planner.clock,
        )
        for program in plan.programs:
            self.planner.remember(program)
        fill_robots(response, plan, options.include_points)
        return plan.status

    def _robot_cells(self, text: str, file: str) -> RobotCells:
        """The cells of all robots of a text or a file, which must lie below the roots."""
        exactly_one(text, file)
        cells = read_robot_cells_apart(text, self._inside(file))
        if cells is None:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"the cell {shown(file, 200) if file else 'of the text'} has one robot, so there "
                "is no joint cycle: ask plan_program, or plan_steady_cycle where it has a route",
            )
        return cells

    def _inside(self, file: str) -> str:
        """A file as it may be read: a path must lie below the roots, whatever the request says."""
        return str(self.planner.settings.file_roots.inside(file)) if is_path(file) else file

    def get_program(self, request: GetProgram.Request, response: GetProgram.Response) -> Status:
        """A program planned before."""
        fill_stored_program(
            response, self.planner.programs.get(request.program_id), request.include_points
        )
        return Status.success()

    def export_program(
        self, request: ExportProgram.Request, response: ExportProgram.Response
    ) -> Status:
        """A program or a trajectory planned before, as KRL."""
        chosen(request.language, ("krl",), "language")
        if bool(request.program_id) == bool(request.trajectory_id):
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS, "give a program_id or a trajectory_id"
            )
        if request.program_id:
            movements = self.planner.programs.get(request.program_id).movements
        else:
            movements = one_movement(self.planner, request.trajectory_id)
        numbers = numbers_asked(request.tools, request.bases, request.numbers_from)
        written = export_krl(
            self.planner, movements, request.name, style=request.style, numbers=numbers
        )
        fill_export(response, written)
        return Status.success(written.remark)

    def evaluate_trajectory(
        self, request: EvaluateTrajectory.Request, response: EvaluateTrajectory.Response
    ) -> Status:
        """What a trajectory costs and where it first breaks a bound."""
        trajectory = trajectory_of(request, self.planner)
        evaluation = self.planner.evaluate(
            trajectory,
            safety_distance=request.safety_distance,
            load=request.load,
            station=request.station,
            tilt_max=request.tilt_max,
            tilt_axis=tuple(request.tilt_axis),
            tilt_direction=tuple(request.tilt_direction),
            tool_speed=request.tool_speed,
            tool_acceleration=request.tool_acceleration,
            whole_tool=request.whole_tool,
        )
        fill_evaluation(response, evaluation)
        return evaluation.status

    def get_trajectory(
        self, request: GetTrajectory.Request, response: GetTrajectory.Response
    ) -> Status:
        """The points of a trajectory planned before."""
        response.trajectory = trajectory_to_msg(
            self.planner.trajectories.get(request.trajectory_id)
        )
        return Status.success()

    def plan_standby(self, request: PlanStandby.Request, response: PlanStandby.Response) -> Status:
        """Where to rest during a pause."""
        q = state_of(request.state, self.planner.cell, StatusCode.INVALID_ROBOT_STATE)
        samples = np.array(request.pause_samples)
        quantiles = np.array(request.pause_quantiles)
        lengths = lengths_of(request.pause, samples, quantiles)
        standby = self.planner.standby(
            lengths, q=q, load=request.load, postures=tuple(request.postures)
        )
        fill_standby(response, standby, self.planner.heard.source)
        return Status.success(standby.sentence)

    def _state(self, msg: Any, code: StatusCode, at_rest: str = "") -> FloatArray:
        cell = self.planner.cell
        given = state_of(msg, cell, code, at_rest)
        if given is not None:
            return given
        standing = cell.robot.joint_names if at_rest else ()
        return self.last_state.soon(self.now, self.planner.settings.state_max_age, standing)

    def _known_or_home(self, at_rest: bool = False) -> FloatArray:
        """The last known state, however old; machine home where no state was received. at_rest: a
        robot that moves now is refused.
        """
        cell = self.planner.cell
        standing = cell.robot.joint_names if at_rest else ()
        q = self.last_state.known(self.now(), self.planner.settings.state_max_age, standing)
        return np.array(cell.machine_home) if q is None else q
