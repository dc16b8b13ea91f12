"""What stops the robot at once, whatever it does: emergency stop, faults of the supervision, failed
physics.

A stop is latched: it lasts until somebody recovers, who moves and resumes nothing.
"""

from __future__ import annotations

from ir_description import RobotModel
from ir_msgs_py.status import StatusCode
from ir_sim_driver.controller.emergency import EmergencyStop
from ir_sim_driver.controller.settings import SimulationSettings
from ir_sim_driver.controller.supervision import Command, Fault, Supervision
from ir_sim_driver.errors import BackendError, RequestRefusedError
from ir_sim_driver.motion import ErrorCode, Executor, ToolPoint
from ir_sim_driver.notices import Level, Notices
from ir_sim_driver.plant import Backend
from ir_sim_driver.plc import Plc


class Safety:
    """Stops `backend` and drops what `executor` does. fault: why the robot is stopped, "" without a
    fault.
    """

    def __init__(
        self,
        robot: RobotModel,
        backend: Backend,
        executor: Executor,
        tool: ToolPoint,
        plc: Plc,
        notices: Notices,
        settings: SimulationSettings,
    ) -> None:
        self._backend = backend
        self._executor = executor
        self._plc = plc
        self._notices = notices
        self._tool = tool
        self._supervision = Supervision(robot, settings.dt, settings.supervision)
        reaction = round(settings.supervision.brake_reaction / settings.dt)
        self.emergency = EmergencyStop(backend, executor, tool, notices, reaction)
        self._broken = False  # the physics gave up: only `recover` touches them
        self._powered = False  # the motors stop the robot until the brakes act
        self.fault = ""

    @property
    def stopped(self) -> bool:
        """Whether an emergency stop or a fault is latched: nothing moves until somebody
        recovers.
        """
        return self._plc.stopped or bool(self.fault)

    @property
    def broken(self) -> bool:
        """Whether the physics cannot be stepped."""
        return self._broken

    def brake(self) -> None:
        """Make a step of dt in which the brakes close."""
        if self._broken:
            self._backend.rest()
        else:
            self.emergency.step()

    def entered(self, braked: bool) -> None:
        """The controller is in EMERGENCY_STOP from now on; braked: the brakes are closed
        already.
        """
        self.emergency.start(self.fault or "emergency stop", braked, self._powered)

    def supervise(self, motors_on: bool, tube: float) -> None:
        """Look at the robot after a step; tube [m]: how far the tool may be from its command."""
        command = Command(self._executor.command, self._deviation(motors_on), tube)
        fault = self._supervision.look(self._backend, command, self.stopped or not motors_on)
        if fault is not None and not self.fault:
            self._stop_for(fault)

    def failed(self, error: BackendError) -> None:
        """The physics gave up."""
        self._broken = True
        self._backend.rest()
        self._stop_for(Fault(str(error), ErrorCode.INVALID_GOAL))

    def touched(self, sentence: str) -> None:
        """The robot touches what it may not: the motors stop it off its path, then the brakes hold
        it.
        """
        self._powered = not self.stopped
        if not self.fault:
            self._stop_for(Fault(sentence, ErrorCode.CONTACT))

    def recover(self) -> None:
        """Unlatch all where the robot is now. Raises RequestRefusedError while the button is
        pressed.
        """
        if self._plc.pressed:
            raise RequestRefusedError(
                StatusCode.INVALID_ROBOT_STATE,
                "the emergency stop is still pressed: release it first",
            )
        q = self._backend.q
        if self._broken:
            self._backend.reset(q)
        if not self.emergency.stopping:
            self._executor.hold(q)
        self.fault = ""
        self._broken = False
        self._powered = False
        self._supervision.recovered(q)
        self._plc.reset_stop()

    def _deviation(self, motors_on: bool) -> float:
        """How far the tool is from its command [m]; behind closed brakes, from where they
        closed.
        """
        executor = self._executor
        q = self._backend.q
        if motors_on:
            return executor.deviation
        if self.emergency.stopping or self._broken or q is executor.command:
            return 0.0
        return self._tool.deviation(executor.command, q)

    def _stop_for(self, fault: Fault) -> None:
        """STOP 0: the brakes close at once, and stay so until somebody recovers."""
        self.fault = fault.sentence
        self._notices.add(Level.ERROR, f"{fault.sentence}; stopped by the brakes until recovered")
        self._executor.drop(fault.sentence, fault.code)
