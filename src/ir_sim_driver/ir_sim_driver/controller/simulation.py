"""The robot and its controller as one stepped thing: PLC, power modes, executor, physics, mains meter. No
ROS.

One `step` is dt of plant time. Whoever steps it decides how fast time passes; nothing here sleeps or asks a
clock.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.modes import Mode
from ir_msgs_py.plc import OperatingMode, PlcOutputs
from ir_msgs_py.status import StatusCode
from ir_sim_driver.controller.emergency import EmergencyStop
from ir_sim_driver.controller.pause import Pauses
from ir_sim_driver.controller.settings import SimulationSettings
from ir_sim_driver.errors import BackendError, RequestRefusedError, TrajectoryRefusedError
from ir_sim_driver.motion.execution_settings import ExecutionSettings
from ir_sim_driver.motion.executor import Executor
from ir_sim_driver.motion.goal import ErrorCode, Outcome, TrajectoryGoal
from ir_sim_driver.motion.manual_speed import manual_scaling
from ir_sim_driver.motion.tool_point import ToolPoint
from ir_sim_driver.motion.trajectory_checks import check_goal, check_trajectory, checked_route
from ir_sim_driver.notices import Level, Notices
from ir_sim_driver.plant.backend import Backend
from ir_sim_driver.plant.loads import Carried
from ir_sim_driver.plant.power_meter import BasePower, PowerMeter
from ir_sim_driver.plc.inputs import Plc
from ir_sim_driver.plc.watchdog import Watchdog
from ir_sim_driver.power.power_modes import OFF_THE_NETWORK, PowerModes, Wish

METER_STEPS = 250  # at the latest: arrays of many steps cost what arrays of few do
_HOME = 0.01  # rad
_MANUAL = (OperatingMode.T1, OperatingMode.T2)


@dataclass(frozen=True, eq=False)
class VettedGoal:
    """A goal whose trajectory was found executable with the dynamics of one load."""

    goal: TrajectoryGoal
    dynamics: Any


class Simulation:
    """cell: ir_description Cell; data: PowerData; backend: a robot of the same kind with the same dt.

    Raises nothing in `step`: a backend that fails is stopped, told in `notices`, and restarted by `recover`.
    """

    def __init__(
        self,
        cell: Any,
        data: Any,
        backend: Backend,
        load: Carried,
        settings: SimulationSettings | None = None,
    ) -> None:
        self.settings = settings = settings or SimulationSettings()
        self.cell, self.robot, self.backend = cell, cell.robot, backend
        self.notices = Notices()
        self.plc = Plc(settings.plc, self.notices, settings.controller.mode_switch)
        self.modes = PowerModes(settings.transitions, settings.controller.rest_at_start)
        self.base = BasePower(data)
        self.meter = PowerMeter(cell.robot, data, settings.dt, settings.controller.regeneration_mode)
        self.tool = ToolPoint(cell.robot, cell.base_pose, cell.tcp)
        pe_ids = {Mode[mode.name]: mode.pe_mode_id for mode in data.modes}
        self.pauses = Pauses(self.modes, self.plc, self.standing_power, pe_ids)
        backend.reset(np.array(cell.machine_home))
        self.dynamics = DynamicsModel(self.robot, (), cell.base_pose)
        self.executor = Executor(
            self.robot, self.dynamics, self.tool, settings.execution, settings.dt, np.array(cell.machine_home)
        )
        self.emergency = EmergencyStop(backend, self.executor, self.tool, self.notices)
        self.load = load
        self._carry(load)
        self.steps = 0
        self.speed_scaling = 1.0
        self.fault = ""
        self.watch = Watchdog()
        self._goals = 0
        self._outcomes: list[Outcome] = []
        self._goal_energy = 0.0
        self._drives_off = False
        self._wake = self._recover = self._confirmed = self._restart = False
        self._last_mode = self.modes.mode
        self._last_operating_mode = self.plc.operating_mode

    @property
    def time(self) -> float:
        """Plant time [s] since the start."""
        return self.steps * self.settings.dt

    @property
    def on_the_network(self) -> bool:
        """Whether the controller answers; the mains meter always does."""
        return self.modes.mode not in OFF_THE_NETWORK

    # -- what may be asked ----------------------------------------------------------------------------------

    def vet(self, goal: TrajectoryGoal, now_ns: int) -> VettedGoal:
        """Check all of a goal that does not depend on the robot's state. Takes its time, may run beside
        `step`.

        Raises TrajectoryRefusedError.
        """
        dynamics, settings = self.dynamics, self.settings.execution
        checked = check_goal(goal, tuple(self.robot.joint_names), settings, now_ns)
        check_trajectory(checked.trajectory, self.robot, dynamics, settings, self.settings.dt)
        return VettedGoal(checked, dynamics)

    def execute(self, vetted: VettedGoal, now_ns: int) -> int:
        """Start a vetted goal and return its id; the goal that runs is preempted. Raises
        TrajectoryRefusedError.
        """
        refusal = self._refusal()
        if refusal:
            raise TrajectoryRefusedError(ErrorCode.INVALID_GOAL, refusal)
        if vetted.dynamics is not self.dynamics:
            raise TrajectoryRefusedError(
                ErrorCode.INVALID_GOAL, "the load changed while the trajectory was checked"
            )
        goal, s = vetted.goal, self.settings
        route = checked_route(
            goal.trajectory, self.executor.motion(), self.robot, self.dynamics, s.execution, s.dt
        )
        self._goals += 1
        delay = 0.0 if goal.stamp_ns == 0 else max(0.0, (goal.stamp_ns - now_ns) * 1e-9)
        self.executor.start(self._goals, goal, route, delay)
        self._collect_outcomes()
        self.settle_meter()
        self._goal_energy = self.meter.reading().energy
        return self._goals

    def cancel(self, goal_id: int) -> bool:
        """Stop this goal along its path; False when it does not run."""
        if self.executor.goal_id != goal_id:
            return False
        self.executor.stop(ErrorCode.SUCCESSFUL, "canceled; stopped on the path", canceled=True)
        return True

    def abort(self, sentence: str) -> None:
        """Stop whatever runs along its path, for this reason."""
        self.executor.stop(ErrorCode.INVALID_GOAL, sentence)

    def take_outcomes(self) -> list[Outcome]:
        """Goals that ended since the last call."""
        outcomes, self._outcomes = self._outcomes, []
        return outcomes

    def set_speed_scaling(self, factor: float) -> float:
        """Take the factor into [0, 1] and return it; NaN and negative ones are ignored with a warning."""
        if not factor >= 0.0:
            self.notices.add(Level.WARN, f"speed scaling {factor:g} ignored: it must be in [0, 1]")
        else:
            self.speed_scaling = min(factor, 1.0)
        return self.speed_scaling

    def standing_power(self, level: Mode) -> float:
        """Watts at the mains when standing in a mode at the present posture."""
        watts = self.base.of(level)
        if level is Mode.STAND_ON_MOTORS:
            q = self.backend.q[None]
            hold = self.dynamics.gravity(q) - self.dynamics.counterbalance(q)
            watts += float(self.dynamics.axis_power(np.zeros_like(q), hold).sum())
        return watts

    def set_load(self, load: Carried) -> None:
        """Carry this from now on. Raises RequestRefusedError while the robot moves."""
        if self.executor.active or not self._standing():
            raise RequestRefusedError(
                StatusCode.INVALID_ROBOT_STATE, "the robot moves: a load changes only while it stands"
            )
        self.settle_meter()
        self._carry(load)

    def set_execution(self, settings: ExecutionSettings) -> None:
        """Use other bounds of trajectories from the next goal on."""
        self.settings = replace(self.settings, execution=settings)
        self.executor.set_settings(settings)

    def wake(self) -> None:
        """A Wake-on-LAN packet for this controller came in. Does nothing unless it hibernates."""
        if self.modes.mode is Mode.HIBERNATION:
            self._wake = True

    def recover(self) -> str:
        """Leave the emergency stop: release the brakes where the robot stands. Never moves or resumes
        anything.

        Returns a remark. Raises RequestRefusedError.
        """
        if self.modes.mode is not Mode.EMERGENCY_STOP and not self.fault:
            return f"nothing to recover from: the mode is {self.modes.mode.name}"
        if self.plc.raw.emergency_stop or self.plc.levels.emergency_stop:
            raise RequestRefusedError(
                StatusCode.INVALID_ROBOT_STATE, "the emergency stop is still pressed: release it first"
            )
        if self.fault:
            self.backend.reset(self.backend.q)
            self.executor.hold(self.backend.q)
            self.fault = ""
        self._recover = self.modes.mode is Mode.EMERGENCY_STOP
        return "the brakes open where the robot stands; nothing resumes"

    def disturb(self, torque: FloatArray | None) -> None:
        """Let an outside torque (n,) [Nm] act on the joints until the next call; None ends it."""
        self.backend.disturbance = torque

    # -- what may be read -----------------------------------------------------------------------------------

    def outputs(self) -> PlcOutputs:
        """Levels to the PLC; all off while the controller is off the network."""
        if not self.on_the_network:
            return PlcOutputs(operating_mode=self.plc.operating_mode)
        mode = self.modes.mode
        return PlcOutputs(
            ab=mode in (Mode.BUS_POWER_OFF, Mode.TO_HIBERNATION),
            bbs=mode in (Mode.STAND_ON_MOTORS, Mode.MOVING, Mode.STAND_ON_BRAKES) and not self._drives_off,
            drives_ready=self.modes.motors_on,
            alarm_stop=not self.plc.levels.emergency_stop and mode is not Mode.EMERGENCY_STOP,
            in_home=bool(np.abs(self.backend.q - self.cell.machine_home).max() < _HOME),
            moving=mode is Mode.MOVING,
            operating_mode=self.plc.operating_mode,
        )

    def settle_meter(self) -> None:
        """Bring the meter's reading up to the last step."""
        self.meter.settle(self.backend.work())

    # -- time -----------------------------------------------------------------------------------------------

    def step(self) -> None:
        """Let dt pass."""
        dt = self.settings.dt
        if self.plc.step(dt, self.pauses.rest is not None):
            self._react_to_plc()
        if self.watch.step(self.time):
            self.notices.add(Level.WARN, f"{self.watch.lost}; stopped on the path until it is back")
            self.abort(f"{self.watch.lost}; stopped on the path")
        self.modes.step(dt, self._wish())
        if self.modes.mode is not self._last_mode:
            self._mode_changed(self._last_mode, self.modes.mode)
            self._last_mode = self.modes.mode
        try:
            self._move()
        except BackendError as error:
            self._fail(error)
        self.meter.add(self.base.of(self.modes.level))
        self._collect_outcomes()
        if self.meter.pending() >= METER_STEPS:
            self.settle_meter()
        self.steps += 1

    def run(self, seconds: float) -> None:
        """Step until `seconds` have passed."""
        for _ in range(round(seconds / self.settings.dt)):
            self.step()

    def _move(self) -> None:
        backend, executor = self.backend, self.executor
        if self.fault:
            backend.rest()
        elif self.modes.mode is Mode.EMERGENCY_STOP:
            self.emergency.step()
        elif self.modes.level is Mode.STAND_ON_MOTORS:
            backend.track(executor.advance(self._scaling(), self.modes.motors_on))
            executor.supervise(backend)
        else:
            backend.rest()

    def _scaling(self) -> float:
        scaling = self.speed_scaling if self.plc.levels.move_enable else 0.0
        path = self.executor.path
        if self.plc.operating_mode is OperatingMode.T1 and path is not None:
            s, stop_time = self.executor.path_parameter, self.settings.execution.stop_time
            scaling = min(scaling, manual_scaling(self.tool, path, s, stop_time))
        return scaling

    def _wish(self) -> Wish:
        plc, executor, pauses = self.plc, self.executor, self.pauses
        if self.modes.motors_on:
            pauses.wants_motors = False
        active = executor.active
        rest = plc.rest or pauses.rest
        if rest is None:
            if self._drives_off:
                rest = Mode.STAND_ON_BRAKES
            elif pauses.wants_motors:
                rest = Mode.STAND_ON_MOTORS
        if active and (self._restart or (rest is not None and rest is not Mode.STAND_ON_MOTORS)):
            what = "Cold start" if self._restart else _name(rest)
            self.abort(f"{what} was requested during the movement; stopped on the path")
        wish = Wish(
            rest,
            active and (executor.path_speed > 0.0 or executor.stopping or self._scaling() > 0.0),
            self._standing(),
            self._wake,
            plc.levels.emergency_stop or bool(self.fault),
            self._recover,
            self._restart,
            plc.operating_mode in _MANUAL,
        )
        self._wake = False
        return wish

    def _standing(self) -> bool:
        return self.executor.path_speed == 0.0 and self.backend.standing

    def _react_to_plc(self) -> None:
        plc = self.plc
        if plc.levels.drives_off and not self._drives_off:
            self._drives_off = True
        if plc.drives_on and not plc.levels.drives_off:
            self._drives_off = False
            self.pauses.wants_motors = True
            self._recover = self._recover or (self._confirmed and not plc.levels.emergency_stop)
        if plc.confirm and not plc.levels.emergency_stop:
            self._confirmed = True
        self._restart = self._restart or plc.restart
        if plc.operating_mode is not self._last_operating_mode:
            self._last_operating_mode = plc.operating_mode
            self.abort(f"the operating mode changed to {plc.operating_mode.name}; stopped on the path")

    def _mode_changed(self, before: Mode, now: Mode) -> None:
        if now is Mode.EMERGENCY_STOP:
            self._recover = self._confirmed = self.pauses.wants_motors = False
            self.emergency.start(self.fault or "emergency stop", self._standing())
        elif before is Mode.EMERGENCY_STOP:
            self._recover = self._confirmed = False
            self.executor.hold(self.backend.q)
        elif before is Mode.FROM_HIBERNATION:
            self.plc.wake()
            self._restart = False
        if now in OFF_THE_NETWORK:
            self.watch.forget()
            self.pauses.rest = None
            self._restart = self._drives_off = False
        if now is not Mode.MOVING and before is not Mode.MOVING:
            self.notices.add(Level.OK, f"{before.name} -> {now.name}")

    def _fail(self, error: BackendError) -> None:
        self.fault = str(error)
        self.notices.add(Level.ERROR, self.fault)
        self.executor.drop(self.fault)
        self.backend.rest()

    def _refusal(self) -> str:
        """Why no movement may start now; "" when it may."""
        mode, plc = self.modes.mode, self.plc
        if self.fault:
            return f"the simulation has failed: {self.fault}"
        if self.watch.lost:
            return self.watch.lost
        if mode is Mode.EMERGENCY_STOP or plc.levels.emergency_stop:
            return "emergency stop: release it and recover first"
        if mode not in (*_READY, Mode.STAND_ON_BRAKES, Mode.TO_BRAKES, Mode.FROM_BRAKES):
            return f"drives not powered ({mode.name})"
        rest = plc.rest or self.pauses.rest
        if rest is not None:
            return f"drives not powered: {_name(rest)} is requested"
        if self._drives_off:
            return "drives not powered: drives_off was given, drives_on is needed"
        if plc.operating_mode in _MANUAL and not self.settings.controller.enabling_switch:
            return (
                f"operating mode is {plc.operating_mode.name}: programs need EXT or AUT, or the "
                "enabling switch"
            )
        return ""

    def _carry(self, load: Carried) -> None:
        self.backend.set_load(load.loads)
        self.load = load
        self.base.set_tool(load.watts_always, load.watts_drive_bus)
        self.dynamics = DynamicsModel(self.robot, load.loads, self.cell.base_pose)
        self.executor.set_dynamics(self.dynamics)

    def _collect_outcomes(self) -> None:
        outcomes = self.executor.take_outcomes()
        if outcomes:
            self.settle_meter()
            energy = self.meter.reading().energy - self._goal_energy
            self._outcomes += [replace(outcome, energy=energy) for outcome in outcomes]


_READY = (Mode.STAND_ON_MOTORS, Mode.MOVING)


def _name(rest: Mode | None) -> str:
    return "" if rest is None else rest.name.replace("_", " ").capitalize()
