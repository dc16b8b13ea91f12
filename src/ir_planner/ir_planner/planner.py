"""The planner as a whole, without ROS: the cell as it stands, what is attached, and what was
planned.

    planner = Planner("demo")
    plan = planner.plan_regional(goal="lathe_work", objective="energy")
    print(plan)

Arguments are keywords with defaults that do the common job. Every request takes one immutable
snapshot of the cell; changing the cell meanwhile reaches the next one.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TypedDict, Unpack

import numpy as np

from ir_description import Cell, PowerData, cell_hash, is_path
from ir_description.cell import VIA_TOLERANCE, CellPath, ToolTilt
from ir_kernels import KernelError
from ir_kernels.data import pose as rigid_pose
from ir_msgs_py.cartesian import CartesianPath
from ir_msgs_py.options import (
    AS_THE_CELL_SAYS,
    DEFAULT_SAFETY_DISTANCE,
    NO_TILT,
    PlanOptions,
)
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import flexible
from ir_planner.cartesian import CartesianPlan, checked_path_options, plan_path
from ir_planner.checks import Evaluation, StateCheck, evaluate_trajectory
from ir_planner.configurations import (
    IK_METHODS,
    STARTS_MAX,
    IkAnswer,
    configurations_at,
)
from ir_planner.current_cell import CurrentCell, DriverReports, ReadCell, read_cell_here
from ir_planner.errors import RequestError, unfit, unknown_name
from ir_planner.program import (
    PauseLengths,
    ProgramPlan,
    ProgramRequest,
    Progress,
    Spreads,
    Standby,
    nobody,
    plan_program,
)
from ir_planner.regional import EscapePlan, MovementPlan, plan_escape, plan_to_goal
from ir_planner.request import (
    Clock,
    Context,
    Goal,
    Journal,
    Work,
    bounded,
    check_safety_distance,
    checked_options,
    chosen,
    cone_of,
    examinable,
    joints_of,
    leaning_freely_only,
    motion_of,
    motion_on,
    noted,
    one_tilt,
    parse_goal,
    tool_bounds_of,
    upright_options,
    within_limits,
)
from ir_planner.scene import PlanningScene
from ir_planner.service import (
    ServicePlan,
    ServiceRequest,
    checked_request,
    exit_searches,
    known_method,
    plan_service,
)
from ir_planner.settings import PlannerSettings
from ir_planner.state_queries import StatesCheck, asked_state, asked_states
from ir_planner.store import StoredProgram, program_store, trajectory_store
from ir_planner.trajectories import (
    OptimizationPlan,
    Reference,
    Via,
    ViaSearch,
    optimize_trajectory,
    plan_through,
)
from ir_planner.validity import (
    AnyMovement,
    evaluation_in,
    movement_in,
    optimization_in,
    program_in,
    service_in,
)
from ir_planner.waiting_postures import standby_at
from ir_values.argument_types import typed_methods
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError

Place = Goal | str | FloatArray
"""Where to: a station, a posture or a text of values; joint values (n,) rad; a pose (4, 4) of the
tcp in the cell."""
AnyPath = CartesianPath | CellPath  # a cell's own comes with what it allows to touch
Cancelled = Callable[[], bool]
_START = StatusCode.START_STATE_INVALID
CLOCK: Clock = time.monotonic
"""What ceilings of time are held against where nobody gives another clock."""

_NEVER: Cancelled = lambda: False  # noqa: E731 - a default argument


class OptionFields(TypedDict, total=False):
    """Fields of PlanOptions, which every planning call also takes one by one."""

    planner_id: str
    seed: int
    random_seed: bool
    max_iterations: int
    planning_time: float
    safety_distance: float
    objective: str
    time_value: float
    duration: float
    timing: str
    velocity_scaling: float
    acceleration_scaling: float
    load: str
    include_points: bool
    tilt_max: float
    tilt_axis: tuple[float, ...]
    tilt_direction: tuple[float, ...]
    tool_speed: float
    tool_acceleration: float
    whole_tool: bool


def options_with(options: PlanOptions | None, changes: OptionFields) -> PlanOptions:
    """The options with some fields changed. Raises RequestError: an unknown one, a bad value."""
    names = [field.name for field in fields(PlanOptions)]
    for name in changes:
        if name not in names:
            raise unknown_name("option", name, names)
    try:
        return PlanOptions(**changes) if options is None else replace(options, **changes)
    except InvalidValueError as error:
        raise RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, str(error)) from error
    except (TypeError, ValueError, OverflowError) as error:
        shown = ", ".join(f"{name}={value!r}"[:80] for name, value in changes.items())
        sentence = f"options {shown}: one has a value of no fitting type: {error}"
        raise RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, sentence) from error


@typed_methods(unfit)
class Planner:
    """Answers requests about one cell. Methods raise RequestError for requests that make no sense.

    cell: a bundled name ("demo"), a path, or a Cell; None: set_cell gives one later. settings:
    those of the ROS parameters. power: the controller's figures, None: those of the cell's robot.
    clock: seconds, only for ceilings and for the times that answers report. read_cell: reads the
    cell of a text, or else of a path or a bundled name.

    Planning calls take `options`, and its fields one by one (`objective="energy"`), which count
    before it. `cancelled` is asked between steps: CancelledError ends the request.
    """

    def __init__(
        self,
        cell: Cell | str | Path | None = None,
        *,
        settings: PlannerSettings | None = None,
        power: PowerData | None = None,
        clock: Clock = CLOCK,
        read_cell: ReadCell = read_cell_here,
    ) -> None:
        self.clock = clock
        self.settings = settings or PlannerSettings()
        self.heard = DriverReports(lambda: self.settings.transitions)
        self._current = CurrentCell(
            self.heard, lambda robot: self.settings.drives(robot), power, read_cell
        )
        megabytes = self.settings.stored_megabytes
        self.trajectories = trajectory_store(self.settings.stored_trajectories, megabytes)
        self.programs = program_store(self.settings.stored_programs, megabytes)
        if cell is not None:
            self.set_cell(cell)

    def __repr__(self) -> str:
        name = repr(self.cell.name) if self.has_cell else "no cell"
        planned = f"{len(self.trajectories)} trajectories, {len(self.programs)} programs"
        return f"Planner({name}, {planned})"

    @property
    def cell(self) -> Cell:
        """The cell as it stands. Raises RequestError while there is none."""
        return self._current.cell

    @property
    def cell_hash(self) -> str:
        """Content hash of the cell as it stands."""
        return self._current.hash_of(self.cell)

    @property
    def has_cell(self) -> bool:
        """Whether a cell is loaded."""
        return self._current.loaded

    def set_cell(self, cell: Cell | str | Path | None = None, *, text: str = "") -> Cell:
        """Take another cell: a Cell, a path or the name of a bundled one, or the `text` of a file.

        Raises RequestError where not exactly one is given, DescriptionError for what is wrong with
        the cell.
        """
        if isinstance(cell, Cell) and not text:
            return self._current.take(cell)
        if isinstance(cell, Cell):
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS, "cell and text are given: give one of them"
            )
        if isinstance(cell, Path) and not is_path(str(cell)):
            cell = cell.absolute()  # a file without an ending is no bundled name
        return self._current.load(text, "" if cell is None else str(cell))

    def set_equipment(
        self,
        name: str,
        *,
        pose: FloatArray | None = None,
        enabled: bool | None = None,
        state: str = "",
    ) -> Cell:
        """Move a machine to a pose (4, 4), switch it on or off, or change its state (None, "":
        unchanged).
        """
        return self._current.set_equipment(name, pose, enabled, state)

    def scene(self, load: str = "") -> PlanningScene:
        """Snapshot of the cell, doors as heard, with `load` attached; "": what is carried, else the
        tool.
        """
        return self._current.scene(load)

    def check_state(
        self,
        q: Place,
        *,
        safety_distance: float = DEFAULT_SAFETY_DISTANCE,
        max_pairs: int = 5,
        load: str = "",
        station: str = "",
    ) -> StateCheck:
        """Nearest pairs at q (n,), and whether all keep S_m (or what `station` allows)."""
        state = self._configuration(q, "state", StatusCode.INVALID_ROBOT_STATE)
        return asked_state(self.scene(load), state, safety_distance, max_pairs, station)

    def check_states(
        self,
        q: FloatArray,
        *,
        safety_distance: float = DEFAULT_SAFETY_DISTANCE,
        load: str = "",
        station: str = "",
    ) -> StatesCheck:
        """Checks of many states q (N, n) [rad], with the nearest pair of each."""
        return asked_states(self.scene(load), q, safety_distance, station)

    def compute_ik(
        self,
        goal: Place,
        *,
        method: str = "analytic",
        safety_distance: float = DEFAULT_SAFETY_DISTANCE,
        near: Place | None = None,
        load: str = "",
        starts: int = 32,
        seed: int = 0,
    ) -> IkAnswer:
        """Free configurations that reach the goal's pose, ranked by W from `near`, None: machine
        home: all of them (analytic), or those that the paper's search finds from random starts
        (ccd).
        """
        chosen(method, IK_METHODS, "method")
        check_safety_distance(safety_distance)
        bounded(starts, 1, STARTS_MAX, "starts")
        here = self._configuration(near, "near", StatusCode.INVALID_ROBOT_STATE)
        options = options_with(None, {"safety_distance": safety_distance, "seed": seed})
        journal = Journal(self._work(PlanOptions(), _NEVER), seed, planner_id=method)
        context = Context(self.scene(load), options, journal)
        return configurations_at(self._goal(goal), here, context, starts, self.settings.interaction)

    def evaluate(
        self,
        trajectory: JointTrajectory,
        *,
        safety_distance: float = DEFAULT_SAFETY_DISTANCE,
        load: str = "",
        station: str = "",
        tilt_max: float = NO_TILT,
        tilt_axis: tuple[float, ...] = (),
        tilt_direction: tuple[float, ...] = (),
        tool_speed: float = 0.0,
        tool_acceleration: float = 0.0,
        whole_tool: bool = False,
    ) -> Evaluation:
        """Everything that is known about a trajectory, with the first violation. station: its
        allowed contacts hold. tilt_max and the others: as in PlanOptions.
        """
        options = options_with(
            None,
            {
                "safety_distance": safety_distance,
                "tilt_max": tilt_max,
                "tilt_axis": tilt_axis,
                "tilt_direction": tilt_direction,
                "tool_speed": tool_speed,
                "tool_acceleration": tool_acceleration,
                "whole_tool": whole_tool,
            },
        )
        options, _ = checked_options(options)
        scene = self.scene(load)
        scene.allowed(station)  # an unknown one is refused here
        trajectory = examinable(trajectory)
        start = trajectory.reordered(scene.cell.robot.joint_names).positions[0]
        options = upright_options(options, scene, start)
        cone = cone_of(options, scene)
        tool = tool_bounds_of(options, scene, station)
        found = evaluate_trajectory(
            trajectory, scene, safety_distance, station, cone=cone, tool=tool
        )
        return evaluation_in(found, trajectory, scene)

    def standby(
        self,
        pause: float | PauseLengths,
        *,
        q: FloatArray | None = None,
        load: str = "",
        postures: tuple[str, ...] = (),
    ) -> Standby:
        """How to spend a pause [s] at q (n,), None: machine home, or at one of the postures."""
        scene = self.scene(load)
        if q is not None:
            q = within_limits(q, scene.cell, "q", StatusCode.INVALID_ROBOT_STATE)
        options = PlanOptions(load=scene.load_text)

        def plan(start: FloatArray, goal: Goal) -> MovementPlan:
            return self.plan_regional(start=start, goal=goal, options=options)

        return standby_at(pause, q, postures, scene, self.heard.transitions, plan)

    def plan_regional(
        self,
        *,
        goal: Place,
        start: Place | None = None,
        start_velocity: FloatArray | None = None,
        start_acceleration: FloatArray | None = None,
        goal_velocity: FloatArray | None = None,
        goal_acceleration: FloatArray | None = None,
        via: Sequence[Place] = (),
        via_tolerance: float = VIA_TOLERANCE,
        via_distance: float = 0.0,
        options: PlanOptions | None = None,
        cancelled: Cancelled = _NEVER,
        **changes: Unpack[OptionFields],
    ) -> MovementPlan:
        """Movement from start (n,), None: machine home, to a goal; a pose is reached in the
        configuration that serves best.

        It starts and ends with the velocities (n,) rad/s and accelerations (n,) rad/s^2, None: at
        rest; a goal in motion is a configuration.

        via: places that are passed in this order, without a stop where that is better: every joint
        within via_tolerance [rad], or the tcp within via_distance [m] above 0 and its orientation
        within via_tolerance. Raises RequestError for a request that makes no sense; that nothing is
        found is a status.
        """
        options, note = self._checked(options_with(options, changes))
        scene = self.scene(options.load)
        begin = self._configuration(start, "start", StatusCode.START_STATE_INVALID)
        end = self._goal(goal)
        context = Context.of(scene, options, self._work(options, cancelled))
        context = context.leaning_by(_tilt_to(end, scene))
        motion = motion_of(
            (start_velocity, start_acceleration),
            (goal_velocity, goal_acceleration),
            end,
            scene.cell,
        )
        searches = self.settings.searches
        places = Via(self._places(via), via_tolerance, via_distance)
        if places.places and motion is not None:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"via has {len(places.places)} places and the start or the goal is in motion: a "
                "movement past places starts and ends at rest",
            )
        if places.places:

            def fresh() -> Context:
                asked = Context.of(scene, options, self._work(options, cancelled))
                return asked.leaning_by(_tilt_to(end, scene))

            search = ViaSearch(begin, places, end, fresh(), fresh, searches)
            return self._kept(search.plan(), scene, note)
        context = context.in_motion(motion)
        return self._kept(plan_to_goal(begin, end, context, searches), scene, note)

    def replan(
        self,
        driven: JointTrajectory | str,
        at: float,
        *,
        goal: Place,
        options: PlanOptions | None = None,
        cancelled: Cancelled = _NEVER,
        **changes: Unpack[OptionFields],
    ) -> MovementPlan:
        """Movement to a goal that starts on a trajectory that is driven, or on the one behind an
        id, in its motion at its time `at` [s]: `driven.until(at).then(plan.trajectory)` is one
        motion.
        """
        trajectory = self.trajectories.get(driven) if isinstance(driven, str) else driven
        motion = motion_on(trajectory, at, self.cell)
        return self.plan_regional(
            goal=goal,
            start=motion.q[0],
            start_velocity=motion.qd[0],
            start_acceleration=motion.qdd[0],
            options=options,
            cancelled=cancelled,
            **changes,
        )

    def plan_escape(
        self,
        start: Place,
        *,
        station: str = "",
        options: PlanOptions | None = None,
        cancelled: Cancelled = _NEVER,
        **changes: Unpack[OptionFields],
    ) -> EscapePlan:
        """A slow way from a start (n,) that is too near to something, in it or beyond a limit, on
        which nothing gets worse. station: its allowed contacts hold. Raises RequestError for a
        start that is a pose.
        """
        options, note = checked_options(options_with(options, changes))
        leaning_freely_only(options, "a way out")
        scene = self.scene(options.load)
        scene.allowed(station)  # an unknown one is refused here
        if isinstance(start, str):
            begin = joints_of(start, self.cell, "start", _START)
            start = self._configuration(start, "start", _START) if begin is None else begin
        q = start.configuration if isinstance(start, Goal) else start
        if q is None:
            raise RequestError(_START, "start is a pose: joint values or a posture must be given")
        context = Context.of(scene, options, self._work(options, cancelled), station)
        return self._kept(plan_escape(q, context), scene, note)

    def plan_service(
        self,
        station: str,
        *,
        direction: str = "exit",
        configuration: FloatArray | None = None,
        near: Place | None = None,
        max_candidates: int = 3,
        options: PlanOptions | None = None,
        cancelled: Cancelled = _NEVER,
        **changes: Unpack[OptionFields],
    ) -> ServicePlan:
        """Movements out of a station ("exit") or into it ("entry"). configuration (n,): there,
        None: the best; near (n,): where its cost counts from, None: machine home.
        """
        options = options_with(options, changes)
        method = known_method(options.planner_id)
        options, note = checked_options(replace(options, planner_id=""))
        checked_request(direction, max_candidates)
        scene = self.scene(options.load)
        here = self._configuration(near, "near", StatusCode.INVALID_ROBOT_STATE)
        if configuration is not None:
            configuration = within_limits(
                configuration, scene.cell, "configuration", StatusCode.INVALID_ROBOT_STATE
            )
        request = ServiceRequest(
            scene.station(station), direction, configuration, here, max_candidates
        )
        options = replace(options, planner_id=method)
        context = Context(scene, options, Journal(self._work(options, cancelled), options.seed))
        plan = plan_service(request, context, exit_searches(self.settings.withdrawal))
        for candidate in plan.candidates:
            if candidate.trajectory is not None:
                self.trajectories.add(candidate.trajectory)
        return service_in(plan, scene, note)

    def plan_trajectory(
        self,
        reference: Reference,
        *,
        options: PlanOptions | None = None,
        cancelled: Cancelled = _NEVER,
        **changes: Unpack[OptionFields],
    ) -> MovementPlan:
        """Trajectory through points."""
        options, note = self._checked(options_with(options, changes))
        leaning_freely_only(options, "a trajectory through points")
        scene = self.scene(options.load)
        plan = plan_through(reference, scene, options, self._work(options, cancelled))
        return self._kept(plan, scene, note)

    def plan_cartesian(
        self,
        path: AnyPath | str,
        *,
        start: FloatArray | None = None,
        t1: bool = False,
        options: PlanOptions | None = None,
        cancelled: Cancelled = _NEVER,
        **changes: Unpack[OptionFields],
    ) -> CartesianPlan:
        """The tool along a path, or along the one of the cell with this name, from `start` (n,),
        None: from the best. t1: at most 250 mm/s.
        """
        options, note = checked_path_options(options_with(options, changes))
        scene = self.scene(options.load)
        known = [one.name for one in scene.cell.paths]
        if isinstance(path, str) and path not in known:
            raise unknown_name("path", path, known)
        drawn_path = scene.cell.path(path) if isinstance(path, str) else path
        name, segments = (
            (drawn_path.name, drawn_path.path)
            if isinstance(drawn_path, CellPath)
            else ("", drawn_path)
        )
        context = Context.of(scene, options, self._work(options, cancelled), name)
        return self._kept(plan_path(segments, start, t1, context), scene, note)

    def optimize_trajectory(
        self,
        trajectory: JointTrajectory,
        *,
        options: PlanOptions | None = None,
        cancelled: Cancelled = _NEVER,
        **changes: Unpack[OptionFields],
    ) -> OptimizationPlan:
        """A trajectory made cheaper between its end points, with the trade of time for energy."""
        options, note = self._checked(options_with(options, changes))
        scene = self.scene(options.load)
        original = trajectory.reordered(scene.cell.robot.joint_names)
        work = self._work(options, cancelled)
        plan = optimize_trajectory(
            examinable(original), scene, options, work, self.settings.searches
        )
        for point in plan.front:
            self.trajectories.add(point.trajectory)
        if plan.trajectory is not None:
            self.trajectories.add(plan.trajectory)
        return optimization_in(plan, original, scene, note)

    def plan_program(
        self,
        *,
        stations: tuple[str, ...] = (),
        cycle_time: float = 0.0,
        start: Place | None = None,
        options: PlanOptions | None = None,
        progress: Progress = nobody,
        cancelled: Cancelled = _NEVER,
        savings: bool = False,
        front_points: int = 0,
        blend: float = AS_THE_CELL_SAYS,
        **changes: Unpack[OptionFields],
    ) -> ProgramPlan:
        """The cell's program, or a visit of `stations`, from start (n,), None: where it ends, as
        the next cycle follows in production (`Cell.cycle_start`).

        cycle_time [s]: 0 = as it costs least. savings: hold it against the common program.
        front_points: so many programs over the cycle time. blend [m]: how near stops and outer ends
        of their lines are passed where nothing happens, -1: as stations say; steps say it first.
        progress: called with phase, done, total and the best cost.
        """
        options, note = self._checked(options_with(options, changes))
        cell = self.cell
        begin = self._configuration(
            cell.cycle_start(stations) if start is None else start,
            "start",
            StatusCode.START_STATE_INVALID,
        )
        request = ProgramRequest(
            cell=cell,
            power=self._current.power(cell),
            stations=tuple(stations),
            start=begin,
            options=options,
            cycle_time=bounded(cycle_time, 0.0, 604_800.0, "cycle_time", "s"),
            settings=replace(self.settings, transitions=self.heard.transitions),
            savings=savings,
            front_points=front_points,
            doors=self.heard.doors(cell),
            blend=blend,
        )
        spreads = Spreads(request)
        stops = max(len(stations or cell.program), 1)  # the ceilings are those of one movement
        plan = plan_program(request, self._work(options, cancelled, stops), progress, spreads)
        plan = program_in(plan, self._current.hash_of(cell), self.heard.source, spreads)
        for program in (*plan.front, plan.compared, plan):
            if program is not None and program.status.ok:
                self.remember(program)
        return replace(plan, info=noted(plan.info, note))

    def plan_steady_cycle(
        self,
        *,
        parts_per_hour: float = 0.0,
        options: PlanOptions | None = None,
        cancelled: Cancelled = _NEVER,
        saving: bool = False,
        front_points: int = 0,
        cycles: int = 0,
        units: int = 1,
        **changes: Unpack[OptionFields],
    ) -> "flexible.SteadyPlan":
        """The cheapest cycle of the cell's route that makes at least so many parts an hour, 0: as
        many as possible. saving: hold it against the common cycle; front_points: so many cycles
        from the fastest to the cheapest; cycles: also the run that fills the line from empty and
        makes so many; units: parts a cycle at most. Where a machine holds several parts, which
        use its slots in turn, the program is as many cycles as it takes until all were used.
        """
        options, note = self._checked(options_with(options, changes))
        request, work = self._cycle_request(options, cancelled)
        plan = flexible.plan_steady_cycle(
            request,
            parts_per_hour,
            work,
            saving=saving,
            front_points=front_points,
            cycles=cycles,
            units=units,
        )
        if plan.program is not None and plan.request is not None:
            own = plan.request
            plan = replace(plan, program=self.kept_program(plan.program, own))
            if plan.run is not None and plan.run_cell is not None:
                run_request = replace(own, cell=plan.run_cell)
                plan = replace(plan, run=self.kept_program(plan.run, run_request))
        return replace(plan, info=noted(plan.info, note))

    def cycle_request(
        self, options: PlanOptions | None = None, cancelled: Cancelled = _NEVER
    ) -> tuple[ProgramRequest, Work]:
        """What is asked for a cycle of the cell's program or route, from its park posture on."""
        return self._cycle_request(self._checked(options or PlanOptions())[0], cancelled)

    def kept_program(self, program: ProgramPlan, request: ProgramRequest) -> ProgramPlan:
        """A program in the cell of its request with what it is certified by; it is stored."""
        spreads = Spreads(request)
        program = program_in(program, cell_hash(request.cell), self.heard.source, spreads)
        self.remember(program)
        return program

    def _cycle_request(
        self, options: PlanOptions, cancelled: Cancelled
    ) -> tuple[ProgramRequest, Work]:
        cell = self.cell
        request = ProgramRequest(
            cell=cell,
            power=self._current.power(cell),
            stations=(),
            start=cell.park,
            options=options,
            settings=replace(self.settings, transitions=self.heard.transitions),
            doors=self.heard.doors(cell),
        )
        stops = 3 * len(cell.route.visits) if cell.route is not None else len(cell.program)
        return request, self._work(options, cancelled, max(stops, 1))

    def _goal(self, goal: Place, what: str = "goal") -> Goal:
        """The goal as a value, joint values within their limits. Raises RequestError, which names
        `what`.
        """
        if isinstance(goal, str):
            return parse_goal(goal, self.cell, what)
        if not isinstance(goal, Goal):
            goal = Goal(pose=goal) if np.shape(goal) == (4, 4) else Goal(configuration=goal)
        if goal.configuration is None:
            _check_pose(goal, what)
            return goal
        code = StatusCode.GOAL_STATE_INVALID
        q = within_limits(goal.configuration, self.cell, what, code)
        return replace(goal, configuration=q)

    def _places(self, via: Sequence[Place]) -> tuple[Goal, ...]:
        """Places on the way as values. Raises RequestError, which names the place."""
        return tuple(self._goal(place, f"via {k}") for k, place in enumerate(via, start=1))

    def _configuration(self, place: Place | None, what: str, code: StatusCode) -> FloatArray:
        """Joint values (n,) of a posture, a text or an array, None: machine home. Raises
        RequestError.
        """
        if place is None:
            return np.array(self.cell.machine_home)
        if isinstance(place, str):
            place = parse_goal(place, self.cell, what, code)
        q = place.configuration if isinstance(place, Goal) else place
        if q is None:
            raise RequestError(
                code, f"{what} is a pose: joint values or a posture must be given, see compute_ik"
            )
        return within_limits(q, self.cell, what, code)

    def remember(self, plan: ProgramPlan) -> None:
        """Keep a program and its trajectories by their ids."""
        for movement in plan.movements:
            if movement.trajectory is not None:
                self.trajectories.add(movement.trajectory)
        self.programs.add(StoredProgram(plan.program_id, plan.movements, plan.report))

    def _kept(self, plan: AnyMovement, scene: PlanningScene, note: str) -> AnyMovement:
        if plan.trajectory is not None:
            self.trajectories.add(plan.trajectory)
        return movement_in(plan, scene, note)

    def _checked(self, options: PlanOptions) -> tuple[PlanOptions, str]:
        chosen(options.planner_id, ("", *self.settings.searches), "planner_id")
        return checked_options(options)

    def _work(self, options: PlanOptions, cancelled: Cancelled, movements: int = 1) -> Work:
        most = (options.max_iterations or self.settings.max_iterations) * movements
        improvement = options.max_iterations or self.settings.improvement_iterations
        deadline = self.clock() + options.planning_time * movements
        return Work(most, deadline, self.clock, cancelled, improvement)


def _check_pose(goal: Goal, what: str) -> None:
    """Raises RequestError, which names `what`, where a goal's pose is none."""
    try:
        rigid_pose(np.asarray(goal.pose), what)
    except KernelError as error:
        raise RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, str(error)) from error


def _tilt_to(goal: Goal, scene: PlanningScene) -> ToolTilt | None:
    """How far the tool may lean on a movement to a goal, by its station and what is held."""
    held = {load.name for load in scene.loads}
    tilts = {f"part {part.name}": part.tilt for part in scene.cell.parts if part.name in held}
    if goal.station:
        tilts[f"station {goal.station}"] = scene.station(goal.station).tilt
    return one_tilt(tilts, f"the movement to {goal.station or 'the goal'}")
