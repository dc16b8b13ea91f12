"""The planner as a whole, without ROS: the cell as it stands, what is attached, and what was
planned.

Every request takes one immutable snapshot of the cell; changing the cell meanwhile reaches the next
one.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from ir_description import Cell, CellPath, PowerData
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import CartesianPath
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.cartesian import CartesianPlan, checked_path_options, plan_path
from ir_planner.certificates import (
    AnyMovement,
    evaluation_in,
    movement_in,
    optimization_in,
    program_in,
    service_in,
)
from ir_planner.checks import Evaluation, StateCheck, evaluate_trajectory
from ir_planner.configurations import (
    IK_METHODS,
    STARTS_MAX,
    IkAnswer,
    configurations_at,
)
from ir_planner.current_cell import CurrentCell, Heard, ReadCell, read_cell_here
from ir_planner.program import (
    Lengths,
    ProgramPlan,
    ProgramRequest,
    Progress,
    Spreads,
    Standby,
    nobody,
    plan_program,
)
from ir_planner.regional import MovementPlan, plan_to_goal
from ir_planner.request import (
    Clock,
    Context,
    Goal,
    Journal,
    Work,
    bounded,
    checked_options,
    chosen,
    examinable,
    noted,
    safety_distance,
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
from ir_planner.trajectories import OptimizationPlan, Reference, optimize_trajectory, plan_through
from ir_planner.waiting_postures import standby_at

AnyPath = CartesianPath | CellPath  # a cell's own comes with what it allows to touch
Cancelled = Callable[[], bool]
_NEVER: Cancelled = lambda: False  # noqa: E731 - a default argument


class Planner:
    """Answers requests about one cell. Methods raise RequestError for requests that make no sense.

    clock: seconds, only for ceilings and for the times that answers report. power: the controller's
    figures,
    None: those of the cell's robot. read_cell: what reads cells.
    """

    def __init__(
        self,
        clock: Clock,
        settings: PlannerSettings | None = None,
        power: PowerData | None = None,
        read_cell: ReadCell = read_cell_here,
    ) -> None:
        self.clock = clock
        self.settings = settings or PlannerSettings()
        self.heard = Heard(lambda: self.settings.transitions)
        self._current = CurrentCell(self.heard, lambda: self.settings.drives, power, read_cell)
        megabytes = self.settings.stored_megabytes
        self.trajectories = trajectory_store(self.settings.stored_trajectories, megabytes)
        self.programs = program_store(self.settings.stored_programs, megabytes)

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

    def set_cell(self, cell_yaml: str, cell_file: str) -> Cell:
        """Load a cell from its text, or from a path or the name of a bundled cell.

        Raises RequestError where not exactly one is given, DescriptionError for what is wrong with
        the cell.
        """
        return self._current.load(cell_yaml, cell_file)

    def set_equipment(self, name: str, pose: FloatArray | None, enabled: bool, state: str) -> Cell:
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
        self, q: FloatArray, margin: float, max_pairs: int, load: str, station: str
    ) -> StateCheck:
        """Nearest pairs at q (n,), and whether all keep S_m (or what `station` allows)."""
        return asked_state(self.scene(load), q, margin, max_pairs, station)

    def check_states(self, q: FloatArray, margin: float, load: str, station: str) -> StatesCheck:
        """The same for many states q (N, n), with the nearest pair of each."""
        return asked_states(self.scene(load), q, margin, station)

    def compute_ik(
        self,
        goal: Goal,
        method: str,
        margin: float,
        near: FloatArray,
        load: str,
        starts: int = 32,
        seed: int = 0,
    ) -> IkAnswer:
        """Free configurations that reach the goal's pose, ranked by W from `near` (n,): all of them
        (analytic), or those that the paper's search finds from random starts (ccd).
        """
        chosen(method, IK_METHODS, "method")
        safety_distance(margin)
        bounded(starts, 1, STARTS_MAX, "starts")
        journal = Journal(self._work(PlanOptions(), _NEVER), seed, planner_id=method)
        context = Context(self.scene(load), PlanOptions(safety_distance=margin, seed=seed), journal)
        return configurations_at(goal, near, context, starts, self.settings.interaction)

    def evaluate(
        self, trajectory: JointTrajectory, margin: float, load: str, station: str
    ) -> Evaluation:
        """Everything that is known about a trajectory, with the first violation."""
        safety_distance(margin)
        scene = self.scene(load)
        scene.allowed(station)  # one that nobody has is refused here
        found = evaluate_trajectory(examinable(trajectory), scene, margin, station)
        return evaluation_in(found, trajectory, scene)

    def standby(
        self,
        pause: float | Lengths,
        q: FloatArray | None,
        load: str,
        postures: tuple[str, ...] = (),
    ) -> Standby:
        """How to spend a pause [s] at q (n,), None: machine home, or at one of the postures."""
        scene = self.scene(load)
        options = PlanOptions(load=scene.load_text)
        plan = partial(self.plan_regional, options=options)
        return standby_at(pause, q, postures, scene, self.heard.transitions, plan)

    def plan_regional(
        self, start: FloatArray, goal: Goal, options: PlanOptions, cancelled: Cancelled = _NEVER
    ) -> MovementPlan:
        """Movement from start (n,) to a goal; a pose is reached in the configuration that serves
        best.
        """
        options, note = self._checked(options)
        scene = self.scene(options.load)
        start = within_limits(start, scene.cell, "start", StatusCode.START_STATE_INVALID)
        context = Context.of(scene, options, self._work(options, cancelled))
        return self._kept(plan_to_goal(start, goal, context, self.settings.searches), scene, note)

    def plan_service(
        self,
        station: str,
        direction: str,
        configuration: FloatArray | None,
        near: FloatArray,
        max_candidates: int,
        options: PlanOptions,
        cancelled: Cancelled = _NEVER,
    ) -> ServicePlan:
        """Movements out of a station or into it. configuration (n,): there, None: the best; near
        (n,): where its cost counts from.
        """
        method = known_method(options.planner_id)
        options, note = checked_options(replace(options, planner_id=""))
        checked_request(direction, max_candidates)
        scene = self.scene(options.load)
        if configuration is not None:
            configuration = within_limits(
                configuration, scene.cell, "configuration", StatusCode.INVALID_ROBOT_STATE
            )
        request = ServiceRequest(
            scene.station(station), direction, configuration, near, max_candidates
        )
        options = replace(options, planner_id=method)
        context = Context(scene, options, Journal(self._work(options, cancelled), options.seed))
        plan = plan_service(request, context, exit_searches(self.settings.withdrawal))
        for candidate in plan.candidates:
            if candidate.trajectory is not None:
                self.trajectories.add(candidate.trajectory)
        return service_in(plan, scene, note)

    def plan_trajectory(
        self, reference: Reference, options: PlanOptions, cancelled: Cancelled = _NEVER
    ) -> MovementPlan:
        """Trajectory through points."""
        options, note = self._checked(options)
        scene = self.scene(options.load)
        plan = plan_through(reference, scene, options, self._work(options, cancelled))
        return self._kept(plan, scene, note)

    def plan_cartesian(
        self,
        path: AnyPath,
        options: PlanOptions,
        start: FloatArray | None = None,
        *,
        t1: bool = False,
    ) -> CartesianPlan:
        """The tool along a path from `start` (n,), None: from the best. t1: at most 250 mm/s."""
        options, note = checked_path_options(options)
        scene = self.scene(options.load)
        name, path = (path.name, path.path) if isinstance(path, CellPath) else ("", path)
        context = Context.of(scene, options, self._work(options, _NEVER), name)
        return self._kept(plan_path(path, start, t1, context), scene, note)

    def optimize_trajectory(
        self,
        trajectory: JointTrajectory,
        options: PlanOptions | None = None,
        cancelled: Cancelled = _NEVER,
    ) -> OptimizationPlan:
        """A trajectory made cheaper between its end points, with the trade of time for energy."""
        options, note = self._checked(options or PlanOptions())
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
        stations: tuple[str, ...],
        cycle_time: float,
        options: PlanOptions,
        start: FloatArray,
        progress: Progress = nobody,
        cancelled: Cancelled = _NEVER,
        *,
        savings: bool = False,
        front_points: int = 0,
    ) -> ProgramPlan:
        """The cell's program, or a visit of stations, from start (n,); its `ProgramRequest` says
        the rest.
        """
        options, note = self._checked(options)
        cell = self.cell
        start = within_limits(start, cell, "start", StatusCode.START_STATE_INVALID)
        cycle = bounded(cycle_time, 0.0, 604_800.0, "cycle_time", "s")
        data = self._current.power(cell)
        settings = replace(self.settings, transitions=self.heard.transitions)
        asked = (
            stations,
            start,
            options,
            cycle,
            settings,
            savings,
            front_points,
            self.heard.doors(cell),
        )
        request = ProgramRequest(cell, data, *asked)
        spreads = Spreads(request)
        stops = max(len(stations or cell.program), 1)  # the ceilings are those of one movement
        plan = plan_program(request, self._work(options, cancelled, stops), progress, spreads)
        plan = program_in(plan, self._current.hash_of(cell), self.heard.source, spreads)
        for program in (*plan.front, plan.compared, plan):
            if program is not None and program.status.ok:
                self._remember(program)
        return replace(plan, info=noted(plan.info, note))

    def _remember(self, plan: ProgramPlan) -> None:
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
