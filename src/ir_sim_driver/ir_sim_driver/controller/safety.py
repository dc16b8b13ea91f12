"""Safety stops: emergency stop (STOP 0), faults of the supervision, failed physics, contacts.

A stop is latched: it lasts until a person recovers, which moves and resumes nothing.
"""

from __future__ import annotations

import numpy as np

from ir_description import RobotModel
from ir_msgs_py.status import StatusCode
from ir_sim_driver.controller.settings import SimulationSettings
from ir_sim_driver.controller.supervision import CommandedPosition, Fault, Supervision
from ir_sim_driver.errors import BackendError, RequestRefusedError
from ir_sim_driver.motion import ErrorCode, Executor, Path, ToolPoint
from ir_sim_driver.notices import Level, Notices
from ir_sim_driver.plant import Backend
from ir_sim_driver.plc import Plc
from ir_values.arrays import FloatArray

# Excursion: how far the tool leaves its path while the brakes stop the robot.

_AHEAD = 2.0  # s of path that a stop can cover at most
# one every 5 ms: a chord of them leaves the path by less than 0.1 mm at working speed
_SAMPLES = 400


class StopExcursion:
    """Collects configurations (n,) while the robot stops; `distance` is the farthest the tool was
    from the path ahead.
    """

    def __init__(self, tool: ToolPoint, path: Path | None, s: float, q: FloatArray) -> None:
        self._tool = tool
        instants = np.linspace(s, s + _AHEAD, _SAMPLES) if path is not None else np.empty(0)
        points = [path.position(float(t)) for t in instants] if path is not None else [q]
        self._path = tool.positions(np.array(points))
        self._visited = [q]

    def add(self, q: FloatArray) -> None:
        """Count a configuration (n,)."""
        self._visited.append(q)

    def distance(self) -> float:
        """Largest distance [m] of the visited tool points from the path, which is taken as a
        polyline.
        """
        points = self._tool.positions(np.array(self._visited))
        start = self._path[:-1]
        step = np.diff(self._path, axis=0)
        if len(start) == 0:
            return float(np.linalg.norm(points - self._path[0], axis=1).max())
        length = np.maximum((step**2).sum(axis=1), 1e-18)
        along = np.clip(((points[:, None] - start) * step).sum(axis=2) / length, 0.0, 1.0)
        nearest = start + along[:, :, None] * step
        return float(np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1).max())


# The emergency stop (STOP 0): motors off, then brakes with all they have, off the path if need
# be.
#
# Between the two lies the brakes' reaction time, in which the arm rolls on and sags. The command
# is not followed any more; afterwards it is where the robot stands, so nothing can jump or
# resume.

_STANDS = 1e-9  # rad/s; the brakes bring the speed to zero within a step


class EmergencyStop:
    """Stops `backend` and drops what `executor` does; reaction: steps until the brakes act.

    excursion [m]: how far the tool left its path, or its place, in the last stop.
    """

    def __init__(
        self, backend: Backend, executor: Executor, tool: ToolPoint, notices: Notices, reaction: int
    ) -> None:
        self._backend = backend
        self._executor = executor
        self._tool = tool
        self._notices = notices
        self._reaction = reaction
        self._open = 0
        self._powered = False
        self._running: StopExcursion | None = None
        self.excursion = 0.0

    @property
    def stopping(self) -> bool:
        """Whether the robot still rolls on or slows down."""
        return self._running is not None

    def start(self, sentence: str, braked: bool, powered: bool = False) -> None:
        """Stop; the goal ends with this sentence. braked: the brakes are closed; powered: the
        motors stop the robot until the brakes act, else they are off.
        """
        executor = self._executor
        q = self._backend.q
        self._running = (
            None if braked else StopExcursion(self._tool, executor.path, executor.path_parameter, q)
        )
        self._open = 0 if braked else self._reaction
        self._powered = powered
        executor.drop(sentence)
        executor.hold(q)

    def close_brakes(self) -> None:
        """The brakes have closed while no physics were there to show it."""
        self._open = 0

    def step(self) -> None:
        """Make a step of dt: coast, or halt, while the brakes react; brake, then rest."""
        backend = self._backend
        if self._open > 0:
            self._open -= 1
            if self._powered:
                backend.halt()
            else:
                backend.coast()
            self._visit()
        elif backend.qd.any():
            backend.brake()
            self._visit()
            if np.abs(backend.qd).max() < _STANDS:
                self._stopped()
        else:
            backend.rest()
            if self._running is not None:
                self._stopped()

    def _visit(self) -> None:
        if self._running is not None:
            self._running.add(self._backend.q)

    def _stopped(self) -> None:
        self._backend.reset(self._backend.q)
        self._executor.hold(self._backend.q)
        if self._running is not None:
            self.excursion = self._running.distance()
            self._running = None
            off = f"the tool left its path by {self.excursion * 1e3:.1f} mm"
            self._notices.add(Level.WARN, f"emergency stop: {off}; recover to go on")


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
        return self._plc.stop.stopped

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
        command = CommandedPosition(self._executor.command, self._deviation(motors_on), tube)
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
        if self._plc.stop.pressed:
            raise RequestRefusedError(
                StatusCode.INVALID_ROBOT_STATE,
                "the emergency stop is still pressed: release it first",
            )
        q = self._backend.q
        if self._broken:
            self._backend.reset(q)
            self.emergency.close_brakes()
        if not self.emergency.stopping:
            self._executor.hold(q)
        self.fault = ""
        self._broken = False
        self._powered = False
        self._supervision.recovered(q)
        self._plc.stop.recover()

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
        self._plc.stop.fault(self._plc.order)
        self._notices.add(Level.ERROR, f"{fault.sentence}; stopped by the brakes until recovered")
        self._executor.drop(fault.sentence, fault.code)
