"""The simulation: PLC, power modes, executor, physics and mains meter, stepped together.

One `step` is dt of plant time. The caller decides how fast time passes. No ROS.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ir_description import Cell, PowerData, load_cell
from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.modes import OFF_THE_NETWORK, READY, Mode
from ir_msgs_py.plc import OperatingMode, PlcOutputs
from ir_msgs_py.status import StatusCode
from ir_msgs_py.stop_numbers import same_driver, stop_count
from ir_sim_driver.controller.contacts import CellWatch
from ir_sim_driver.controller.goal_checks import VettedGoal, vet
from ir_sim_driver.controller.mains import Mains
from ir_sim_driver.controller.mode_control import ModeControl
from ir_sim_driver.controller.safety import Safety
from ir_sim_driver.controller.settings import SimulationSettings
from ir_sim_driver.controller.supervision import PERIOD
from ir_sim_driver.controller.surroundings import MovedSurroundings
from ir_sim_driver.errors import (
    BackendError,
    DriverError,
    RequestRefusedError,
    TrajectoryRefusedError,
)
from ir_sim_driver.load_check import LoadChecks
from ir_sim_driver.motion import (
    TOOL_SPEED,
    ErrorCode,
    ExecutionSettings,
    Executor,
    GoalOutcome,
    Path,
    ToolPoint,
    TrajectoryGoal,
    manual_scaling,
)
from ir_sim_driver.notices import Level, Notices
from ir_sim_driver.plant import (
    IDEAL,
    NOMINAL,
    Backend,
    Carried,
    Plant,
    carried,
    ideal_plant,
    make_backend,
    nominal_plant,
    plant_named,
)
from ir_sim_driver.plc import Plc, Watchdog
from ir_sim_driver.power import IdleTimes, charging_of
from ir_values.arrays import FloatArray

# Outcomes of goals: energy, load finding and contact.


class Outcomes:
    """Of the goals of `executor`; energy is what `mains` counts while they run."""

    def __init__(
        self, executor: Executor, mains: Mains, cell_watch: CellWatch, load_checks: LoadChecks
    ) -> None:
        self._executor = executor
        self._mains = mains
        self._cell_watch = cell_watch
        self._load_checks = load_checks
        self._goals = 0
        self._energy = 0.0
        self._ended: list[GoalOutcome] = []

    def next_id(self) -> int:
        """Id of the goal that starts now."""
        self._goals += 1
        return self._goals

    def started(self) -> None:
        """A goal has started; the one before has ended."""
        self.collect()
        self._energy = self._mains.energy()

    def collect(self) -> None:
        """Take what has ended; a goal that ended by a contact when the robot stands."""
        if not self._executor.ended or self._cell_watch.unsettled:
            return
        for outcome in self._executor.take_outcomes():
            energy = self._mains.energy() - self._energy
            self._ended.append(self._completed(replace(outcome, energy=energy)))

    def _completed(self, outcome: GoalOutcome) -> GoalOutcome:
        contact = self._cell_watch.last
        if (
            outcome.code is ErrorCode.CONTACT and contact is not None
        ):  # its torques are not the load's
            self._load_checks.begin()
            return replace(outcome, contact=contact, sentence=contact.sentence)
        return outcome.weighed(self._load_checks.ended(outcome.label))

    def take(self) -> list[GoalOutcome]:
        """Goals that ended since the last call."""
        ended = self._ended
        self._ended = []
        return ended


# Speed scaling: the factor that was asked for, move_enable, and the tool's speed in T1.


_KEPT = 0.98  # of the path speed: what T1 keeps of the tool's speed in hand covers the rest


class SpeedScaling:
    """Of what `executor` follows. factor: what was asked for, in [0, 1]."""

    def __init__(self, executor: Executor, tool: ToolPoint, plc: Plc, notices: Notices) -> None:
        self._executor = executor
        self._tool = tool
        self._plc = plc
        self._notices = notices
        self.factor = 1.0

    def ask(self, factor: float) -> float:
        """Take the factor into [0, 1] and return it; NaN and negative ones are ignored with a
        warning.
        """
        if not factor >= 0.0:
            self._notices.add(Level.WARN, f"speed scaling {factor:g} ignored: it must be in [0, 1]")
        else:
            self.factor = min(factor, 1.0)
        return self.factor

    def holds(self) -> str:
        """Why path time stands; "" where it may pass."""
        if not self._plc.levels.move_enable:
            return "the PLC's move_enable is 0"
        return "" if self.factor > 0.0 else "the speed scaling is 0"

    def check_change(self, path: Path, joined: bool) -> None:
        """Raise TrajectoryRefusedError where a moving robot can't go over to a path in T1: the tool
        would be too fast before the robot has slowed down. joined: at the present path speed.
        """
        if self._plc.operating_mode is not OperatingMode.T1:
            return
        speed = self._executor.path_speed if joined else 1.0
        allowed = manual_scaling(self._tool, path, 0.0, self._executor.stop_time)
        if allowed < _KEPT * speed:
            raise TrajectoryRefusedError(
                ErrorCode.INVALID_GOAL,
                f"the robot moves, and on its way over to the trajectory the tool would pass "
                f"{TOOL_SPEED * 1e3:g} mm/s (T1): send it when the robot stands, or slower",
            )

    def now(self) -> float:
        """The factor that counts now."""
        if not self._plc.levels.move_enable:
            return 0.0
        path = self._executor.path
        if path is None or self._plc.operating_mode is not OperatingMode.T1:
            return self.factor
        s = self._executor.path_parameter
        stop_time = self._executor.stop_time
        return min(self.factor, manual_scaling(self._tool, path, s, stop_time))


_HOME = 0.01  # rad off machine home that still count as there


class Simulation:
    """A cell's robot and controller; backend: a robot of `plant` (default: the nominal one), same
    dt.

    Raises nothing in `step`: a backend that fails is stopped, named in `notices`, and restarted by
    `recover`.
    """

    def __init__(
        self,
        cell: Cell,
        data: PowerData,
        backend: Backend,
        load: Carried,
        settings: SimulationSettings | None = None,
        plant: Plant | None = None,
    ) -> None:
        settings = settings or SimulationSettings()
        self.settings = settings
        self.cell = cell
        self.robot = cell.robot
        self.backend = backend
        self.surroundings = MovedSurroundings(cell)
        self.notices = Notices()
        self.watch = Watchdog()
        home = np.array(cell.machine_home)
        backend.reset(home)
        self.dynamics = DynamicsModel(self.robot, (), cell.base_pose)
        self.plant = plant or nominal_plant(cell.robot, data)
        self.mains = Mains(
            self.plant, data, backend, settings.dt, settings.controller.regeneration_mode
        )
        self.plc = Plc(
            settings.plc,
            self.notices,
            settings.controller.mode_switch,
            settings.before_first_stop,
        )
        pe_ids = {Mode[mode.name]: mode.pe_mode_id for mode in data.modes}
        charging = charging_of(data.dc_link)
        self.control = ModeControl(settings, self.plc, self.standing_power, pe_ids, charging)
        self.modes = self.control.modes
        self.pauses = self.control.pauses
        self.tool = ToolPoint(cell.robot, cell.base_pose, cell.tcp)
        self.executor = Executor(
            self.robot, self.dynamics, self.tool, settings.execution, settings.dt, home
        )
        self.safety = Safety(
            self.robot, backend, self.executor, self.tool, self.plc, self.notices, settings
        )
        self.load_checks = LoadChecks(cell, settings.load_check, self.notices, PERIOD * settings.dt)
        self._carry(load)
        self.speed_scaling = SpeedScaling(self.executor, self.tool, self.plc, self.notices)
        self.steps = 0
        self.cell_watch = CellWatch(
            cell, load, self.tool, backend, self.notices, settings.dt, lambda: self.time
        )
        self._outcomes = Outcomes(self.executor, self.mains, self.cell_watch, self.load_checks)

    @property
    def time(self) -> float:
        """Plant time [s] since the start."""
        return self.steps * self.settings.dt

    @property
    def on_the_network(self) -> bool:
        """Whether the controller answers; the mains meter always does."""
        return self.modes.mode not in OFF_THE_NETWORK

    @property
    def stands(self) -> bool:
        """Whether the robot stands and nothing waits to move it."""
        return self._is_still() and not self.executor.active

    @property
    def stopped(self) -> bool:
        """Whether an emergency stop or a fault is latched: nothing moves until somebody
        recovers.
        """
        return self.safety.stopped

    @property
    def stop_number(self) -> int:
        """Number of the last stop; nothing of before it, or of another driver process, moves any
        more.
        """
        return self.plc.stop.number

    @property
    def fault(self) -> str:
        """Why the robot is stopped, "" when it is not or by the emergency stop."""
        return self.safety.fault

    # -- what may be asked ------------------------------------------------------------------------

    def vet(self, goal: TrajectoryGoal, now_ns: int) -> VettedGoal:
        """Check all of a goal that does not depend on the robot's state; may run beside `step`.

        Raises TrajectoryRefusedError.
        """
        return vet(
            goal, self.robot, self.dynamics, self.settings.execution, now_ns, self.cell_watch.asked
        )

    def execute(self, vetted: VettedGoal, now_ns: int) -> int:
        """Start a vetted goal, return its id; preempts the one that runs. Raises
        TrajectoryRefusedError.
        """
        goal = vetted.goal
        refusal = self.refusal() or self.surroundings.refusal(goal, self.load)
        if not refusal and goal.after_stop is not None and goal.after_stop != self.stop_number:
            refusal = stale(goal.after_stop, self.stop_number)
        if refusal := refusal or self.cell_watch.refusal(goal, vetted.keep.scene):
            raise TrajectoryRefusedError(ErrorCode.INVALID_GOAL, refusal)
        now = self.executor.motion()
        delay = vetted.delay(now_ns)
        driven = self.executor.driven
        route = vetted.route(now, self.robot, self.dynamics, self.settings.execution, delay, driven)
        moves = route.joined or bool(now.qd.any())
        if moves:
            self.speed_scaling.check_change(route.path, route.joined)
        wait = 0.0 if moves else max(0.0, delay - route.offset)
        goal_id = self._outcomes.next_id()
        self.executor.start(goal_id, goal, route, wait)
        self.cell_watch.begin(goal.station)
        self._outcomes.started()
        self.load_checks.begin()
        return goal_id

    def cancel(self, goal_id: int) -> bool:
        """Stop this goal along its path; False when it does not run."""
        if self.executor.goal_id != goal_id:
            return False
        self.executor.stop(ErrorCode.SUCCESSFUL, "canceled", canceled=True)
        return True

    def abort(self, sentence: str) -> None:
        """Stop whatever runs along its path, for this reason."""
        self.executor.stop(ErrorCode.INVALID_GOAL, sentence)

    def take_outcomes(self) -> list[GoalOutcome]:
        """Goals that ended since the last call."""
        return self._outcomes.take()

    def set_speed_scaling(self, factor: float) -> float:
        """Scale the speed of every movement, from now on; returns what counts of the factor."""
        return self.speed_scaling.ask(factor)

    def standing_power(self, level: Mode) -> float:
        """Watts at the mains when standing in a mode at the present posture."""
        return self.mains.standing_power(level, self.dynamics)

    def set_load(self, load: Carried, cell: Cell | None = None) -> None:
        """Carry this from now on, and stand in another cell where one is given. Raises
        RequestRefusedError while the robot moves.
        """
        if not self.stands:
            raise RequestRefusedError(
                StatusCode.INVALID_ROBOT_STATE,
                "the robot moves: a load changes only while it stands",
            )
        self.mains.settle()
        before = self.load
        watch = self.cell_watch
        arrange = watch.carry if cell is None else partial(watch.stand_in, cell)
        try:
            self._carry(load)
            arrange(load)
        except Exception as error:  # whatever it is: the old load stays
            self._carry(before)
            arrange(before)
            if isinstance(error, DriverError):
                raise
            raise RequestRefusedError(
                StatusCode.INVALID_ROBOT_STATE, f"load {load.text!r} can't be carried: {error!r}"
            ) from error

    def set_execution(self, settings: ExecutionSettings) -> None:
        """Use other bounds of trajectories from the next goal on."""
        self.settings = replace(self.settings, execution=settings)
        self.executor.set_settings(settings)

    def wake(self) -> None:
        """Wake the controller; does nothing unless it hibernates."""
        if self.modes.mode is Mode.HIBERNATION:
            self.control.latches.wake = True

    def recover(self) -> str:
        """Leave the emergency stop: release the brakes where the robot stands, move and resume
        nothing.

        Returns what was done; a stop between two steps is acted upon first. Raises
        RequestRefusedError.
        """
        if not self.stopped:
            if self.modes.mode is Mode.EMERGENCY_STOP:
                number = stop_count(self.stop_number)
                return f"nothing to recover from: stop {number} is recovered, the brakes open"
            return f"nothing to recover from: the mode is {self.modes.mode.name}"
        self.heed_stop()
        self.safety.recover()
        self.cell_watch.recovered()
        if self.modes.mode is not Mode.EMERGENCY_STOP:
            return f"the emergency stop is reset; the mode is {self.modes.mode.name}"
        self.control.latches.recover = True
        return "the brakes open where the robot stands; nothing resumes"

    def disturb(self, torque: FloatArray | None) -> None:
        """Let an outside torque (n,) [Nm] act on the joints from now on; None: nothing more."""
        self.backend.disturbance = torque

    def outputs(self) -> PlcOutputs:
        """Levels to the PLC; all off while the controller is off the network."""
        off_home = float(np.abs(self.backend.q - self.cell.machine_home).max())
        return self.control.outputs(in_home=off_home < _HOME)

    def step(self) -> None:
        """Let dt pass."""
        self._listen()
        self._change_mode(self.settings.dt)
        try:
            self._move()
            if self.steps >= self.cell_watch.due:
                self.cell_watch.look(self.steps, self.executor, self.dynamics, self.safety)
            if self.steps % PERIOD == 0:
                self._supervise()
        except BackendError as error:
            self.safety.failed(error)
        self.mains.step(self.modes.level, standing=self.modes.mode is not Mode.MOVING)
        self._outcomes.collect()
        self.steps += 1

    def run(self, seconds: float) -> None:
        """Step until `seconds` have passed."""
        for _ in range(round(seconds / self.settings.dt)):
            self.step()

    def _listen(self) -> None:
        """Take what the PLC has said, and whether it is still there."""
        if self.plc.step(self.settings.dt, self.pauses.active):
            sentence = self.control.react_to_plc()
            if sentence:
                self.abort(sentence)
        if self.watch.step(self.time):
            self.notices.add(Level.WARN, f"{self.watch.lost}; stopped on the path until it is back")
            self.abort(self.watch.lost)

    def heed_stop(self) -> None:
        """Act at once on an emergency stop that was pressed between two steps."""
        if self.stopped:
            self._change_mode(0.0)

    def _change_mode(self, dt: float) -> None:
        executor = self.executor
        control = self.control
        active = executor.active
        if active:
            sentence = control.interruption()
            if sentence:
                self.abort(sentence)
        changed = control.step(
            dt,
            motion=active
            and (executor.path_speed > 0.0 or executor.stopping or self.speed_scaling.now() > 0.0),
            standing=self._is_still(),
            emergency=self.safety.stopped,
        )
        if changed is not None:
            self._mode_changed(*changed)
        if executor.active and self.stopped:  # in a mode that goes on to its end
            executor.drop(self.fault or "emergency stop")

    def _move(self) -> None:
        backend = self.backend
        executor = self.executor
        modes = self.modes
        safety = self.safety
        braked = modes.mode is Mode.EMERGENCY_STOP or (not modes.motors_on and safety.stopped)
        if braked or safety.broken:
            safety.brake()
        elif modes.level is Mode.STAND_ON_MOTORS:
            backend.track(executor.advance(self.speed_scaling.now(), modes.motors_on))
            executor.supervise(backend)
        else:
            backend.rest()

    def _supervise(self) -> None:
        motors_on = self.modes.motors_on
        if motors_on and self.executor.active:
            self.load_checks.look(self.backend)
        self.safety.supervise(motors_on, self.settings.execution.tube)

    def _is_still(self) -> bool:
        still = self.executor.path_speed == 0.0 and self.backend.standing
        return still and not self.safety.emergency.stopping

    def _mode_changed(self, before: Mode, now: Mode) -> None:
        if now is Mode.EMERGENCY_STOP:
            self.safety.entered(before not in READY)
        elif before is Mode.EMERGENCY_STOP:
            self.executor.hold(self.backend.q)
        if now in OFF_THE_NETWORK:
            self.watch.forget()
        if now is not Mode.MOVING and before is not Mode.MOVING:
            self.notices.add(Level.OK, f"{before.name} -> {now.name}")

    def refusal(self) -> str:
        """Why no movement may start now, "" when it may."""
        if self.fault:
            return f"stopped by a fault, recover first: {self.fault}"
        return self.watch.lost or self.control.refusal()

    def _carry(self, load: Carried) -> None:
        self.backend.set_load(self.load_checks.really(load))
        self.load = load
        self.mains.set_load(load)
        self.dynamics = DynamicsModel(self.robot, load.loads, self.cell.base_pose)
        self.executor.set_dynamics(self.dynamics)


# Assembly from names: cell, load and backend.

CELL_TOOL = "cell"
"""Load text that means the tool of the cell."""


def make_simulation(
    cell: str | Cell = "demo",
    load: str = CELL_TOOL,
    backend: str = "pybullet",
    settings: SimulationSettings | None = None,
    data: PowerData | None = None,
    plant: str | Plant = NOMINAL,
) -> Simulation:
    """Simulation of a cell (a Cell, the name of a bundled one or a path) with a load text of its
    loads.

    plant: a Plant or a text that names one, see `plant_named`; the ideal backend has none but its
    own. Raises what ir_description raises for a cell, RequestRefusedError for a load, SettingsError
    for a plant, BackendError.
    """
    settings = settings or SimulationSettings()
    cell = load_cell(cell) if isinstance(cell, str) else cell
    if load == CELL_TOOL:
        load = "none" if cell.tool is None else cell.tool.name
    what = carried(cell, load)
    data = data or cell.robot.controller
    plant = plant_named(plant, cell.robot, data) if isinstance(plant, str) else plant
    if backend == IDEAL:
        plant = ideal_plant(cell.robot, data)
    if not data.has_table:  # no mode to rest in: the brakes stay open while the robot waits
        timers = IdleTimes(data.motors_to_brakes_in_program, data.motors_to_brakes_in_command)
        settings = replace(settings, idle=timers)
    robot = make_backend(backend, cell, settings.dt, settings.control, plant)
    return Simulation(cell, data, robot, what, settings, plant)


def stale(known: int, number: int) -> str:
    """Why a goal or a bit is refused whose sender knows another stop than the last one."""
    news = "this driver was started after the one that the sender knows"
    if same_driver(known, number):
        news = (
            f"stop {stop_count(number)} came after stop {stop_count(known)}, which the sender knows"
        )
    return f"{news}: send it again if it still holds"
